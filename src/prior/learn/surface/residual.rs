//! What a style leaves unexplained of a model that it was not learned from, and the smooth random field that has the same covariance.

use crate::prior::field::FieldScale;
use crate::prior::learn::components;
use crate::prior::mesh::MirroredMesh;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// Residuals are compared over distances up to this, in diagonals, in so many steps.
const MAX_DISTANCE: f64 = 0.3;
const STEPS: usize = 30;
/// Pairs whose mirror image is nearer than this add the covariance of both halves.
const CLEAR_OF_IMAGE: f64 = 0.3;
/// Lengths tried, in diagonals: from the first by the second as a factor, so many.
const LENGTHS: (f64, f64, usize) = (0.02, 1.15, 18);
/// Weight of ‖s‖² for each vertex when a style is fitted; as in `prior eval`.
const RIDGE: f64 = 1e-5;

/// The covariance of residuals by distance: what one coordinate of two vertices so far apart shares.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariogram {
    /// The middle of each step, and the mean product over the pairs in it.
    pub steps: Vec<(f64, f64)>,
}

/// Leaves each of `shapes` (half-meshes) out in turn with its `group`, and compares what `styles` components of the rest, each counting
/// by its weight, leave of it.
pub fn residual_covariogram(
    mesh: &MirroredMesh,
    shapes: &[Vec<V3>],
    weights: &[f64],
    group: &[usize],
    styles: usize,
) -> Covariogram {
    let flat: Vec<Vec<f64>> = shapes
        .iter()
        .map(|shape| shape.iter().flat_map(|v| <[f64; 3]>::from(*v)).collect())
        .collect();
    let sums: Vec<(Vec<[f64; 2]>, f64)> = (0..shapes.len())
        .into_par_iter()
        .map(|out| {
            let rest: Vec<usize> = (0..group.len()).filter(|&m| group[m] != group[out]).collect();
            let kept: Vec<_> = rest.iter().map(|&m| flat[m].clone()).collect();
            let kept_weights: Vec<f64> = rest.iter().map(|&m| weights[m]).collect();
            let residual = unexplained(&flat[out], &kept, &kept_weights, styles);
            (products(mesh, &shapes[out], &residual), weights[out])
        })
        .collect();
    let steps = (0..STEPS)
        .map(|step| {
            let [sum, count] = sums.iter().fold([0.0; 2], |total, (steps, weight)| {
                [0, 1].map(|i| total[i] + weight * steps[step][i])
            });
            let distance = (step as f64 + 0.5) * MAX_DISTANCE / STEPS as f64;
            (distance, sum / f64::max(count, 1.0))
        })
        .collect();
    Covariogram { steps }
}

fn unexplained(shape: &[f64], rest: &[Vec<f64>], weights: &[f64], styles: usize) -> Vec<V3> {
    let found = components(rest, weights, styles);
    let modes = DMatrix::from_fn(shape.len(), found.modes.len(), |row, k| found.modes[k][row]);
    let offset = DVector::from_iterator(shape.len(), shape.iter().zip(&found.mean).map(|(x, m)| x - m));
    let mut normal = modes.tr_mul(&modes);
    for k in 0..normal.nrows() {
        normal[(k, k)] += RIDGE * shape.len() as f64 / 3.0;
    }
    let right = modes.tr_mul(&offset);
    let style = normal
        .cholesky()
        .map_or_else(|| right.map(|_| 0.0), |c| c.solve(&right));
    let residual = offset - modes * style;
    residual
        .as_slice()
        .chunks_exact(3)
        .map(V3::from_column_slice)
        .collect()
}

/// Sum and number of products per step of distance.
fn products(mesh: &MirroredMesh, shape: &[V3], residual: &[V3]) -> Vec<[f64; 2]> {
    let mut steps = vec![[0.0; 2]; STEPS];
    for (i, a) in shape.iter().enumerate().filter(|&(i, _)| !mesh.on_seam(i)) {
        for (j, b) in shape.iter().enumerate().skip(i) {
            let (x, image_x) = (a.x - b.x, a.x + b.x);
            let across = (a.y - b.y).powi(2) + (a.z - b.z).powi(2);
            let step = ((x * x + across).sqrt() * STEPS as f64 / MAX_DISTANCE) as usize;
            if step < STEPS && (image_x * image_x + across).sqrt() > CLEAR_OF_IMAGE {
                steps[step][0] += residual[i].dot(&residual[j]) / 3.0;
                steps[step][1] += 1.0;
            }
        }
    }
    steps
}

