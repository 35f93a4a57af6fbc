//! The exact Euclidean distance transform of a mask that also gives the *nearest mask pixel*: the direction
//! "projected point → silhouette" of Eq. 5.
//!
//! Two passes in linear time and integer arithmetic (nearest row within each column, then the lower envelope
//! of one parabola per column along each row), so every cell's answer is exact.

use super::{Grid, Mask};

/// Cells beyond each edge of the image for which the nearest pixel is tabulated too.
const PADDING: usize = 64;

/// For every cell of the image, padded on all sides, the nearest pixel of the mask.
///
/// Cell (column, row) of the padded table has its centre at image point (column − padding + 0.5,
/// row − padding + 0.5).
#[derive(Clone, Debug)]
pub struct NearestPixel {
    mask_width: usize,
    width: usize,
    height: usize,
    indices: Vec<u32>,
    boundary: Vec<u32>,
}

impl NearestPixel {
    /// `None` where the mask is empty, or too large for `u32` indices.
    pub fn new(mask: &Mask) -> Option<Self> {
        let (mask_width, mask_height) = mask.size();
        u32::try_from(mask_width * mask_height).ok()?;
        if !mask.data().iter().any(|&inside| inside) {
            return None;
        }
        let (width, height) = (mask_width + 2 * PADDING, mask_height + 2 * PADDING);
        let rows = nearest_row_in_column(mask);
        let mut envelope = Envelope::default();
        let mut indices = Vec::with_capacity(width * height);
        for padded_row in 0..height {
            let row = padded_row as i64 - PADDING as i64;
            envelope.clear();
            for column in 0..mask_width {
                // Above and below the image the nearest row of a column is that of its end.
                let clamped = row.clamp(0, mask_height as i64 - 1) as usize;
                if let Some(nearest) = rows[clamped * mask_width + column] {
                    let gap = nearest as i64 - row;
                    envelope.push(column as i64, gap * gap, nearest);
                }
            }
            envelope.sweep(-(PADDING as i64), width, |column, nearest_row| {
                indices.push((nearest_row as usize * mask_width + column as usize) as u32);
            });
        }
        Some(Self {
            mask_width,
            width,
            height,
            indices,
            boundary: boundary(mask),
        })
    }

    /// Cells beyond each edge of the image.
    pub fn padding(&self) -> usize {
        PADDING
    }

    /// (width, height) of the padded table.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Row-major over the padded table: the nearest mask pixel of each cell's centre, as row · width + column
    /// of the *mask*.
    pub fn into_indices(self) -> Vec<u32> {
        self.indices
    }

    /// How far each pixel of the image lies outside the mask, in whole pixels, at most 255: 0 within it.
    pub fn distances(&self) -> Grid<u8> {
        let (width, height) = (self.width - 2 * PADDING, self.height - 2 * PADDING);
        Grid::from_fn(width, height, |column, row| {
            let index = self.indices[(row + PADDING) * self.width + column + PADDING] as usize;
            let (across, down) = (
                (index % self.mask_width).abs_diff(column),
                (index / self.mask_width).abs_diff(row),
            );
            ((across * across + down * down).isqrt()).min(255) as u8
        })
    }

    /// The centre of the mask pixel nearest to the image point (`u`, `v`), anywhere in the plane.
    ///
    /// The candidates are the nearest pixels of the 3 × 3 cells around the query. Another pixel may be nearer in slivers
    /// between Voronoi cells, by twice the query's distance from its cell's centre at most (the triangle inequality).
    /// Beyond the padding the mask's boundary is searched, exactly. A non-finite query gives the first boundary pixel.
    pub fn nearest(&self, u: f64, v: f64) -> (f64, f64) {
        let (x, y) = ((u + PADDING as f64).floor(), (v + PADDING as f64).floor());
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        if !inside {
            return self.closest_to(u, v, self.boundary.iter().copied());
        }
        let (x, y) = (x as usize, y as usize);
        let columns = x.saturating_sub(1)..=(x + 1).min(self.width - 1);
        let rows = y.saturating_sub(1)..=(y + 1).min(self.height - 1);
        let cells = rows.flat_map(|row| columns.clone().map(move |column| row * self.width + column));
        self.closest_to(u, v, cells.map(|cell| self.indices[cell]))
    }

