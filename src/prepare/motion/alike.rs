//! Which features of two pictures are alike.

use nalgebra::DMatrix;

/// Entries of a descriptor.
pub const ENTRIES: usize = 128;

/// Features of a and b that are each other's nearest, and nearer for a than `ratio` times its second nearest. A column is a
/// descriptor, of length 1.
pub fn alike(a: &DMatrix<f32>, b: &DMatrix<f32>, ratio: f32) -> Vec<[u32; 2]> {
    // The nearest is the one with the largest product: |x − y|² = 2 − 2 x·y.
    let products = a.transpose() * b;
    let mut nearest = vec![0u32; a.ncols()];
    let mut first = vec![f32::NEG_INFINITY; a.ncols()];
    let mut second = first.clone();
    for (j, column) in (0u32..).zip(products.column_iter()) {
        // Without branches, so that several features are compared at once.
        let kept = nearest.iter_mut().zip(&mut first).zip(&mut second);
        for (&product, ((nearest, first), second)) in column.iter().zip(kept) {
            let lesser = if product < *first { product } else { *first };
            *second = if lesser > *second { lesser } else { *second };
            *nearest = if product > *first { j } else { *nearest };
            *first = if product > *first { product } else { *first };
        }
    }
    let squared_distance = |product: f32| (2.0 - 2.0 * product).max(0.0);
    let is_nearest_back = |i: usize, j: u32, product: f32| {
        let column = products.column(j as usize);
        let (before, after) = column.as_slice().split_at(i);
        before.iter().all(|other| *other < product) && after.iter().all(|other| *other <= product)
    };
    (0..nearest.len())
        .filter(|&i| {
            second[i].is_finite()
                && squared_distance(first[i]) < ratio * ratio * squared_distance(second[i])
                && is_nearest_back(i, nearest[i], first[i])
        })
        .map(|i| [i as u32, nearest[i]])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Descriptors in a plane, at these angles.
    fn at(angles_deg: &[f32]) -> DMatrix<f32> {
        DMatrix::from_fn(ENTRIES, angles_deg.len(), |row, column| {
            let angle = angles_deg[column].to_radians();
            [angle.cos(), angle.sin()].get(row).copied().unwrap_or(0.0)
        })
    }

    #[test]
    fn nearest_both_ways_and_clearly_nearer_than_the_second() {
        let a = at(&[0.0, 30.0, 60.0, 61.0]);
        let b = at(&[62.5, 1.0, 32.0, 28.0]);
        // 30 has two as near; 60 is not the nearest of 62.5.
        assert_eq!(alike(&a, &b, 0.85), [[0, 1], [3, 0]]);
        assert_eq!(alike(&a, &at(&[1.0]), 0.85), [] as [[u32; 2]; 0], "no second");
        assert_eq!(alike(&at(&[]), &b, 0.85), [] as [[u32; 2]; 0]);
    }
}
