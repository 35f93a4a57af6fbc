//! Coarse correspondences over a collection: each shape's points assigned to a common template, which the mean
//! then replaces, a few times over.

use super::assignment::assign_points;
use crate::cad::OutsideSample;
use nalgebra::Vector3;
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// The template in box-normalised coordinates, and for each shape which of its points belongs to each of the
/// template's.
pub struct Coarse {
    pub template: Vec<V3>,
    pub partner: Vec<Vec<usize>>,
}

/// Extents below this (of a diagonal of 1) are not stretched further.
const THINNEST: f64 = 1e-3;

/// Scales each axis so that the symmetric box around `points` spans [−1, 1]: cars of other proportions then
/// overlap part by part.
pub fn box_normalised(points: &[V3]) -> Vec<V3> {
    let extent = points
        .iter()
        .fold(V3::repeat(THINNEST), |extent, p| extent.sup(&p.abs()));
    points.iter().map(|p| p.component_div(&extent)).collect()
}

/// Corresponds `shapes` (equally many points each, one half of a mirrored shape) in `passes` rounds, starting
/// from the shape that is nearest to all others.
pub fn correspond(shapes: &[OutsideSample], passes: usize, mut done: impl FnMut()) -> Coarse {
    let shapes: Vec<Vec<V3>> = shapes.iter().map(|s| box_normalised(&s.points)).collect();
    let mut template = shapes[medoid(&shapes)].clone();
    let mut partner = Vec::new();
    for _ in 0..passes {
        partner = shapes
            .par_iter()
            .map(|shape| assign_points(&template, shape))
            .collect();
        template = mean(&shapes, &partner);
        done();
    }
    Coarse { template, partner }
}

fn mean(shapes: &[Vec<V3>], partner: &[Vec<usize>]) -> Vec<V3> {
    (0..shapes[0].len())
        .map(|i| {
            let sum: V3 = shapes
                .iter()
                .zip(partner)
                .map(|(shape, partner)| shape[partner[i]])
                .sum();
            sum / shapes.len() as f64
        })
        .collect()
}

/// The shape with the least sum of mean nearest-neighbour distances to all others.
fn medoid(shapes: &[Vec<V3>]) -> usize {
    let trees: Vec<_> = shapes.iter().map(|s| super::neighbours::tree_of(s)).collect();
    let cost = |shape: &Vec<V3>| -> f64 {
        trees
            .iter()
            .flat_map(|tree| shape.iter().step_by(4).filter_map(|&p| tree.nearest(p.into())))
            .map(|n| n.distance)
            .sum()
    };
    let costs: Vec<f64> = shapes.par_iter().map(cost).collect();
    (0..costs.len())
        .min_by(|&a, &b| costs[a].total_cmp(&costs[b]))
        .unwrap_or(0)
}
