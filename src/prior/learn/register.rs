//! Non-rigid registration: a dense template is drawn onto a shape, each point to its nearest neighbour and each
//! of the shape's points to its own, while neighbours on the template keep moving together:
//! min_d Σ a_i |m_i + d_i − t_i|² + λ Σ_{i~j} |d_i − d_j|², with t renewed in every round and λ falling.

use super::neighbours::{Neighbours, oriented};
use crate::cad::OutsideSample;
use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// How many template neighbours hold a point.
const NEIGHBOURS: usize = 10;
/// Weight of a unit normal against a position (diagonal 1) in nearest neighbours.
const NORMAL_WEIGHT: f64 = 0.08;
/// λ falls from the first to the last over the rounds.
const STIFFNESS: [f64; 2] = [30.0, 0.6];
const ROUNDS: usize = 14;
/// Weight of one of the shape's points pulling its nearest template point, against the pull the other way.
const PULL_BACK: f64 = 0.5;
const CONJUGATE_GRADIENT_STEPS: usize = 40;
/// Weight that keeps the points beside the plane of symmetry beside it: the mirror images would part otherwise.
const SEAM: f64 = 20.0;
/// How wide that strip is, in spacings of the template.
const SEAM_WIDTH: f64 = 1.5;

/// A template with its neighbourhood graph; one half of a mirrored shape.
pub struct Template {
    pub sample: OutsideSample,
    edges: Vec<[usize; 2]>,
    /// Points closer than this to x = 0 stay at their distance.
    seam: f64,
}

impl Template {
    pub fn new(sample: OutsideSample) -> Self {
        let tree = tree(&sample.points, &sample.normals);
        let mut edges: Vec<[usize; 2]> = Vec::new();
        for (i, (point, normal)) in sample.points.iter().zip(&sample.normals).enumerate() {
            let near = tree.k_nearest(oriented(point, normal, NORMAL_WEIGHT), NEIGHBOURS + 1);
            edges.extend(
                near.iter()
                    .filter(|n| n.index != i)
                    .map(|n| [i.min(n.index), i.max(n.index)]),
            );
        }
        edges.sort_unstable();
        edges.dedup();
        let spacing = crate::surface::spacing(&sample.points);
        Self {
            sample,
            edges,
            seam: SEAM_WIDTH * spacing,
        }
    }

    /// Where the template's points lie on `shape` (a dense half sample), starting from `start`.
    pub fn register(&self, start: &[V3], shape: &OutsideSample) -> Vec<V3> {
        // A template point near the plane of symmetry may find its nearest neighbour on the other half.
        let whole = shape.symmetrised();
        let targets = tree(&whole.points, &whole.normals);
        let mut current = start.to_vec();
        for round in 0..ROUNDS {
            let progress = round as f64 / (ROUNDS - 1) as f64;
            let stiffness = STIFFNESS[0] * (STIFFNESS[1] / STIFFNESS[0]).powf(progress);
            let (weights, goals) = self.goals(&current, shape, &whole, &targets);
            let displacement: Vec<V3> = goals
                .iter()
                .zip(&self.sample.points)
                .map(|(g, m)| g - m)
                .collect();
            let mut moved: Vec<V3> = current
                .iter()
                .zip(&self.sample.points)
                .map(|(c, m)| c - m)
                .collect();
            self.solve(&weights, &displacement, stiffness, &mut moved);
            for ((current, moved), rest) in current.iter_mut().zip(&moved).zip(&self.sample.points) {
                *current = rest + moved;
                current.x = current.x.max(0.0);
            }
        }
        current
    }

    /// a_i (per axis) and t_i: the mean of what pulls each point.
    fn goals(
        &self,
        current: &[V3],
        shape: &OutsideSample,
        whole: &OutsideSample,
        targets: &Neighbours<6>,
    ) -> (Vec<V3>, Vec<V3>) {
        let mut weights = vec![V3::zeros(); current.len()];
        let mut sums = vec![V3::zeros(); current.len()];
        for (i, (point, normal)) in current.iter().zip(&self.sample.normals).enumerate() {
            if let Some(near) = targets.nearest(oriented(point, normal, NORMAL_WEIGHT)) {
                weights[i] += V3::repeat(1.0);
                sums[i] += whole.points[near.index];
            }
        }
        let moved = tree(current, &self.sample.normals);
        for (point, normal) in shape.points.iter().zip(&shape.normals) {
            if let Some(near) = moved.nearest(oriented(point, normal, NORMAL_WEIGHT)) {
                weights[near.index] += V3::repeat(PULL_BACK);
                sums[near.index] += point * PULL_BACK;
            }
        }
        for ((rest, weight), sum) in self.sample.points.iter().zip(&mut weights).zip(&mut sums) {
            if rest.x < self.seam {
                weight.x += SEAM;
                sum.x += SEAM * rest.x;
            }
        }
        let goals = sums
            .iter()
            .zip(&weights)
            .map(|(s, w)| s.component_div(w))
            .collect();
        (weights, goals)
    }

