//! What a plane sweep does most: another frame's picture seen on a plane, and how alike patches of two pictures are.

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::Grid;

/// Product of two variances, in grey levels to the fourth, below which a correlation is noise.
const MIN_VARIANCE_PRODUCT: f32 = 1e-2;

/// Fills `warped` with what another frame sees on the plane at this inverse depth before the target, for the target's pixels from
/// \[left, top\] on; NaN beyond the other's border.
pub fn warp(
    other: &Grid<f32>,
    camera: &Pinhole,
    other_from_target: &Pose,
    inverse_depth: f64,
    [left, top]: [usize; 2],
    warped: &mut Grid<f32>,
) {
    // x_other ~ R x / z + t / z: the translation acts on the plane's third row alone.
    let mut motion = *other_from_target.rotation.matrix();
    for row in 0..3 {
        motion[(row, 2)] += other_from_target.translation[row] * inverse_depth;
    }
    let Some(inverse) = camera.matrix().try_inverse() else {
        warped.data_mut().fill(f32::NAN);
        return;
    };
    let homography = camera.matrix() * motion * inverse;
    let along = homography.column(0).into_owned();
    let (last_column, last_row) = (other.width() as f64 - 1.0, other.height() as f64 - 1.0);
    let (stride, colours) = (other.width(), other.data());
    let width = warped.width();
    for (row, line) in warped.data_mut().chunks_exact_mut(width).enumerate() {
        let start = homography * Vector3::new(left as f64 + 0.5, (top + row) as f64 + 0.5, 1.0);
        for (column, value) in line.iter_mut().enumerate() {
            let seen = start + along * column as f64;
            let scale = 1.0 / seen.z;
            let (u, v) = (seen.x * scale - 0.5, seen.y * scale - 0.5);
            if !(seen.z > 0.0 && u >= 0.0 && v >= 0.0 && u < last_column && v < last_row) {
                *value = f32::NAN;
                continue;
            }
            let (c, r) = (u as u32, v as u32);
            let (x, y) = ((u - f64::from(c)) as f32, (v - f64::from(r)) as f32);
            let at = r as usize * stride + c as usize;
            let (upper, lower) = (&colours[at..at + 2], &colours[at + stride..at + stride + 2]);
            let upper = upper[0] + x * (upper[1] - upper[0]);
            let lower = lower[0] + x * (lower[1] - lower[0]);
            *value = upper + y * (lower - upper);
        }
    }
}

/// Buffers that comparing needs; kept from one comparison to the next.
#[derive(Default)]
pub struct Scratch {
    values: Vec<f32>,
    columns: Vec<f32>,
    sums: [Vec<f32>; 3],
}

/// A picture whose patches, squares around each pixel that end at the border, are compared with those of others.
pub struct Patches {
    gray: Grid<f32>,
    radius_px: usize,
    /// The reciprocal of the number of a patch's pixels.
    weight: Vec<f32>,
    mean: Vec<f32>,
    variance: Vec<f32>,
}

impl Patches {
    pub fn new(gray: Grid<f32>, radius_px: usize) -> Self {
        let (width, height) = gray.size();
        let side = |at: usize, length: usize| (at + radius_px + 1).min(length) - at.saturating_sub(radius_px);
        let weight: Vec<f32> = (0..width * height)
            .map(|i| 1.0 / (side(i % width, width) * side(i / width, height)) as f32)
            .collect();
        let (mut columns, mut sums, mut squares) = (Vec::new(), Vec::new(), Vec::new());
        sum_patches(gray.data(), width, radius_px, &mut columns, &mut sums);
        let squared: Vec<f32> = gray.data().iter().map(|value| value * value).collect();
        sum_patches(&squared, width, radius_px, &mut columns, &mut squares);
        let mean: Vec<f32> = sums
            .iter()
            .zip(&weight)
            .map(|(sum, weight)| sum * weight)
            .collect();
        let variance = (0..mean.len())
            .map(|i| squares[i] * weight[i] - mean[i] * mean[i])
            .collect();
        Self {
            gray,
            radius_px,
            weight,
            mean,
            variance,
        }
    }

    /// The variance of the patch around pixel `i`, grey levels squared.
    pub fn variance(&self, i: usize) -> f32 {
        self.variance[i]
    }

