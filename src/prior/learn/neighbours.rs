//! Nearest neighbours among points, or among oriented points, through a k-d tree.

use nabo::simple_point::SimplePoint;
use nabo::{CandidateContainer, KDTree, NotNan, Parameters};
use nalgebra::Vector3;

/// A k-d tree over D-vectors: positions (D = 3), or positions and scaled normals (D = 6).
pub struct Neighbours<const D: usize>(KDTree<f32, SimplePoint<D>>);

/// A neighbour: its index, and its distance in the tree's metric.
pub struct Neighbour {
    pub index: usize,
    pub distance: f64,
}

impl<const D: usize> Neighbours<D> {
    /// Coordinates must be finite.
    pub fn new(points: impl IntoIterator<Item = [f64; D]>) -> Self {
        let cloud: Vec<_> = points.into_iter().map(simple).collect();
        Self(KDTree::new(&cloud))
    }

    /// The nearest point; `None` where there is none.
    pub fn nearest(&self, query: [f64; D]) -> Option<Neighbour> {
        self.k_nearest(query, 1).pop()
    }

    /// The `count` nearest points, nearest first; a point of the tree is its own neighbour.
    pub fn k_nearest(&self, query: [f64; D], count: usize) -> Vec<Neighbour> {
        let parameters = Parameters {
            epsilon: 0.0,
            max_radius: f32::INFINITY,
            allow_self_match: true,
            sort_results: true,
        };
        self.0
            .knn_advanced(
                count as u32,
                &simple(query),
                CandidateContainer::Linear,
                &parameters,
                None,
            )
            .into_iter()
            .map(|n| Neighbour {
                index: n.index as usize,
                distance: f64::from(n.dist2.into_inner()).sqrt(),
            })
            .collect()
    }
}

fn simple<const D: usize>(point: [f64; D]) -> SimplePoint<D> {
    SimplePoint(point.map(|x| NotNan::new(x as f32).unwrap_or_default()))
}

/// The tree over bare positions.
pub fn tree_of(points: &[Vector3<f64>]) -> Neighbours<3> {
    Neighbours::new(points.iter().map(|&p| p.into()))
}

/// A position and `weight` times a normal: where two such are near, both place and orientation agree, which
/// keeps the two sides of a thin sheet apart.
pub fn oriented(point: &Vector3<f64>, normal: &Vector3<f64>, weight: f64) -> [f64; 6] {
    let n = normal * weight;
    [point.x, point.y, point.z, n.x, n.y, n.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_come_nearest_first() {
        let points = [0.0, 3.0, 1.0, 10.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let found = tree_of(&points).k_nearest([0.9, 0.0, 0.0], 3);
        assert_eq!(found.iter().map(|n| n.index).collect::<Vec<_>>(), [2, 0, 1]);
        assert!((found[0].distance - 0.1).abs() < 1e-6);
    }

    #[test]
    fn orientation_tells_the_sides_of_a_sheet_apart() {
        let (up, down) = (Vector3::y(), -Vector3::y());
        let sheet = [(Vector3::new(0.0, 0.001, 0.0), up), (Vector3::zeros(), down)];
        let tree = Neighbours::new(sheet.iter().map(|(p, n)| oriented(p, n, 0.05)));
        let found = tree
            .nearest(oriented(&Vector3::new(0.0, 0.002, 0.0), &down, 0.05))
            .unwrap();
        assert_eq!(found.index, 1);
    }
}
