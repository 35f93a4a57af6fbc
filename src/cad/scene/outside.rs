//! The true shape of a sequence: points on the outside of its mesh.

use super::super::{Mesh, sample_outside};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Draws to thin.
const SAMPLES: usize = 400_000;

/// At most `count` points, evenly spread over the outside of `mesh`; object frame.
pub fn outside_points(mesh: &Mesh, count: usize) -> Vec<[f32; 3]> {
    let outside = sample_outside(mesh, SAMPLES, 0).points;
    // The smallest cell that leaves no more than `count`.
    let (mut too_small, mut edge) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (too_small + edge);
        if thin(&outside, middle).len() > count {
            too_small = middle;
        } else {
            edge = middle;
        }
    }
    let kept = thin(&outside, edge);
    kept.iter()
        .map(|point| [point.x as f32, point.y as f32, point.z as f32])
        .collect()
}

/// The first point of each cell of a grid, in the order of the cells.
fn thin(points: &[Vector3<f64>], edge: f64) -> Vec<Vector3<f64>> {
    let cell = |point: &Vector3<f64>| point.map(|x| (x / edge).floor() as i32).into();
    let mut cells: Vec<([i32; 3], usize)> = points.par_iter().map(cell).zip(0..points.len()).collect();
    cells.par_sort_unstable();
    cells.dedup_by_key(|(cell, _)| *cell);
    cells.into_iter().map(|(_, index)| points[index]).collect()
}
