//! What a frame's off-the-shelf depth gives to Eq. 6.

use crate::bridge::ceres::ffi::SeenDepth;
use crate::sequence::Frame;
use crate::visibility::Visibility;
use nalgebra::{Matrix3, Vector3};

/// Pixels on each side of the middle one that make the slope of d'.
const REACH: isize = 2;
/// A neighbour whose d' differs by more than this share belongs to another surface, or to none.
const SAME_SURFACE: f64 = 0.05;

/// d' where the visible points of `frame` are seen, in units in which α is about 1: where it is known, inside the
/// mask only.
pub(super) fn seen(visible: &Visibility, frame: &Frame, input_unit: f64) -> Vec<SeenDepth> {
    visible
        .points
        .iter()
        .filter_map(|point| {
            let pixel = (point.pixel.0 as usize, point.pixel.1 as usize);
            let inverse_depth = known(frame, pixel)?;
            let [by_column, by_row] = slope(frame, pixel, inverse_depth);
            Some(SeenDepth {
                point: point.point,
                column: pixel.0 as f64 + 0.5,
                row: pixel.1 as f64 + 0.5,
                inverse_depth: inverse_depth / input_unit,
                by_column: by_column / input_unit,
                by_row: by_row / input_unit,
            })
        })
        .collect()
}

fn known(frame: &Frame, pixel: (usize, usize)) -> Option<f64> {
    let z = f64::from(*frame.depth.as_ref()?.get(pixel.0, pixel.1)?);
    (frame.mask[pixel] && z > 0.0).then(|| 1.0 / z)
}

/// The least-squares plane's slope through d' around `pixel`, per column and per row; zero where too few
/// neighbours are known.
fn slope(frame: &Frame, pixel: (usize, usize), inverse_depth: f64) -> [f64; 2] {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for row in -REACH..=REACH {
        for column in -REACH..=REACH {
            let neighbour = pixel
                .0
                .checked_add_signed(column)
                .zip(pixel.1.checked_add_signed(row));
            let Some(d) = neighbour.and_then(|neighbour| known(frame, neighbour)) else {
                continue;
            };
            if (d - inverse_depth).abs() < SAME_SURFACE * inverse_depth {
                let basis = Vector3::new(column as f64, row as f64, 1.0);
                normal += basis * basis.transpose();
                right += basis * d;
            }
        }
    }
    // Below this determinant the known neighbours are too few or lie on a line.
    match normal.try_inverse() {
        Some(inverse) if normal.determinant() > 1.0 => {
            let plane = inverse * right;
            [plane.x, plane.y]
        }
        _ => [0.0; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pinhole;
    use crate::image::{DepthMap, Mask, RgbImage};

    fn frame(depth: impl Fn(usize, usize) -> f32) -> Frame {
        Frame {
            name: "0".into(),
            image: RgbImage::from_fn(9, 8, |_, _| [0.0; 3]),
            mask: Mask::from_fn(9, 8, |column, _| column < 8),
            camera: Pinhole {
                fx: 9.0,
                fy: 9.0,
                cx: 4.5,
                cy: 4.0,
            },
            timestamp_s: None,
            camera_from_input: None,
            depth: Some(DepthMap::from_fn(9, 8, depth)),
        }
    }

    #[test]
    fn the_slope_of_a_plane_in_inverse_depth_is_found_despite_holes_and_other_surfaces() {
        let tilted = frame(|column, row| match (column, row) {
            (4, 4) | (3, 3) => 0.0,
            (5, 2) => 9.0,
            _ => 1.0 / (0.5 + 0.002 * column as f32 - 0.003 * row as f32),
        });
        let middle = known(&tilted, (4, 3)).unwrap();
        let [by_column, by_row] = slope(&tilted, (4, 3), middle);
        assert!(
            (by_column - 0.002).abs() < 1e-6 && (by_row + 0.003).abs() < 1e-6,
            "{by_column} {by_row}"
        );
        assert_eq!(known(&tilted, (4, 4)), None);
        assert_eq!(known(&tilted, (8, 3)), None, "outside the mask");
    }

    #[test]
    fn without_neighbours_there_is_no_slope() {
        let lone = frame(|column, row| if (column, row) == (4, 4) { 2.0 } else { 0.0 });
        assert_eq!(slope(&lone, (4, 4), 0.5), [0.0; 2]);
    }
}
