//! How well a linear prior reconstructs shapes that it never saw: leave-one-out Chamfer error.

use super::LinearPrior;
use super::learn::{Correspondences, tree_of};
use super::linear::InvalidPrior;
use crate::cad::OutsideSample;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// Rounds of nearest neighbours and least squares when a shape is fitted by its Chamfer distance.
const FIT_ROUNDS: usize = 20;
/// A fit looks at no more than so many samples of the shape a point.
const FIT_SAMPLES_PER_POINT: usize = 4;
/// Weight of ‖s‖² against the sum of squared distances of a fit, times their expected square: keeps s within
/// what the data tell.
const FIT_RIDGE: f64 = 1e-5;

/// Mean errors over the held-out shapes, in diagonals, with `styles` components.
#[derive(Clone, Debug, PartialEq)]
pub struct FitError {
    pub styles: usize,
    /// s by projecting the held-out shape's corresponded points onto the modes.
    pub by_correspondence: f64,
    /// s by minimising the Chamfer distance to the held-out shape's outside.
    pub by_chamfer: f64,
    /// `by_chamfer` of every shape, in order.
    pub each: Vec<f64>,
}

/// ½ of both mean nearest-neighbour distances.
pub fn chamfer(a: &[V3], b: &[V3]) -> f64 {
    let one_way = |from: &[V3], to: &[V3]| {
        let tree = tree_of(to);
        let distances = from
            .iter()
            .filter_map(|&p| tree.nearest(p.into()))
            .map(|n| n.distance);
        distances.sum::<f64>() / from.len().max(1) as f64
    };
    (one_way(a, b) + one_way(b, a)) / 2.0
}

/// The first `count` points of a shape given as xyz after xyz.
pub fn points_of(shape: &[f64], count: usize) -> Vec<V3> {
    shape
        .chunks_exact(3)
        .take(count)
        .map(V3::from_column_slice)
        .collect()
}

/// Leaves each shape out in turn, together with all of its `group` (near-duplicates), and reconstructs it from the rest
/// at the first `points` points; errors are measured against `truth`, dense samples independent of those learned from.
///
/// The correspondences are those of the whole collection: what is left out is left out of mean and modes.
pub fn leave_one_out(
    correspondences: &Correspondences,
    truth: &[OutsideSample],
    group: &[usize],
    styles: &[usize],
    points: usize,
) -> Result<Vec<FitError>, InvalidPrior> {
    let most = styles.iter().copied().max().unwrap_or(0);
    let held: Vec<Vec<(f64, f64)>> = (0..truth.len())
        .into_par_iter()
        .map(|out| {
            let rest = rest_of(correspondences, group, out);
            let (prior, _) = LinearPrior::from_correspondences(&rest, correspondences.normals.clone(), most)?;
            let stride = truth[out]
                .points
                .len()
                .div_ceil(FIT_SAMPLES_PER_POINT * points)
                .max(1);
            let target: Vec<V3> = truth[out].points.iter().step_by(stride).copied().collect();
            let errors = styles.iter().map(|&count| {
                let projected = project(&prior, &correspondences.shapes[out], count);
                let fitted = fit(&prior, &target, count, points);
                let error = |style: &[f64]| chamfer(&shape(&prior, style, points), &truth[out].points);
                (error(&projected), error(&fitted))
            });
            Ok(errors.collect())
        })
        .collect::<Result<_, InvalidPrior>>()?;
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    Ok(styles
        .iter()
        .enumerate()
        .map(|(k, &styles)| {
            let (projected, each): (Vec<f64>, Vec<f64>) = held.iter().map(|errors| errors[k]).unzip();
            FitError {
                styles,
                by_correspondence: mean(&projected),
                by_chamfer: mean(&each),
                each,
            }
        })
        .collect())
}

/// All shapes but those of `out`'s group.
pub(super) fn rest_of(correspondences: &Correspondences, group: &[usize], out: usize) -> Vec<Vec<f64>> {
    let others = (0..group.len()).filter(|&m| group[m] != group[out]);
    others.map(|m| correspondences.shapes[m].clone()).collect()
}

/// The first `count` points of X(s), missing style entries being 0.
fn shape(prior: &LinearPrior, style: &[f64], count: usize) -> Vec<V3> {
    let styles = super::ShapePrior::style_len(prior);
    let rows = prior.basis().chunks_exact(styles.max(1));
    let coordinates: Vec<f64> = prior
        .mean()
        .iter()
        .zip(rows)
        .take(3 * count)
        .map(|(mean, row)| mean + row.iter().zip(style).map(|(b, s)| b * s).sum::<f64>())
        .collect();
    coordinates.chunks_exact(3).map(V3::from_column_slice).collect()
}