    fn closest_to(&self, u: f64, v: f64, candidates: impl Iterator<Item = u32>) -> (f64, f64) {
        let mut best = (f64::INFINITY, self.centre(self.boundary[0]));
        for index in candidates {
            let centre = self.centre(index);
            let squared = (centre.0 - u).powi(2) + (centre.1 - v).powi(2);
            if squared < best.0 {
                best = (squared, centre);
            }
        }
        best.1
    }

    fn centre(&self, index: u32) -> (f64, f64) {
        let index = index as usize;
        (
            (index % self.mask_width) as f64 + 0.5,
            (index / self.mask_width) as f64 + 0.5,
        )
    }
}

/// Mask pixels with a 4-neighbour off the mask (or off the image), row-major.
fn boundary(mask: &Mask) -> Vec<u32> {
    let (width, height) = mask.size();
    let on = |column: usize, row: usize| mask.get(column, row).copied().unwrap_or(false);
    (0..width * height)
        .filter(|&i| {
            let (c, r) = (i % width, i / width);
            // `wrapping_sub` sends −1 out of range, which is off the mask.
            let surrounded =
                on(c.wrapping_sub(1), r) && on(c + 1, r) && on(c, r.wrapping_sub(1)) && on(c, r + 1);
            on(c, r) && !surrounded
        })
        .map(|i| i as u32)
        .collect()
}

/// For every pixel of the image the row of the nearest mask pixel in its own column; the upper one on a tie.
fn nearest_row_in_column(mask: &Mask) -> Vec<Option<u32>> {
    let (width, height) = mask.size();
    let mut nearest = vec![None; width * height];
    for column in 0..width {
        let mut above = None;
        for row in 0..height {
            if mask[(column, row)] {
                above = Some(row as u32);
            }
            nearest[row * width + column] = above;
        }
        let mut below: Option<u32> = None;
        for row in (0..height).rev() {
            if mask[(column, row)] {
                below = Some(row as u32);
            }
            let cell = &mut nearest[row * width + column];
            *cell = match (*cell, below) {
                (Some(a), Some(b)) if b - (row as u32) < (row as u32) - a => Some(b),
                (None, below) => below,
                (above, _) => above,
            };
        }
    }
    nearest
}

/// The lower envelope of the parabolas (x − column)² + offset along one row.
#[derive(Default)]
struct Envelope {
    /// (column, offset, the mask row it stands for, first x where it is the lowest).
    pieces: Vec<(i64, i64, u32, i64)>,
}

impl Envelope {
    fn clear(&mut self) {
        self.pieces.clear();
    }

    /// Columns must come in increasing order.
    fn push(&mut self, column: i64, offset: i64, row: u32) {
        let mut start = i64::MIN;
        while let Some(&(other, other_offset, _, other_start)) = self.pieces.last() {
            // First integer x at which the new parabola is strictly lower: ties go to the left column.
            let numerator = column * column + offset - other * other - other_offset;
            start = numerator.div_euclid(2 * (column - other)) + 1;
            if start > other_start {
                break;
            }
            self.pieces.pop();
            start = i64::MIN;
        }
        self.pieces.push((column, offset, row, start));
    }

