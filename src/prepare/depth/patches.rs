//! What a plane sweep does most: another frame's picture seen on a plane, and how alike patches of two pictures are.

use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::Grid;
use std::ops::Range;

/// Product of two variances, in grey levels to the fourth, below which a correlation is noise.
const MIN_VARIANCE_PRODUCT: f32 = 1e-2;

/// Fills `warped` with what another frame sees on the plane at this inverse depth before the target, for the target's pixels from
/// \[left, top\] on that `region` looks at; NaN beyond the other's border.
pub fn warp(
    other: &Grid<f32>,
    camera: &Pinhole,
    other_from_target: &Pose,
    inverse_depth: f64,
    [left, top]: [usize; 2],
    region: &Region,
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
    let along = homography.column(0).map(|x| x as f32);
    let (last_column, last_row) = (other.width() as f32 - 1.0, other.height() as f32 - 1.0);
    let (stride, colours) = (other.width(), other.data());
    let width = warped.width();
    let mut seen = vec![[0.0f32; 2]; width];
    let lines = warped.data_mut().chunks_exact_mut(width).zip(&region.looked_at);
    for (row, (line, columns)) in lines.enumerate() {
        let first = [left + columns.start, top + row].map(|at| at as f64 + 0.5);
        let start = (homography * Vector3::new(first[0], first[1], 1.0)).map(|x| x as f32);
        let (line, seen) = (&mut line[columns.clone()], &mut seen[..columns.len()]);
        // Apart from what follows, so that several pixels are worked out at once.
        for (column, seen) in (0u16..).zip(seen.iter_mut()) {
            let at = start + along * f32::from(column);
            let scale = if at.z > 0.0 { 1.0 / at.z } else { f32::NAN };
            *seen = [at.x * scale - 0.5, at.y * scale - 0.5];
        }
        for (value, &[u, v]) in line.iter_mut().zip(&*seen) {
            if !(u >= 0.0 && v >= 0.0 && u < last_column && v < last_row) {
                *value = f32::NAN;
                continue;
            }
            let (c, r) = (u as u32, v as u32);
            let (x, y) = (u - c as f32, v - r as f32);
            let at = r as usize * stride + c as usize;
            let (upper, lower) = (&colours[at..at + 2], &colours[at + stride..at + stride + 2]);
            let upper = upper[0] + x * (upper[1] - upper[0]);
            let lower = lower[0] + x * (lower[1] - lower[0]);
            *value = upper + y * (lower - upper);
        }
    }
}

/// Which pixels of a picture are compared, and what of each row that takes.
pub struct Region {
    /// Indices of pixels, row by row.
    wanted: Vec<usize>,
    /// Per row, the columns between which the patches of its own wanted pixels lie.
    compared: Vec<Range<usize>>,
    /// Per row, the columns between which patches of any wanted pixels lie.
    looked_at: Vec<Range<usize>>,
}

impl Region {
    /// Of a picture of this size, the patches of the pixels `wanted`, which ascend.
    pub fn new(wanted: Vec<usize>, (width, height): (usize, usize), radius_px: usize) -> Self {
        let mut compared = vec![0..0; height];
        for &i in &wanted {
            let (column, row) = (i % width, i / width);
            let patch = column.saturating_sub(radius_px)..(column + radius_px + 1).min(width);
            compared[row] = both(&compared[row], &patch);
        }
        let looked_at = (0..height)
            .map(|row| {
                let near = row.saturating_sub(radius_px)..(row + radius_px + 1).min(height);
                compared[near].iter().fold(0..0, |all, row| both(&all, row))
            })
            .collect();
        Self {
            wanted,
            compared,
            looked_at,
        }
    }

    /// The pixels, row by row.
    pub fn wanted(&self) -> &[usize] {
        &self.wanted
    }
}

