//! Principal components of M corresponded shapes through their M × M Gram matrix.

use nalgebra::{DMatrix, SymmetricEigen};

/// The mean, the modes scaled by their standard deviations, and what they explain.
pub struct Components {
    /// The mean, D entries.
    pub mean: Vec<f64>,
    /// One mode a row, D entries each; with s ~ N(0, I), mean + Σ s_k mode_k has the shapes' covariance.
    pub modes: Vec<Vec<f64>>,
    /// Share of the variance that the first k + 1 modes explain.
    pub explained: Vec<f64>,
}

/// The first `count` components (at most M − 1) of `shapes`, M rows of D entries, each counting by its weight. A mode's sign is such
/// that its entry of largest magnitude is positive.
pub fn components(shapes: &[Vec<f64>], weights: &[f64], count: usize) -> Components {
    let shape_count = shapes.len();
    let length = shapes.first().map_or(0, Vec::len);
    let total_weight: f64 = weights.iter().sum();
    let mean: Vec<f64> = (0..length)
        .map(|i| shapes.iter().zip(weights).map(|(s, w)| s[i] * w).sum::<f64>() / total_weight)
        .collect();
    let centred: Vec<Vec<f64>> = shapes
        .iter()
        .zip(weights)
        .map(|(shape, weight)| {
            shape
                .iter()
                .zip(&mean)
                .map(|(x, m)| (x - m) * weight.sqrt())
                .collect()
        })
        .collect();
    let gram = DMatrix::from_fn(shape_count, shape_count, |a, b| {
        centred[a]
            .iter()
            .zip(&centred[b])
            .map(|(x, y)| x * y)
            .sum::<f64>()
    });
    let total = gram.trace();
    let eigen = SymmetricEigen::new(gram);
    let mut order: Vec<usize> = (0..shape_count).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order.truncate(count.min(shape_count.saturating_sub(1)));
    let mut explained = Vec::with_capacity(order.len());
    let mut modes = Vec::with_capacity(order.len());
    // M − 1 where all weigh 1.
    let squared: f64 = weights.iter().map(|w| w * w).sum();
    let degrees = (total_weight - squared / total_weight).max(f64::MIN_POSITIVE);
    for &k in &order {
        explained.push(explained.last().copied().unwrap_or(0.0) + eigen.eigenvalues[k].max(0.0) / total);
        // Σ_m v_m c_m has length √λ; the standard deviation is √(λ / degrees).
        let scale = degrees.sqrt().recip();
        let mut mode = vec![0.0; length];
        for (shape, weight) in centred.iter().zip(eigen.eigenvectors.column(k).iter()) {
            for (out, x) in mode.iter_mut().zip(shape) {
                *out += x * weight * scale;
            }
        }
        let peak = mode
            .iter()
            .copied()
            .fold(0.0, |peak: f64, x| if x.abs() > peak.abs() { x } else { peak });
        if peak < 0.0 {
            mode.iter_mut().for_each(|x| *x = -*x);
        }
        modes.push(mode);
    }
    Components {
        mean,
        modes,
        explained,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_two_independent_directions() {
        let shape = |a: f64, b: f64| vec![1.0 + 3.0 * a, 2.0 + b, 3.0 + 3.0 * a, 4.0];
        let shapes = [
            shape(1.0, 1.0),
            shape(-1.0, 1.0),
            shape(1.0, -1.0),
            shape(-1.0, -1.0),
        ];
        let found = components(&shapes, &[1.0; 4], 2);
        assert!(
            found
                .mean
                .iter()
                .zip([1.0, 2.0, 3.0, 4.0])
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        let deviation = (4.0_f64 / 3.0).sqrt();
        let expected = [
            [3.0 * deviation, 0.0, 3.0 * deviation, 0.0],
            [0.0, deviation, 0.0, 0.0],
        ];
        for (mode, expected) in found.modes.iter().zip(expected) {
            assert!(
                mode.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9),
                "{mode:?}"
            );
        }
        assert!((found.explained[0] - 18.0 / 19.0).abs() < 1e-12 && (found.explained[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_shape_of_weight_two_counts_as_two() {
        let [a, b, c] = [vec![0.0, 1.0], vec![2.0, 0.5], vec![-1.0, 3.0]];
        let twice = components(&[a.clone(), b.clone(), b.clone(), c.clone()], &[1.0; 4], 1);
        let weighted = components(&[a, b, c], &[1.0, 2.0, 1.0], 1);
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(
            near(&twice.mean, &weighted.mean) && (twice.explained[0] - weighted.explained[0]).abs() < 1e-12
        );
    }

    #[test]
    fn all_components_reproduce_every_shape() {
        let shapes: Vec<Vec<f64>> = (0..5)
            .map(|m| {
                (0..9)
                    .map(|i| f64::from((m * 31 + i * 17 + m * i * 5) % 23))
                    .collect()
            })
            .collect();
        let found = components(&shapes, &[1.0; 5], 99);
        assert_eq!(found.modes.len(), 4);
        for shape in &shapes {
            let mut rest: Vec<f64> = shape.iter().zip(&found.mean).map(|(x, m)| x - m).collect();
            for mode in &found.modes {
                let along = rest.iter().zip(mode).map(|(r, m)| r * m).sum::<f64>()
                    / mode.iter().map(|m| m * m).sum::<f64>();
                rest.iter_mut().zip(mode).for_each(|(r, m)| *r -= along * m);
            }
            assert!(rest.iter().all(|r| r.abs() < 1e-9));
        }
    }
}