/// The modes are orthogonal, so each entry stands alone.
fn project(prior: &LinearPrior, shape: &[f64], count: usize) -> Vec<f64> {
    let styles = super::ShapePrior::style_len(prior);
    (0..count.min(styles))
        .map(|k| {
            let column = prior.basis().iter().skip(k).step_by(styles);
            let (mut along, mut length) = (0.0, 1e-30);
            for ((b, x), m) in column.zip(shape).zip(prior.mean()) {
                along += b * (x - m);
                length += b * b;
            }
            along / length
        })
        .collect()
}

/// Alternates nearest neighbours in both directions with least squares in the first `count` style entries.
fn fit(prior: &LinearPrior, target: &[V3], count: usize, points: usize) -> Vec<f64> {
    let styles = super::ShapePrior::style_len(prior);
    let count = count.min(styles);
    let mut style = vec![0.0; count];
    if count == 0 {
        return style;
    }
    let targets = tree_of(target);
    // The target is denser; both directions weigh the same in the Chamfer distance.
    let back = points as f64 / target.len().max(1) as f64;
    for _ in 0..FIT_ROUNDS {
        let current = shape(prior, &style, points);
        let mut weight = vec![1.0; current.len()];
        let mut goal: Vec<V3> = current
            .iter()
            .map(|&p| targets.nearest(p.into()).map_or(p, |n| target[n.index]))
            .collect();
        let tree = tree_of(&current);
        for point in target {
            if let Some(near) = tree.nearest((*point).into()) {
                goal[near.index] += point * back;
                weight[near.index] += back;
            }
        }
        let mut normal = DMatrix::identity(count, count) * (FIT_RIDGE * current.len() as f64);
        let mut right = DVector::zeros(count);
        for (i, (goal, weight)) in goal.iter().zip(&weight).enumerate() {
            for axis in 0..3 {
                let row = 3 * i + axis;
                let basis = DVector::from_column_slice(&prior.basis()[row * styles..row * styles + count]);
                right.axpy(goal[axis] - weight * prior.mean()[row], &basis, 1.0);
                normal.ger(*weight, &basis, &basis, 1.0);
            }
        }
        let Some(solution) = normal.cholesky().map(|c| c.solve(&right)) else {
            break;
        };
        style.copy_from_slice(solution.as_slice());
    }
    style
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chamfer_is_half_of_both_ways() {
        let a = [V3::zeros()];
        let b = [V3::new(1.0, 0.0, 0.0), V3::new(3.0, 0.0, 0.0)];
        assert!((chamfer(&a, &b) - 1.5).abs() < 1e-6);
        assert_eq!(chamfer(&b, &b), 0.0);
    }

    /// Points on a box whose height and length vary: two modes suffice for any of them.
    fn boxes() -> Correspondences {
        let unit: Vec<V3> = (0..600_u32)
            .map(|i| {
                let [a, b, side] = [i * 7919 % 101, i * 104_729 % 103, i % 6].map(f64::from);
                let mut p = V3::new(a / 100.0 - 0.5, b / 102.0 - 0.5, 0.5);
                p.z *= if side < 3.0 { 1.0 } else { -1.0 };
                let turn = side as usize % 3;
                p.as_mut_slice().rotate_left(turn);
                p
            })
            .collect();
        let sizes = [
            (0.3, 0.8),
            (0.4, 0.7),
            (0.2, 0.9),
            (0.35, 0.95),
            (0.25, 0.75),
            (0.3, 0.9),
        ];
        let shapes = sizes.map(|(height, length)| {
            let size = V3::new(0.4, height, length);
            unit.iter()
                .flat_map(|p| <[f64; 3]>::from(p.component_mul(&size)))
                .collect()
        });
        Correspondences {
            shapes: shapes.into(),
            normals: vec![[0.0, 1.0, 0.0]; 600],
        }
    }

    #[test]
    fn what_lies_in_the_span_is_reconstructed() {
        let correspondences = boxes();
        let truth: Vec<OutsideSample> = correspondences
            .shapes
            .iter()
            .map(|s| OutsideSample {
                points: s.chunks_exact(3).map(V3::from_column_slice).collect(),
                normals: vec![V3::y(); 600],
            })
            .collect();
        let groups: Vec<usize> = (0..6).collect();
        let found = leave_one_out(&correspondences, &truth, &groups, &[0, 1, 2], 600).unwrap();
        assert!(found[0].by_correspondence > 0.01 && found[1].by_correspondence > 1e-3);
        assert!(found[2].by_correspondence < 1e-6, "{found:?}");
        assert!(found[2].by_chamfer < 0.3 * found[0].by_chamfer, "{found:?}");
    }
}