    /// Solves (diag(a) + λ L) d = diag(a) t by conjugate gradients from `solution` on.
    fn solve(&self, weights: &[V3], goals: &[V3], stiffness: f64, solution: &mut [V3]) {
        let apply = |x: &[V3]| {
            let mut y: Vec<V3> = x.iter().zip(weights).map(|(x, w)| x.component_mul(w)).collect();
            for &[i, j] in &self.edges {
                let pull = (x[i] - x[j]) * stiffness;
                y[i] += pull;
                y[j] -= pull;
            }
            y
        };
        let dot = |a: &[V3], b: &[V3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(b)).sum() };
        let mut residual: Vec<V3> = apply(solution)
            .iter()
            .zip(goals)
            .zip(weights)
            .map(|((ax, g), w)| g.component_mul(w) - ax)
            .collect();
        let mut direction = residual.clone();
        let mut squared = dot(&residual, &residual);
        for _ in 0..CONJUGATE_GRADIENT_STEPS {
            if squared < 1e-16 {
                break;
            }
            let applied = apply(&direction);
            let step = squared / dot(&direction, &applied);
            for i in 0..residual.len() {
                solution[i] += direction[i] * step;
                residual[i] -= applied[i] * step;
            }
            let next = dot(&residual, &residual);
            for (d, r) in direction.iter_mut().zip(&residual) {
                *d = r + *d * (next / squared);
            }
            squared = next;
        }
    }
}

fn tree(points: &[V3], normals: &[V3]) -> Neighbours<6> {
    Neighbours::new(
        points
            .iter()
            .zip(normals)
            .map(|(p, n)| oriented(p, n, NORMAL_WEIGHT)),
    )
}

/// Carries `points` along with the coarse points: each moves by the Gaussian-weighted mean of the displacements
/// of the coarse points near it.
pub fn carry(points: &[V3], coarse: &[V3], coarse_goal: &[V3]) -> Vec<V3> {
    const SUPPORT: usize = 12;
    let tree = super::neighbours::tree_of(coarse);
    points
        .iter()
        .map(|&point| {
            let near = tree.k_nearest(point.into(), SUPPORT);
            let reach = near.last().map_or(1.0, |n| n.distance.max(1e-9)) / 1.5;
            let (mut sum, mut total) = (V3::zeros(), 1e-12);
            for n in near {
                let weight = (-0.5 * (n.distance / reach).powi(2)).exp();
                sum += (coarse_goal[n.index] - coarse[n.index]) * weight;
                total += weight;
            }
            point + sum / total
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::sample_outside;
    use crate::cad::synthetic::toy_car;
    use crate::prior::learn::farthest::farthest_order_mirrored;

    #[test]
    fn a_toy_car_is_drawn_onto_another() {
        let half = |cabin, seed| sample_outside(&toy_car(cabin, 0.1, 0.4), 12000, seed).half();
        let (from, onto) = (half(0.15, 1), half(0.25, 2));
        let template = Template::new(from.select(&farthest_order_mirrored(&from.points, 1000)));
        let found = template.register(&template.sample.points, &onto);
        let to_surface = super::super::neighbours::tree_of(&onto.points);
        let off: f64 = found
            .iter()
            .map(|&p| to_surface.nearest(p.into()).unwrap().distance)
            .sum::<f64>()
            / 1000.0;
        let covered = super::super::neighbours::tree_of(&found);
        let left: f64 = onto
            .points
            .iter()
            .map(|&p| covered.nearest(p.into()).unwrap().distance)
            .sum::<f64>()
            / onto.points.len() as f64;
        assert!(off < 0.006 && left < 0.012, "{off} {left}");
    }

    #[test]
    fn a_translation_of_the_coarse_points_carries_all() {
        let coarse: Vec<V3> = (0..50)
            .map(|i| V3::new(f64::from(i % 7), f64::from(i / 7), 0.3))
            .collect();
        let goal: Vec<V3> = coarse.iter().map(|c| c + V3::new(0.1, -0.2, 0.3)).collect();
        let carried = carry(&[V3::new(3.3, 2.2, 0.0)], &coarse, &goal);
        assert!((carried[0] - V3::new(3.4, 2.0, 0.3)).norm() < 1e-9);
    }
}
