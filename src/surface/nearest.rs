//! Nearest neighbours in a fixed point cloud.

use super::median;
use nabo::{KDTree, NotNan, Point, simple_point::P3};
use nalgebra::Vector3;

/// A k-d tree over points; coordinates are held as `f32`.
pub(crate) struct Neighbours(KDTree<f32, P3>);

impl Neighbours {
    /// Points that are not finite are placed at the origin; callers check theirs.
    pub(crate) fn new<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>) -> Self {
        Self(KDTree::new(&points.into_iter().map(key).collect::<Vec<_>>()))
    }

    /// Up to `count` nearest points as (index, distance), nearest first.
    pub(crate) fn nearest(&self, query: &Vector3<f64>, count: u32) -> Vec<(usize, f64)> {
        self.0
            .knn(count, &key(query))
            .into_iter()
            .map(|n| (n.index as usize, f64::from(n.dist2.into_inner()).sqrt()))
            .collect()
    }
}

/// The median distance to the nearest other point; 0 below two points.
pub(crate) fn spacing(points: &[Vector3<f64>]) -> f64 {
    let tree = Neighbours::new(points);
    let nearest = points
        .iter()
        .filter_map(|point| tree.nearest(point, 2).get(1).map(|n| n.1));
    median(nearest)
}

fn key(point: &Vector3<f64>) -> P3 {
    P3::from_raw(&[point.x as f32, point.y as f32, point.z as f32])
        .unwrap_or(P3::from_slice(&[NotNan::default(); 3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_first_with_distances() {
        let line: Vec<_> = (0..50).map(|i| Vector3::new(f64::from(i), 0.0, 0.0)).collect();
        let found = Neighbours::new(&line).nearest(&Vector3::new(20.25, 0.0, 0.0), 3);
        assert_eq!(found.iter().map(|n| n.0).collect::<Vec<_>>(), [20, 21, 19]);
        assert!((found[1].1 - 0.75).abs() < 1e-6);
    }

    #[test]
    fn many_equal_points_are_no_trouble() {
        let same = vec![Vector3::new(1.0, 2.0, 3.0); 500];
        assert_eq!(Neighbours::new(&same).nearest(&same[0], 4).len(), 4);
    }
}