/// One or two scales whose covariance comes nearest to the residuals', longest first.
pub fn field_scales(covariogram: &Covariogram) -> Vec<FieldScale> {
    let (first, factor, count) = LENGTHS;
    let lengths: Vec<f64> = (0..count as i32).map(|k| first * factor.powi(k)).collect();
    let mut best = (f64::INFINITY, Vec::new());
    for (i, &long) in lengths.iter().enumerate() {
        for &short in &lengths[..=i] {
            let variances = variances(covariogram, [long, short]);
            let error: f64 = covariogram
                .steps
                .iter()
                .map(|&(distance, value)| (value - covariance(distance, [long, short], variances)).powi(2))
                .sum();
            if error < best.0 {
                let scales = [long, short]
                    .into_iter()
                    .zip(variances)
                    .filter(|(_, variance)| *variance > 0.0);
                best = (
                    error,
                    scales
                        .map(|(length, variance)| FieldScale {
                            amplitude: variance.sqrt(),
                            length,
                        })
                        .collect(),
                );
            }
        }
    }
    best.1
}

fn bell(distance: f64, length: f64) -> f64 {
    (-distance.powi(2) / (2.0 * length.powi(2))).exp()
}

fn covariance(distance: f64, lengths: [f64; 2], variances: [f64; 2]) -> f64 {
    variances[0] * bell(distance, lengths[0]) + variances[1] * bell(distance, lengths[1])
}

/// The variances, none negative, by least squares; all in the first where both lengths are one.
fn variances(covariogram: &Covariogram, lengths: [f64; 2]) -> [f64; 2] {
    let (mut normal, mut right) = ([[0.0; 2]; 2], [0.0; 2]);
    for &(distance, value) in &covariogram.steps {
        let bells = lengths.map(|length| bell(distance, length));
        for a in 0..2 {
            right[a] += bells[a] * value;
            for b in 0..2 {
                normal[a][b] += bells[a] * bells[b];
            }
        }
    }
    let alone = |a: usize| f64::max(right[a] / normal[a][a], 0.0);
    let determinant = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
    if lengths[0] == lengths[1] || determinant.abs() < 1e-12 {
        return [alone(0), 0.0];
    }
    let both = [
        (right[0] * normal[1][1] - right[1] * normal[0][1]) / determinant,
        (right[1] * normal[0][0] - right[0] * normal[1][0]) / determinant,
    ];
    match both.map(|variance| variance > 0.0) {
        [true, true] => both,
        [true, false] => [alone(0), 0.0],
        _ => [0.0, alone(1)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scales_of_a_known_covariance_are_found() {
        let (first, factor, _) = LENGTHS;
        let lengths = [first * factor.powi(12), first * factor.powi(3)];
        let steps = (0..STEPS)
            .map(|k| (k as f64 + 0.5) * MAX_DISTANCE / STEPS as f64)
            .map(|distance| (distance, covariance(distance, lengths, [4e-4, 1e-4])))
            .collect();
        let found = field_scales(&Covariogram { steps });
        assert_eq!(found.len(), 2);
        for (scale, (length, amplitude)) in found.iter().zip([(lengths[0], 0.02), (lengths[1], 0.01)]) {
            assert!(
                (scale.length - length).abs() < 1e-9 && (scale.amplitude - amplitude).abs() < 1e-6,
                "{found:?}"
            );
        }
    }

    #[test]
    fn one_scale_suffices_where_there_is_one() {
        let length = LENGTHS.0 * LENGTHS.1.powi(5);
        let steps = (0..STEPS).map(|k| {
            (
                f64::from(k as u32) * 0.01,
                9e-4 * bell(f64::from(k as u32) * 0.01, length),
            )
        });
        let found = field_scales(&Covariogram {
            steps: steps.collect(),
        });
        let variance: f64 = found.iter().map(|scale| scale.amplitude.powi(2)).sum();
        assert!((variance - 9e-4).abs() < 1e-8, "{found:?}");
    }
}