/// The least range that holds both.
fn both(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b.clone(),
        (_, true) => a.clone(),
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

/// Buffers that comparing needs; kept from one comparison to the next.
#[derive(Default)]
pub struct Scratch {
    seen: Vec<bool>,
    squared: Vec<f32>,
    multiplied: Vec<f32>,
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
        let all = vec![0..width; height];
        sum_patches(gray.data(), &all, width, radius_px, &mut columns, &mut sums);
        let squared: Vec<f32> = gray.data().iter().map(|value| value * value).collect();
        sum_patches(&squared, &all, width, radius_px, &mut columns, &mut squares);
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

    /// Tells for the k-th wanted pixel of `region` the normalised cross-correlation of its patch with that of `other`, a picture of the same
    /// size; −1 where it is not known. NaN in `other` become 0.
    pub fn correlate(
        &self,
        other: &mut Grid<f32>,
        region: &Region,
        scratch: &mut Scratch,
        mut tell: impl FnMut(usize, f32),
    ) {
        let Scratch {
            seen,
            squared,
            multiplied,
            columns,
            sums: [sums, squares, products],
        } = scratch;
        let (width, radius) = (other.width(), self.radius_px);
        seen.clear();
        seen.extend(region.wanted.iter().map(|&i| !other.data()[i].is_nan()));
        squared.resize(other.data().len(), 0.0);
        multiplied.resize(other.data().len(), 0.0);
        for (row, columns) in region.looked_at.iter().enumerate() {
            let row = row * width + columns.start..row * width + columns.end;
            let values = other.data_mut()[row.clone()]
                .iter_mut()
                .zip(&self.gray.data()[row.clone()]);
            let found = squared[row.clone()].iter_mut().zip(&mut multiplied[row]);
            for ((value, own), (squared, multiplied)) in values.zip(found) {
                *value = if value.is_nan() { 0.0 } else { *value };
                *squared = *value * *value;
                *multiplied = *value * own;
            }
        }
        sum_patches(other.data(), &region.compared, width, radius, columns, sums);
        sum_patches(squared, &region.compared, width, radius, columns, squares);
        sum_patches(multiplied, &region.compared, width, radius, columns, products);
        for (k, (&i, &seen)) in region.wanted.iter().zip(&*seen).enumerate() {
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

/// Per pixel of the rows' parts `compared`, the sum over that of its patch that lies in this part: first down the columns, then along the
/// rows. Every sum is made anew, so that no error builds up. What `sums` holds beyond has no meaning.
fn sum_patches(
    values: &[f32],
    compared: &[Range<usize>],
    width: usize,
    radius: usize,
    columns: &mut Vec<f32>,
    sums: &mut Vec<f32>,
) {
    sums.resize(values.len(), 0.0);
    for (row, part) in compared.iter().enumerate() {
        columns.clear();
        columns.resize(part.len(), 0.0);
        for near in row.saturating_sub(radius)..(row + radius + 1).min(compared.len()) {
            add(columns, &values[near * width..][part.clone()]);
        }
        let line = &mut sums[row * width..][part.clone()];
        line.copy_from_slice(columns);
        for shift in 1..=radius.min(part.len().saturating_sub(1)) {
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
        sum_patches(&values, &[0..4, 0..4, 0..4], 4, 1, &mut columns, &mut sums);
        assert_eq!(sums[5], 9.0 * 5.0);
        assert_eq!(sums[0], 0.0 + 1.0 + 4.0 + 5.0);
        assert_eq!(sums[11], 6.0 + 7.0 + 10.0 + 11.0);
        sum_patches(&values, &[0..4, 0..4, 0..4], 4, 9, &mut columns, &mut sums);
        assert!(sums.iter().all(|&sum| sum == 66.0));
    }

    #[test]
    fn correlation_does_not_see_contrast_or_brightness() {
        let image = Grid::from_fn(12, 12, |c, r| ((c * 7 + r * 13) % 17) as f32);
        let mut other = Grid::from_fn(12, 12, |c, r| 3.0 * image[(c, r)] + 20.0);
        let all = Region::new((0..144).collect(), (12, 12), 2);
        let mut seen = 0;
        Patches::new(image, 2).correlate(&mut other, &all, &mut Scratch::default(), |_, value| {
            assert!((value - 1.0).abs() < 1e-3, "{value}");
            seen += 1;
        });
        assert_eq!(seen, 144);
    }

    #[test]
    fn what_is_not_looked_at_does_not_matter() {
        let image = Grid::from_fn(16, 12, |c, r| ((c * 7 + r * 13) % 17) as f32);
        let other = Grid::from_fn(16, 12, |c, r| ((c * 5 + r * 11) % 19) as f32);
        let patches = Patches::new(image, 2);
        let all: Vec<usize> = (0..16 * 12).collect();
        // Two corners, a pixel between them, and two in one row.
        let few = vec![0, 83, 90, 107, 191];
        let told = |wanted: Vec<usize>, spoilt: f32| {
            let region = Region::new(wanted, (16, 12), 2);
            let mut other = other.clone();
            for (row, columns) in region.looked_at.iter().enumerate() {
                (0..16)
                    .filter(|column| !columns.contains(column))
                    .for_each(|c| other[(c, row)] = spoilt);
            }
            let mut told = vec![];
            patches.correlate(&mut other, &region, &mut Scratch::default(), |k, value| {
                told.push((region.wanted()[k], value));
            });
            told
        };
        let of_all = told(all, 0.0);
        let of_few = told(few.clone(), 1e9);
        assert_eq!(of_few, few.iter().map(|&i| of_all[i]).collect::<Vec<_>>());
    }

    #[test]
    fn beyond_the_border_nothing_is_alike() {
        let image = Grid::from_fn(12, 12, |c, r| ((c * 7 + r * 13) % 17) as f32);
        let mut other = image.clone();
        other[(3, 4)] = f32::NAN;
        let hole = 4 * 12 + 3;
        let region = Region::new(vec![0, hole], (12, 12), 1);
        Patches::new(image, 1).correlate(&mut other, &region, &mut Scratch::default(), |k, value| {
            if k == 1 {
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
            &Region::new((0..80).collect(), (10, 8), 0),
            &mut warped,
        );
        for row in 0..8 {
            for column in 0..10 {
                assert!((warped[(column, row)] - target[(12 + column, 6 + row)]).abs() < 1e-3);
            }
        }
    }
}
