//! Which features of two pictures are alike.

use nalgebra::DMatrix;

/// Entries of a descriptor.
pub const ENTRIES: usize = 128;

/// Features of a and b that are each other's nearest, and nearer for a than `ratio` times its second nearest. A column is a
/// descriptor, of length 1.
pub fn alike(a: &DMatrix<f32>, b: &DMatrix<f32>, ratio: f32) -> Vec<[u32; 2]> {
    // The nearest is the one with the largest product: |x − y|² = 2 − 2 x·y.
    let products = a.transpose() * b;
    let mut nearest = vec![(f32::NEG_INFINITY, 0); a.ncols()];
    let mut second = vec![f32::NEG_INFINITY; a.ncols()];
    let mut back = Vec::with_capacity(b.ncols());
    for (j, column) in products.column_iter().enumerate() {
        let mut best = (f32::NEG_INFINITY, 0);
        for (i, &product) in column.iter().enumerate() {
            if product > best.0 {
                best = (product, i);
            }
            if product > nearest[i].0 {
                second[i] = nearest[i].0;
                nearest[i] = (product, j);
            } else if product > second[i] {
                second[i] = product;
            }
        }
        back.push(best.1);
    }
    let squared_distance = |product: f32| (2.0 - 2.0 * product).max(0.0);
    nearest
        .iter()
        .zip(&second)
        .enumerate()
        .filter(|(i, ((product, j), second))| {
            second.is_finite()
                && squared_distance(*product) < ratio * ratio * squared_distance(**second)
                && back[*j] == *i
        })
        .map(|(i, ((_, j), _))| [i as u32, *j as u32])
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
