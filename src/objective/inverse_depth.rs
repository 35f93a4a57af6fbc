//! What a frame's off-the-shelf depth gives to Eq. 6.

use crate::bridge::ceres::ffi::SeenDepth;
use crate::image::Grid;
use crate::sequence::Frame;
use crate::visibility::Visibility;
use nalgebra::{Matrix3, Vector3};

/// Pixels on each side of the middle one that make the slope of d'.
const REACH: isize = 2;
/// A neighbour whose d' differs by more than this share belongs to another surface, or to none.
const SAME_SURFACE: f64 = 0.05;

/// So far, pixels, a depth without neighbours speaks for the nearest visible point: about the spacing of the points, few
/// of which fall on the very pixel of a sparse reconstruction's depth.
const LONE_REACH: isize = 4;

/// d' where the visible points of `frame` are seen, in units in which α is about 1: where it is known, inside the
/// mask only. `index` is the frame's.
pub(super) fn seen(index: usize, visible: &Visibility, frame: &Frame, input_unit: f64) -> Vec<SeenDepth> {
    let on_point = visible.points.iter().filter_map(|point| {
        let pixel = (point.pixel.0 as usize, point.pixel.1 as usize);
        let inverse_depth = known(frame, pixel)?;
        Some((point.point, pixel, inverse_depth))
    });
    on_point
        .chain(beside_points(visible, frame))
        .map(|(point, pixel, inverse_depth)| {
            let [by_column, by_row] = slope(frame, pixel, inverse_depth);
            SeenDepth {
                frame: index as u32,
                point,
                column: pixel.0 as f64 + 0.5,
                row: pixel.1 as f64 + 0.5,
                inverse_depth: inverse_depth / input_unit,
                by_column: by_column / input_unit,
                by_row: by_row / input_unit,
            }
        })
        .collect()
}

/// Lone depths that no visible point falls on, each for the nearest one.
fn beside_points(visible: &Visibility, frame: &Frame) -> Vec<(u32, (usize, usize), f64)> {
    let Some(depth) = &frame.depth else {
        return Vec::new();
    };
    let (width, height) = depth.size();
    let mut point_at = Grid::filled(width, height, None);
    for point in &visible.points {
        point_at[(point.pixel.0 as usize, point.pixel.1 as usize)] = Some(point.point);
    }
    let nearest = |pixel| {
        let there = window(pixel, LONE_REACH)
            .filter_map(|(offset, neighbour)| Some((offset, (*point_at.get(neighbour.0, neighbour.1)?)?)));
        there.min_by_key(|&((column, row), point)| (column * column + row * row, point))
    };
    let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    pixels
        .filter_map(|pixel| {
            let inverse_depth = known(frame, pixel)?;
            let lone = window(pixel, REACH)
                .filter(|&(_, neighbour)| known(frame, neighbour).is_some())
                .nth(1)
                .is_none();
            let (offset, point) = nearest(pixel).filter(|_| lone)?;
            (offset != (0, 0)).then_some((point, pixel, inverse_depth))
        })
        .collect()
}

/// The pixels no further than `reach` from `pixel` in columns and rows, itself among them, with their offsets; the image's
/// left and top end them.
fn window(pixel: (usize, usize), reach: isize) -> impl Iterator<Item = ((isize, isize), (usize, usize))> {
    (-reach..=reach).flat_map(move |row| {
        (-reach..=reach).filter_map(move |column| {
            let neighbour = pixel
                .0
                .checked_add_signed(column)
                .zip(pixel.1.checked_add_signed(row))?;
            Some(((column, row), neighbour))
        })
    })
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
    for ((column, row), neighbour) in window(pixel, REACH) {
        let Some(d) = known(frame, neighbour) else {
            continue;
        };
        if (d - inverse_depth).abs() < SAME_SURFACE * inverse_depth {
            let basis = Vector3::new(column as f64, row as f64, 1.0);
            normal += basis * basis.transpose();
            right += basis * d;
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
    use crate::visibility::VisiblePoint;

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
            depth_deviation: None,
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
    fn a_lone_depth_speaks_for_the_nearest_visible_point_and_dense_ones_for_their_own_alone() {
        let at = |pixels: &[(u32, u32)]| Visibility {
            points: pixels
                .iter()
                .zip(7..)
                .map(|(&pixel, point)| VisiblePoint {
                    point,
                    pixel,
                    inverse_depth: 0.5,
                })
                .collect(),
            unoccluded: Vec::new(),
        };
        let points = at(&[(0, 0), (4, 1), (6, 5), (7, 7)]);
        let places = |frame: &Frame| -> Vec<(u32, f64, f64)> {
            let seen = seen(0, &points, frame, 1.0);
            seen.iter().map(|d| (d.point, d.column, d.row)).collect()
        };
        let lone = frame(|column, row| {
            if [(4, 4), (0, 0)].contains(&(column, row)) {
                2.0
            } else {
                0.0
            }
        });
        assert_eq!(places(&lone), [(7, 0.5, 0.5), (9, 4.5, 4.5)]);
        let far = frame(|column, row| if (column, row) == (0, 7) { 2.0 } else { 0.0 });
        assert_eq!(places(&far), []);
        let dense = frame(|_, _| 2.0);
        assert_eq!(places(&dense).len(), 4);
    }

    #[test]
    fn without_neighbours_there_is_no_slope() {
        let lone = frame(|column, row| if (column, row) == (4, 4) { 2.0 } else { 0.0 });
        assert_eq!(slope(&lone, (4, 4), 0.5), [0.0; 2]);
    }
}
