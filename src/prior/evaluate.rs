//! How well a prior reconstructs shapes that it never saw: leave-one-out Chamfer error.

use super::learn::{Correspondences, LearnError, tree_of};
use super::{LearnedPrior, ShapePrior};
use crate::cad::OutsideSample;
use nalgebra::{DMatrix, DMatrixView, DVector, Vector3};
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// Rounds of nearest neighbours and least squares when a shape is fitted by its Chamfer distance.
const FIT_ROUNDS: usize = 20;
/// A fit looks at no more than so many samples of the shape a point.
const FIT_SAMPLES_PER_POINT: usize = 4;
/// Weight of ‖s‖² against the sum of squared distances of a fit, times their expected square: keeps s within
/// what the data tell.
const FIT_RIDGE: f64 = 1e-5;

/// Errors of one way of learning, and of fitting, over the held-out shapes, in diagonals.
#[derive(Clone, Debug, PartialEq)]
pub struct FitError {
    /// Mean, s by least squares to the held-out shape's corresponded points.
    pub by_correspondence: f64,
    /// Mean, s by minimising the Chamfer distance to the held-out shape's outside.
    pub by_chamfer: f64,
    /// The fits by Chamfer distance to every shape, in order.
    pub each: Vec<Fit>,
}

/// A fit to a shape left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The Chamfer distance between fit and shape, diagonals.
    pub chamfer: f64,
    /// What the prior's own −log p, up to a constant, asks a length for: the style, with the free form where there is one.
    pub style: Vec<f64>,
}

/// Makes a prior of the models with these indices.
pub type Learner<'a> = dyn Fn(&[usize]) -> Result<LearnedPrior, LearnError> + Sync + 'a;

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

/// A sample that pulls is trusted to this, in diagonals, unless told otherwise; what the figures of earlier priors were measured with.
pub const DEFAULT_NOISE: f64 = 0.143;

/// Leaves each shape out in turn, together with all of its `group` (near-duplicates), and reconstructs it with what each of
/// `learners` makes of the rest, at the first `points` points; errors are measured against `truth`, dense samples independent of
/// those learned from.
///
/// Fits by Chamfer distance minimise ½‖s‖² + Σ d² / (2 noise²) over the distances of both ways, those from the shape weighing as much as
/// those to it, once with each of `noises`, in diagonals. The result has the noises of the first learner first. The correspondences are those
/// of the whole collection: what is left out is left out of learning from them.
pub fn leave_one_out(
    correspondences: &Correspondences,
    truth: &[OutsideSample],
    group: &[usize],
    learners: &[Box<Learner>],
    points: usize,
    noises: &[f64],
) -> Result<Vec<FitError>, LearnError> {
    let held: Vec<Vec<(f64, Vec<Fit>)>> = (0..truth.len())
        .into_par_iter()
        .map(|out| {
            let rest = rest_of(group, out);
            let own = points_of(&correspondences.shapes[out], points);
            let errors = learners.iter().map(|learner| {
                let prior = learner(&rest)?;
                let corresponded = fit(&prior, points, 0.0, |_| own.iter().map(|&x| (x, 1.0)).collect());
                let error = |style: &[f64]| chamfer(&shape(&prior, style, points), &truth[out].points);
                let fits = noises.iter().map(|noise| {
                    let style = fitted(&prior, &truth[out].points, points, noise * noise / points as f64);
                    Fit {
                        chamfer: error(&style),
                        style,
                    }
                });
                Ok((error(&corresponded), fits.collect()))
            });
            errors.collect()
        })
        .collect::<Result<_, LearnError>>()?;
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    let ways = (0..learners.len()).flat_map(|k| (0..noises.len()).map(move |n| (k, n)));
    Ok(ways
        .map(|(k, n)| {
            let each: Vec<Fit> = held.iter().map(|errors| errors[k].1[n].clone()).collect();
            FitError {
                by_correspondence: mean(&held.iter().map(|errors| errors[k].0).collect::<Vec<_>>()),
                by_chamfer: mean(&each.iter().map(|fit| fit.chamfer).collect::<Vec<_>>()),
                each,
            }
        })
        .collect())
}

/// All shapes but those of `out`'s group.
pub(super) fn rest_of(group: &[usize], out: usize) -> Vec<usize> {
    (0..group.len()).filter(|&m| group[m] != group[out]).collect()
}

/// The first `count` points of X(s).
fn shape(prior: &LearnedPrior, style: &[f64], count: usize) -> Vec<V3> {
    let mut points = vec![0.0; 3 * count.min(prior.point_count())];
    prior.points(style, &mut points);
    points_of(&points, count)
}