    /// Tells for the k-th pixel of `wanted` the normalised cross-correlation of its patch with that of `other`, a picture of the same
    /// size; −1 where it is not known. NaN in `other` become 0.
    pub fn correlate(
        &self,
        other: &mut Grid<f32>,
        wanted: &[usize],
        scratch: &mut Scratch,
        mut tell: impl FnMut(usize, f32),
    ) {
        let Scratch {
            values,
            columns,
            sums: [sums, squares, products],
        } = scratch;
        let (width, radius) = (other.width(), self.radius_px);
        let unknown = |value: f32| value.is_nan();
        let seen: Vec<bool> = wanted.iter().map(|&i| !unknown(other.data()[i])).collect();
        for value in other.data_mut() {
            *value = if unknown(*value) { 0.0 } else { *value };
        }
        sum_patches(other.data(), width, radius, columns, sums);
        values.clear();
        values.extend(other.data().iter().map(|value| value * value));
        sum_patches(values, width, radius, columns, squares);
        values.clear();
        values.extend(other.data().iter().zip(self.gray.data()).map(|(a, b)| a * b));
        sum_patches(values, width, radius, columns, products);
        for (k, (&i, seen)) in wanted.iter().zip(seen).enumerate() {
            let weight = self.weight[i];
            let mean = sums[i] * weight;
            let spread = self.variance[i].max(0.0) * (squares[i] * weight - mean * mean).max(0.0);
            tell(
                k,
                if seen && spread >= MIN_VARIANCE_PRODUCT {
                    (products[i] * weight - self.mean[i] * mean) / spread.sqrt()
                } else {
                    -1.0
                },
            );
        }
    }
}

/// Per pixel, the sum over its patch: first down the columns, then along the rows. Every sum is made anew, so that no error builds up.
fn sum_patches(values: &[f32], width: usize, radius: usize, columns: &mut Vec<f32>, sums: &mut Vec<f32>) {
    columns.clear();
    columns.resize(values.len(), 0.0);
    sums.clear();
    sums.resize(values.len(), 0.0);
    let height = values.len().checked_div(width).unwrap_or(0);
    for (row, line) in columns.chunks_exact_mut(width.max(1)).enumerate() {
        for near in row.saturating_sub(radius)..(row + radius + 1).min(height) {
            add(line, &values[near * width..(near + 1) * width]);
        }
    }
    for (line, columns) in sums
        .chunks_exact_mut(width.max(1))
        .zip(columns.chunks_exact(width.max(1)))
    {
        add(line, columns);
        for shift in 1..=radius.min(width - 1) {
            add(line, &columns[shift..]);
            add(&mut line[shift..], columns);
        }
    }
}

/// Adds as many as both have.
fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_ends_at_the_border() {
        let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let (mut columns, mut sums) = (Vec::new(), Vec::new());
        sum_patches(&values, 4, 1, &mut columns, &mut sums);
        assert_eq!(sums[5], 9.0 * 5.0);
        assert_eq!(sums[0], 0.0 + 1.0 + 4.0 + 5.0);
        assert_eq!(sums[11], 6.0 + 7.0 + 10.0 + 11.0);
        sum_patches(&values, 4, 9, &mut columns, &mut sums);
        assert!(sums.iter().all(|&sum| sum == 66.0));
    }

    #[test]
    fn correlation_does_not_see_contrast_or_brightness() {
        let image = Grid::from_fn(12, 12, |c, r| ((c * 7 + r * 13) % 17) as f32);
        let mut other = Grid::from_fn(12, 12, |c, r| 3.0 * image[(c, r)] + 20.0);
        let wanted: Vec<usize> = (0..144).collect();
        let mut seen = 0;
        Patches::new(image, 2).correlate(&mut other, &wanted, &mut Scratch::default(), |_, value| {
            assert!((value - 1.0).abs() < 1e-3, "{value}");
            seen += 1;
        });
        assert_eq!(seen, 144);
    }

    #[test]
    fn beyond_the_border_nothing_is_alike() {
        let image = Grid::from_fn(12, 12, |c, r| ((c * 7 + r * 13) % 17) as f32);
        let mut other = image.clone();
        other[(3, 4)] = f32::NAN;
        let hole = 4 * 12 + 3;
        Patches::new(image, 1).correlate(&mut other, &[hole, 0], &mut Scratch::default(), |k, value| {
            if k == 0 {
                assert_eq!(value, -1.0);
            } else {
                assert!((value - 1.0).abs() < 1e-3, "{value}");
            }
        });
    }

    #[test]
    fn the_plane_at_its_depth_looks_like_the_target() {
        let camera = Pinhole {
            fx: 20.0,
            fy: 20.0,
            cx: 16.0,
            cy: 12.0,
        };
        let texture = |x: f64, y: f64| (8.0 * x).sin() as f32 * 50.0 + (5.0 * y) as f32;
        let shift = 0.2;
        let depth = 2.0;
        // The other camera stands to the right by `shift`, before a wall at `depth`.
        let seen = |shift: f64| {
            Grid::from_fn(32, 24, |c, r| {
                let x = (c as f64 + 0.5 - camera.cx) / camera.fx * depth + shift;
                texture(x, (r as f64 + 0.5 - camera.cy) / camera.fy * depth)
            })
        };
        let (target, other) = (seen(0.0), seen(shift));
        let other_from_target = Pose::from_twist(&nalgebra::Vector6::new(0.0, 0.0, 0.0, -shift, 0.0, 0.0));
        let mut warped = Grid::filled(10, 8, 0.0);
        warp(
            &other,
            &camera,
            &other_from_target,
            1.0 / depth,
            [12, 6],
            &mut warped,
        );
        for row in 0..8 {
            for column in 0..10 {
                assert!((warped[(column, row)] - target[(12 + column, 6 + row)]).abs() < 1e-3);
            }
        }
    }
}
