//! Distorted frames become pinhole frames of the same size, focal lengths and principal point.

use super::distortion::Distortion;
use crate::geometry::{Pinhole, Vector2};
use crate::image::PixelMap;

/// Far outside every image.
const NOWHERE: [f64; 2] = [-1e6, -1e6];

/// For every pixel of the pinhole image, where the lens put it. Pixels that the lens model does not reach one to one
/// lie outside.
pub(super) fn distorted_from_pinhole(
    camera: &Pinhole,
    distortion: &Distortion,
    (width, height): (usize, usize),
) -> PixelMap {
    PixelMap::new(width, height, |u, v| {
        let ray = camera.unproject(&Vector2::new(u, v), 1.0).xy();
        if !distortion.is_regular_at(ray) {
            return NOWHERE;
        }
        let moved = distortion.distort(ray);
        [camera.fx * moved.x + camera.cx, camera.fy * moved.y + camera.cy]
    })
}

#[cfg(all(test, feature = "vision"))]
mod tests {
    use super::*;
    use crate::image::Grid;

    /// On a linear ramp interpolation is exact, so the undistorted image shows the distorted coordinates themselves.
    #[test]
    fn a_ramp_shows_where_each_pixel_came_from() {
        let camera = Pinhole {
            fx: 60.0,
            fy: 55.0,
            cx: 40.3,
            cy: 29.1,
        };
        let lens = Distortion::Polynomial {
            numerator: [0.08, -0.02, 0.0],
            denominator: [0.0; 3],
            tangential: [0.01, -0.005],
        };
        let ramp = Grid::from_fn(80, 60, |c, r| {
            [(c as f32 + 0.5) * 2.0, (r as f32 + 0.5) * 3.0, 9.0]
        });
        let map = distorted_from_pinhole(&camera, &lens, ramp.size());
        let straight = map.rgb(&ramp).unwrap();
        for (column, row) in [(40, 29), (20, 15), (60, 45), (25, 50)] {
            let ray = Vector2::new(
                (column as f64 + 0.5 - camera.cx) / camera.fx,
                (row as f64 + 0.5 - camera.cy) / camera.fy,
            );
            let moved = lens.distort(ray);
            let expected = [
                (camera.fx * moved.x + camera.cx) * 2.0,
                (camera.fy * moved.y + camera.cy) * 3.0,
            ];
            let found = straight[(column, row)];
            // OpenCV rounds map entries to 1/32 px.
            assert!(
                (f64::from(found[0]) - expected[0]).abs() < 2.0 / 32.0,
                "{column} {row}"
            );
            assert!(
                (f64::from(found[1]) - expected[1]).abs() < 3.0 / 32.0,
                "{column} {row}"
            );
        }
    }
}