    /// Calls `found(column, row)` with the lowest parabola at `first`, `first` + 1, … (`count` of them).
    fn sweep(&self, first: i64, count: usize, mut found: impl FnMut(i64, u32)) {
        let mut piece = 0;
        for x in first..first + count as i64 {
            while self.pieces.get(piece + 1).is_some_and(|next| next.3 <= x) {
                piece += 1;
            }
            if let Some(&(column, _, row, _)) = self.pieces.get(piece) {
                found(column, row);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn squared(a: (f64, f64), u: f64, v: f64) -> f64 {
        (a.0 - u).powi(2) + (a.1 - v).powi(2)
    }

    fn brute_force(mask: &Mask, u: f64, v: f64) -> f64 {
        let (width, height) = mask.size();
        (0..width * height)
            .filter(|&i| mask.data()[i])
            .map(|i| squared(((i % width) as f64 + 0.5, (i / width) as f64 + 0.5), u, v))
            .fold(f64::INFINITY, f64::min)
    }

    fn blob(seed: u64) -> Mask {
        let phase = seed as f64;
        Mask::from_fn(37, 23, |c, r| {
            let (x, y) = (c as f64 - 18.0, r as f64 - 11.0);
            let radius = 7.0 + 3.0 * (3.0 * y.atan2(x) + phase).sin();
            x.hypot(y) < radius && !(x - 2.0).hypot(y).lt(&2.0)
        })
    }

    #[test]
    fn every_cell_centre_is_exact() {
        for seed in 0..5 {
            let mask = blob(seed);
            let table = NearestPixel::new(&mask).unwrap();
            let (width, height) = table.size();
            assert_eq!(table.indices.len(), width * height);
            for row in 0..height {
                for column in 0..width {
                    let (u, v) = (
                        column as f64 + 0.5 - table.padding() as f64,
                        row as f64 + 0.5 - table.padding() as f64,
                    );
                    let index = table.indices[row * width + column];
                    assert!(mask.data()[index as usize]);
                    assert_eq!(squared(table.centre(index), u, v), brute_force(&mask, u, v));
                }
            }
        }
    }

    #[test]
    fn a_lone_pixel_is_nearest_from_everywhere() {
        let mut mask = Mask::filled(9, 7, false);
        mask[(3, 5)] = true;
        let table = NearestPixel::new(&mask).unwrap();
        for (u, v) in [(0.0, 0.0), (3.4, 5.6), (-500.0, 9.0), (1e6, -1e6), (8.99, 6.99)] {
            assert_eq!(table.nearest(u, v), (3.5, 5.5));
        }
    }

    #[test]
    fn an_empty_mask_has_no_nearest_pixel() {
        assert!(NearestPixel::new(&Mask::filled(4, 4, false)).is_none());
    }

    #[test]
    fn slivers_between_cells_are_rare_and_narrow() {
        for seed in 0..5 {
            let mask = blob(seed);
            let table = NearestPixel::new(&mask).unwrap();
            // Irrational steps, so that queries lie anywhere in their cells.
            let queries = (0..4000).map(|i| {
                let i = f64::from(i);
                (
                    -60.0 + 150.0 * (i * 2.0_f64.sqrt()).fract(),
                    -60.0 + 140.0 * (i * 3.0_f64.sqrt()).fract(),
                )
            });
            let excess: Vec<f64> = queries
                .map(|(u, v)| squared(table.nearest(u, v), u, v).sqrt() - brute_force(&mask, u, v).sqrt())
                .collect();
            assert!(excess.iter().filter(|&&e| e > 1e-9).count() <= 4);
            assert!(excess.iter().all(|&e| e < 0.05));
        }
    }

    proptest! {
        #[test]
        fn real_queries_match_brute_force(seed in 0u64..8, u in -60.0..90.0f64, v in -60.0..80.0f64) {
            let mask = blob(seed);
            let found = squared(NearestPixel::new(&mask).unwrap().nearest(u, v), u, v).sqrt();
            let truth = brute_force(&mask, u, v).sqrt();
            let bound = 2.0 * (u - u.floor() - 0.5).hypot(v - v.floor() - 0.5);
            prop_assert!(found - truth <= bound + 1e-12, "{found} against {truth}");
        }

        #[test]
        fn far_queries_are_exact(seed in 0u64..8, angle in -3.0..3.0f64, radius in 150.0..900.0f64) {
            let mask = blob(seed);
            let (u, v) = (18.0 + radius * angle.cos(), 11.0 + radius * angle.sin());
            let found = squared(NearestPixel::new(&mask).unwrap().nearest(u, v), u, v);
            prop_assert!((found - brute_force(&mask, u, v)).abs() < 1e-6);
        }
    }
}