/// What pulls each point of a shape: the mean of the target's nearest point and of those of the target's points whose nearest
/// it is, and how hard. The target is denser; both directions weigh the same, as in the Chamfer distance.
fn nearest_both_ways(target: &[V3]) -> impl Fn(&[V3]) -> Vec<(V3, f64)> {
    let targets = tree_of(target);
    move |current| {
        let back = current.len() as f64 / target.len().max(1) as f64;
        let mut pulls: Vec<(V3, f64)> = current
            .iter()
            .map(|&p| (targets.nearest(p.into()).map_or(p, |n| target[n.index]), 1.0))
            .collect();
        let tree = tree_of(current);
        for point in target {
            if let Some(near) = tree.nearest((*point).into()) {
                let (sum, weight) = &mut pulls[near.index];
                *sum += point * back;
                *weight += back;
            }
        }
        for (sum, weight) in &mut pulls {
            *sum /= *weight;
        }
        pulls
    }
}

/// The style whose first `points` points come nearest to `target`, dense samples of an outside, by their Chamfer distance.
pub fn style_of(prior: &LearnedPrior, target: &[V3], points: usize) -> Vec<f64> {
    fitted(prior, target, points, FIT_RIDGE)
}

fn fitted(prior: &LearnedPrior, target: &[V3], points: usize, ridge: f64) -> Vec<f64> {
    let stride = target.len().div_ceil(FIT_SAMPLES_PER_POINT * points).max(1);
    let target: Vec<V3> = target.iter().step_by(stride).copied().collect();
    fit(prior, points, ridge, nearest_both_ways(&target))
}

/// Gauss–Newton in the style towards where `pulls` draws the first `points` points, and how hard; these are renewed in every
/// round; `ridge` is the weight of ‖s‖² a point.
fn fit(prior: &LearnedPrior, points: usize, ridge: f64, pulls: impl Fn(&[V3]) -> Vec<(V3, f64)>) -> Vec<f64> {
    let styles = prior.style_len();
    let mut style = DVector::zeros(styles);
    if styles == 0 {
        return Vec::new();
    }
    let points = points.min(prior.point_count());
    let mut jacobian = vec![0.0; 3 * points * styles];
    for _ in 0..FIT_ROUNDS {
        let current = shape(prior, style.as_slice(), points);
        prior.jacobian(style.as_slice(), &mut jacobian);
        let ridge = ridge * points as f64;
        let mut normal = DMatrix::identity(styles, styles) * ridge;
        let mut right = -ridge * &style;
        // Row-major: as nalgebra's column-major matrix, the transpose.
        let transposed = DMatrixView::from_slice(&jacobian, styles, 3 * points);
        let mut weighted = transposed.clone_owned();
        let mut residuals = DVector::zeros(3 * points);
        for (i, (x, (goal, weight))) in current.iter().zip(pulls(&current)).enumerate() {
            for axis in 0..3 {
                weighted.column_mut(3 * i + axis).scale_mut(weight);
                residuals[3 * i + axis] = goal[axis] - x[axis];
            }
        }
        right.gemv(1.0, &weighted, &residuals, 1.0);
        normal.gemm(1.0, &weighted, &transposed.transpose(), 1.0);
        let Some(step) = normal.cholesky().map(|c| c.solve(&right)) else {
            break;
        };
        style += step;
    }
    style.as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::LinearPrior;

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
        let learners: Vec<Box<Learner>> = [0, 1, 2]
            .map(|styles| {
                let (shapes, normals) = (&correspondences.shapes, &correspondences.normals);
                let learner = move |models: &[usize]| {
                    let shapes: Vec<_> = models.iter().map(|&m| shapes[m].clone()).collect();
                    let weights = vec![1.0; shapes.len()];
                    let prior =
                        LinearPrior::from_correspondences(&shapes, &weights, normals.clone(), styles)?.0;
                    Ok(LearnedPrior::from(prior))
                };
                Box::new(learner) as Box<Learner>
            })
            .into();
        let found = leave_one_out(
            &correspondences,
            &truth,
            &groups,
            &learners,
            600,
            &[DEFAULT_NOISE, 1.0],
        )
        .unwrap();
        // Two noises each.
        let [none, one, two] = [&found[0], &found[2], &found[4]];
        assert!(none.by_correspondence > 0.01 && one.by_correspondence > 1e-3);
        assert!(two.by_correspondence < 1e-6, "{found:?}");
        assert!(two.by_chamfer < 0.3 * none.by_chamfer, "{found:?}");
        // The less a sample is trusted, the more the fit keeps to the mean.
        assert!(found[5].by_chamfer > 2.0 * two.by_chamfer, "{found:?}");
    }
}
