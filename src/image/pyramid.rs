//! Image pyramids (coarse to fine). Level k + 1 has half the size of level k, rounded up, and pixel centres that
//! follow [`Pinhole::scaled`](crate::geometry::Pinhole::scaled) by exactly 0.5: coarse pixel i covers the fine
//! pixels 2i and 2i + 1, also where an odd size leaves the last one half empty.

use super::{DepthMap, Grid, Mask, RgbImage};
use std::sync::Arc;

/// `image` and its `levels` − 1 halvings, finest first; at least the image itself.
pub fn pyramid(image: Arc<RgbImage>, levels: usize) -> Vec<Arc<RgbImage>> {
    let halvings = std::iter::successors(Some(image), |last| Some(Arc::new(halve_image(last))));
    halvings.take(levels.max(1)).collect()
}

/// Binomial low-pass (1 3 3 1)/8 per axis, then every second sample. The kernel is even, so its centre lies on
/// the edge between fine pixels 2i and 2i + 1, where the coarse pixel's centre is. Borders repeat.
pub fn halve_image(image: &RgbImage) -> RgbImage {
    let (width, height) = image.size();
    let narrow = Grid::from_fn(width.div_ceil(2), height, |column, row| {
        filtered(column, width, |c| image[(c, row)])
    });
    Grid::from_fn(width.div_ceil(2), height.div_ceil(2), |column, row| {
        filtered(row, height, |r| narrow[(column, r)])
    })
}

fn filtered(coarse: usize, length: usize, sample: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (tap, weight) in [1.0, 3.0, 3.0, 1.0].into_iter().enumerate() {
        let fine = (2 * coarse + tap).saturating_sub(1).min(length - 1);
        for (total, value) in sum.iter_mut().zip(sample(fine)) {
            *total += weight / 8.0 * value;
        }
    }
    sum
}

/// On the object where at least half of the covered fine pixels are.
pub fn halve_mask(mask: &Mask) -> Mask {
    halve(mask, |covered| {
        2 * covered.iter().filter(|&&inside| inside).count() >= covered.len()
    })
}

/// The lower median of the covered known depths, which never blends front and back; 0 where none is known.
pub fn halve_depth(depth: &DepthMap) -> DepthMap {
    halve(depth, |covered| {
        let mut known: Vec<f32> = covered.iter().copied().filter(|&z| z > 0.0).collect();
        known.sort_by(f32::total_cmp);
        known
            .get(known.len().saturating_sub(1) / 2)
            .copied()
            .unwrap_or(0.0)
    })
}

/// Each coarse pixel from the up to four fine pixels under it.
fn halve<T: Copy>(grid: &Grid<T>, combine: impl Fn(&[T]) -> T) -> Grid<T> {
    let (width, height) = grid.size();
    let mut covered = Vec::with_capacity(4);
    Grid::from_fn(width.div_ceil(2), height.div_ceil(2), |column, row| {
        covered.clear();
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            covered.extend(grid.get(2 * column + dx, 2 * row + dy).copied());
        }
        combine(&covered)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pinhole, Vector2, Vector3};

    fn linear(width: usize, height: usize) -> RgbImage {
        RgbImage::from_fn(width, height, |c, r| {
            let (u, v) = (c as f32 + 0.5, r as f32 + 0.5);
            [2.0 * u + 5.0, 3.0 * v + 1.0, u + v]
        })
    }

    #[test]
    fn odd_sizes_round_up() {
        let sizes: Vec<_> = pyramid(Arc::new(linear(37, 22)), 4)
            .iter()
            .map(|image| image.size())
            .collect();
        assert_eq!(sizes, [(37, 22), (19, 11), (10, 6), (5, 3)]);
    }

    /// A ramp is reproduced exactly by a filter whose phase is right: half a pixel off would show as 1.
    #[test]
    fn a_ramp_keeps_its_place() {
        let coarse = halve_image(&linear(37, 22));
        for row in 1..10 {
            for column in 1..17 {
                let (u, v) = (2.0 * (column as f32 + 0.5), 2.0 * (row as f32 + 0.5));
                let expected = [2.0 * u + 5.0, 3.0 * v + 1.0, u + v];
                for channel in 0..3 {
                    assert!((coarse[(column, row)][channel] - expected[channel]).abs() < 1e-3);
                }
            }
        }
    }

    /// The same 3-D points seen through the scaled cameras find the same colours on every level.
    #[test]
    fn levels_agree_at_scaled_projections() {
        let smooth = |u: f64, v: f64| 128.0 + 60.0 * (u / 23.0).sin() + 40.0 * (v / 17.0).cos();
        let image = RgbImage::from_fn(161, 121, |c, r| {
            [smooth(c as f64 + 0.5, r as f64 + 0.5) as f32; 3]
        });
        let camera = Pinhole {
            fx: 140.0,
            fy: 150.0,
            cx: 80.0,
            cy: 61.0,
        };
        for (level, coarse) in pyramid(Arc::new(image), 3).iter().enumerate() {
            let scale = 0.5f64.powi(level as i32);
            let camera_at_level = camera.scaled(scale, scale);
            for i in 0..200 {
                let point = Vector3::new((i % 20) as f64 / 40.0 - 0.25, (i / 20) as f64 / 20.0 - 0.25, 1.2);
                let (fine, at_level): (Vector2<f64>, Vector2<f64>) = (
                    camera.project(&point).unwrap(),
                    camera_at_level.project(&point).unwrap(),
                );
                let value = bilinear(coarse, at_level.x, at_level.y);
                assert!(
                    (value - smooth(fine.x, fine.y)).abs() < 2.0,
                    "level {level}: {value}"
                );
            }
        }
    }

    fn bilinear(image: &RgbImage, u: f64, v: f64) -> f64 {
        let (x, y) = (u - 0.5, v - 0.5);
        let (c, r) = (x.floor() as usize, y.floor() as usize);
        let (a, b) = (x - x.floor(), y - y.floor());
        let at = |c: usize, r: usize| image[(c, r)][0] as f64;
        (1.0 - b) * ((1.0 - a) * at(c, r) + a * at(c + 1, r))
            + b * ((1.0 - a) * at(c, r + 1) + a * at(c + 1, r + 1))
    }

    #[test]
    fn masks_go_by_majority() {
        let rows = ["##.#.", "#....", "....#"];
        let mask = Mask::from_fn(5, 3, |c, r| rows[r].as_bytes()[c] == b'#');
        let coarse = halve_mask(&mask);
        assert_eq!(coarse.data(), [true, false, false, false, false, true]);
    }

    #[test]
    fn depth_ignores_the_unknown_and_never_blends() {
        let depth = DepthMap::from_vec(4, 2, vec![0.0, 3.0, 1.0, 9.0, 0.0, 0.0, 9.0, 1.0]).unwrap();
        assert_eq!(halve_depth(&depth).data(), [3.0, 1.0]);
        assert_eq!(halve_depth(&DepthMap::filled(2, 2, 0.0)).data(), [0.0]);
    }
}
