//! What a template is drawn onto: oriented samples of a model's outside, and what they pull.

use crate::cad::OutsideSample;
use crate::prior::learn::neighbours::{Neighbours, oriented};
use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// Normals whose cosine is less are not of one piece of surface.
const COMPATIBLE: f64 = 0.35;
/// Weight of all samples that pull their nearest vertices, against that of all vertices pulled to their nearest samples.
const PULL_BACK: f64 = 1.0;

/// Samples that vertices find, for each that pulls.
const FOUND_PER_PULLING: usize = 4;

/// A symmetric shape's outside.
pub struct Target {
    half: OutsideSample,
    whole: OutsideSample,
}

/// What pulls one vertex: the place, the surface's normal there and how hard.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    pub vertex: usize,
    pub place: V3,
    pub normal: V3,
    pub weight: f64,
}

/// The distance up to which samples count.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// Weight of a unit normal against a position (diagonal 1) in nearest neighbours.
    pub normal_weight: f64,
    /// A pull over this distance has a quarter of its weight; in diagonals.
    pub distance: f64,
}

impl Target {
    /// `outside` need not be symmetric; at most `pulling` samples of its half pull back.
    pub fn new(outside: &OutsideSample, pulling: usize) -> Self {
        let half = outside.symmetrised().half();
        Self {
            whole: thinned(&half, FOUND_PER_PULLING * pulling).symmetrised(),
            half: thinned(&half, pulling),
        }
    }

    /// The half's samples.
    pub fn points(&self) -> &[V3] {
        &self.half.points
    }

    /// A tree to find nearest samples in.
    pub fn tree(&self, normal_weight: f64) -> Neighbours<6> {
        tree(&self.whole.points, &self.whole.normals, normal_weight)
    }

    /// What pulls the half-mesh's vertices, given its normals: each vertex its nearest sample, each sample its nearest vertex.
    pub fn pulls(&self, vertices: &[V3], normals: &[V3], samples: &Neighbours<6>, reach: Reach) -> Vec<Pull> {
        let weight = |distance: f64| (1.0 + (distance / reach.distance).powi(2)).powi(-2);
        let mut pulls = Vec::with_capacity(vertices.len() + self.half.points.len());
        for (vertex, (point, normal)) in vertices.iter().zip(normals).enumerate() {
            let Some(near) = samples.nearest(oriented(point, normal, reach.normal_weight)) else {
                continue;
            };
            let (place, found) = (self.whole.points[near.index], self.whole.normals[near.index]);
            if found.dot(normal) > COMPATIBLE {
                pulls.push(Pull {
                    vertex,
                    place,
                    normal: found,
                    weight: weight((place - point).norm()),
                });
            }
        }
        let back = PULL_BACK * vertices.len() as f64 / self.half.points.len().max(1) as f64;
        let tree = tree(vertices, normals, reach.normal_weight);
        for (&place, &normal) in self.half.points.iter().zip(&self.half.normals) {
            let Some(near) = tree.nearest(oriented(&place, &normal, reach.normal_weight)) else {
                continue;
            };
            let vertex = near.index;
            if normals[vertex].dot(&normal) > COMPATIBLE {
                pulls.push(Pull {
                    vertex,
                    place,
                    normal,
                    weight: back * weight((place - vertices[vertex]).norm()),
                });
            }
        }
        pulls
    }
}

/// At most `count` entries at even strides; samples lie in order of their triangles, so these stay even.
fn thinned(sample: &OutsideSample, count: usize) -> OutsideSample {
    let all = sample.points.len();
    let count = count.min(all);
    let indices: Vec<usize> = (0..count).map(|k| k * all / count).collect();
    sample.select(&indices)
}

fn tree(points: &[V3], normals: &[V3], normal_weight: f64) -> Neighbours<6> {
    let pairs = points.iter().zip(normals);
    Neighbours::new(pairs.map(|(p, n)| oriented(p, n, normal_weight)))
}
