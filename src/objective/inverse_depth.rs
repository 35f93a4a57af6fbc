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

/// Stands for a pixel without a known depth, or without a visible point.
const NONE: u32 = u32::MAX;

/// d' of one frame: what does not depend on where the shape is.
pub(super) struct KnownDepths {
    /// Per pixel, row by row: the index into `depths` or [`NONE`]. Empty where the frame has no depth.
    at_pixel: Grid<u32>,
    /// Row by row.
    depths: Vec<KnownDepth>,
    /// Indices into `depths`: those that have no neighbour.
    lone: Vec<u32>,
}

/// d' of a pixel inside the mask, in the units of the off-the-shelf reconstruction.
struct KnownDepth {
    pixel: (u32, u32),
    inverse_depth: f64,
    by_column: f64,
    by_row: f64,
    /// The standard deviation of d'; 0 where it is not known.
    deviation: f64,
}

impl KnownDepths {
    pub fn new(frame: &Frame) -> Self {
        let (width, height) = frame.depth.as_ref().map_or((0, 0), Grid::size);
        let (mut depths, mut lone) = (Vec::new(), Vec::new());
        let at_pixel = Grid::from_fn(width, height, |column, row| {
            let Some(inverse_depth) = known(frame, (column, row)) else {
                return NONE;
            };
            let index = depths.len() as u32;
            let around = window((column, row), REACH);
            if around
                .filter(|&(_, neighbour)| known(frame, neighbour).is_some())
                .nth(1)
                .is_none()
            {
                lone.push(index);
            }
            let [by_column, by_row] = slope(frame, (column, row), inverse_depth);
            depths.push(KnownDepth {
                pixel: (column as u32, row as u32),
                inverse_depth,
                by_column,
                by_row,
                deviation: inverse_depth * share_of_deviation(frame, (column, row)),
            });
            index
        });
        Self {
            at_pixel,
            depths,
            lone,
        }
    }

    /// d' where the `visible` points are seen, in units in which α is about 1: where it is known, inside the mask only.
    /// `frame` is the frame's index. A depth whose standard deviation is the `huber` width of the residuals, in the same units, weighs half of an
    /// exact one: the width says how far depths are off that say nothing of themselves.
    pub fn seen(&self, frame: usize, visible: &Visibility, input_unit: f64, huber: f64) -> Vec<SeenDepth> {
        let on_point = visible.points.iter().filter_map(|point| {
            let (column, row) = point.pixel;
            let &index = self.at_pixel.get(column as usize, row as usize)?;
            Some((point.point, self.depths.get(index as usize)?))
        });
        on_point
            .chain(self.beside_points(visible))
            .map(|(point, depth)| SeenDepth {
                frame: frame as u32,
                point,
                column: f64::from(depth.pixel.0) + 0.5,
                row: f64::from(depth.pixel.1) + 0.5,
                inverse_depth: depth.inverse_depth / input_unit,
                by_column: depth.by_column / input_unit,
                by_row: depth.by_row / input_unit,
                weight: 1.0 / (1.0 + (depth.deviation / input_unit / huber).powi(2)),
            })
            .collect()
    }

    /// Lone depths that no visible point falls on, each for the nearest one.
    fn beside_points(&self, visible: &Visibility) -> Vec<(u32, &KnownDepth)> {
        if self.lone.is_empty() {
            return Vec::new();
        }
        let (width, height) = self.at_pixel.size();
        let mut point_at = Grid::filled(width, height, NONE);
        for point in &visible.points {
            point_at[(point.pixel.0 as usize, point.pixel.1 as usize)] = point.point;
        }
        let nearest = |(column, row): (u32, u32)| {
            let there = window((column as usize, row as usize), LONE_REACH).filter_map(|(offset, pixel)| {
                let &point = point_at.get(pixel.0, pixel.1)?;
                (point != NONE).then_some((offset, point))
            });
            there.min_by_key(|&((column, row), point)| (column * column + row * row, point))
        };
        let lone = self.lone.iter().map(|&index| &self.depths[index as usize]);
        lone.filter_map(|depth| {
            let (offset, point) = nearest(depth.pixel)?;
            (offset != (0, 0)).then_some((point, depth))
        })
        .collect()
    }
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

fn share_of_deviation(frame: &Frame, pixel: (usize, usize)) -> f64 {
    let deviations = frame.depth_deviation.as_ref();
    deviations
        .and_then(|grid| grid.get(pixel.0, pixel.1))
        .map_or(0.0, |&share| f64::from(share))
}

/// The least-squares plane's slope through d' around `pixel`, per column and per row; zero where too few
/// neighbours are known.
fn slope(frame: &Frame, pixel: (usize, usize), inverse_depth: f64) -> [f64; 2] {
    let mut right = Vector3::zeros();
    // Sums of 1, column, row and their products: whole numbers, so exact.
    let [mut n, mut c, mut r, mut cc, mut cr, mut rr] = [0.0; 6];
    for ((column, row), neighbour) in window(pixel, REACH) {
        let Some(d) = known(frame, neighbour) else {
            continue;
        };
        if (d - inverse_depth).abs() < SAME_SURFACE * inverse_depth {
            let (column, row) = (column as f64, row as f64);
            n += 1.0;
            c += column;
            r += row;
            cc += column * column;
            cr += column * row;
            rr += row * row;
            right += Vector3::new(column, row, 1.0) * d;
        }
    }
    let normal = Matrix3::new(cc, cr, c, cr, rr, r, c, r, n);
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
            image: RgbImage::from_fn(9, 8, |_, _| [0.0; 3]).into(),
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
            ..Visibility::default()
        };
        let points = at(&[(0, 0), (4, 1), (6, 5), (7, 7)]);
        let places = |frame: &Frame| -> Vec<(u32, f64, f64)> {
            let seen = KnownDepths::new(frame).seen(0, &points, 1.0, 0.1);
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

    /// d' = 0.5 with deviations of 0, 20 and 40 % against a Huber width of 0.1.
    #[test]
    fn an_uncertain_depth_weighs_less() {
        let mut uncertain = frame(|_, _| 2.0);
        uncertain.depth_deviation = Some(Grid::from_fn(9, 8, |column, _| 0.2 * column as f32));
        let points = Visibility {
            points: (0..3)
                .map(|column| VisiblePoint {
                    point: column,
                    pixel: (column, 4),
                    inverse_depth: 0.5,
                })
                .collect(),
            ..Visibility::default()
        };
        let weights = |unit: f64, huber: f64| -> Vec<f64> {
            let seen = KnownDepths::new(&uncertain).seen(0, &points, unit, huber);
            seen.iter().map(|depth| depth.weight).collect()
        };
        for (found, expected) in weights(1.0, 0.1).iter().zip([1.0, 0.5, 0.2]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        // The same depths in other units, and a width that none comes near.
        assert_eq!(weights(2.0, 0.05), weights(1.0, 0.1));
        assert!(weights(1.0, 100.0).iter().all(|&weight| weight > 1.0 - 1e-4));
    }

    #[test]
    fn without_neighbours_there_is_no_slope() {
        let lone = frame(|column, row| if (column, row) == (4, 4) { 2.0 } else { 0.0 });
        assert_eq!(slope(&lone, (4, 4), 0.5), [0.0; 2]);
    }
}
