//! Ray casting against a triangle soup: a bounding volume hierarchy split at the median centroid.

use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// Triangles with their hierarchy; a ray either hits something or nothing.
pub struct Bvh {
    triangles: Vec<[V3; 3]>,
    nodes: Vec<Node>,
}

/// An inner node's children are the next node and `second`; a leaf holds `triangles[first..first + count]`.
struct Node {
    low: V3,
    high: V3,
    first: usize,
    count: usize,
    second: usize,
}

const LEAF_SIZE: usize = 4;

impl Bvh {
    pub fn new(mut triangles: Vec<[V3; 3]>) -> Self {
        let mut nodes = Vec::with_capacity(triangles.len());
        if !triangles.is_empty() {
            let end = triangles.len();
            build(&mut triangles, 0, end, &mut nodes);
        }
        Self { triangles, nodes }
    }

    /// Whether a triangle lies on the ray further than `nearest` from its origin.
    pub fn occludes(&self, origin: &V3, direction: &V3, nearest: f64) -> bool {
        let inverse = direction.map(|d| 1.0 / d);
        let mut stack = vec![0];
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index) else {
                continue;
            };
            if !crosses_box(origin, &inverse, &node.low, &node.high) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.second, index + 1]);
            } else if self.triangles[node.first..node.first + node.count]
                .iter()
                .any(|t| distance_to(t, origin, direction).is_some_and(|distance| distance > nearest))
            {
                return true;
            }
        }
        false
    }
}

fn build(triangles: &mut [[V3; 3]], start: usize, end: usize, nodes: &mut Vec<Node>) {
    let slice = &mut triangles[start..end];
    let infinity = V3::repeat(f64::INFINITY);
    let (low, high) = slice
        .iter()
        .flatten()
        .fold((infinity, -infinity), |(low, high), v| (low.inf(v), high.sup(v)));
    let node = nodes.len();
    nodes.push(Node {
        low,
        high,
        first: start,
        count: slice.len(),
        second: 0,
    });
    if slice.len() <= LEAF_SIZE {
        return;
    }
    let axis = (high - low).imax();
    let middle = slice.len() / 2;
    slice.select_nth_unstable_by(middle, |a, b| {
        let centre = |t: &[V3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        centre(a).total_cmp(&centre(b))
    });
    nodes[node].count = 0;
    build(triangles, start, start + middle, nodes);
    nodes[node].second = nodes.len();
    build(triangles, start + middle, end, nodes);
}

/// The slab test; `f64::min` and `max` drop the NaN of a ray that runs inside a slab's face.
fn crosses_box(origin: &V3, inverse: &V3, low: &V3, high: &V3) -> bool {
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let a = (low[axis] - origin[axis]) * inverse[axis];
        let b = (high[axis] - origin[axis]) * inverse[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    // A flat box is as thick as rounding makes it.
    enter <= leave * (1.0 + 1e-12) + 1e-12
}

/// Möller and Trumbore's test, either side of the triangle.
fn distance_to(triangle: &[V3; 3], origin: &V3, direction: &V3) -> Option<f64> {
    let (edge1, edge2) = (triangle[1] - triangle[0], triangle[2] - triangle[0]);
    let across = direction.cross(&edge2);
    let determinant = edge1.dot(&across);
    if determinant.abs() < 1e-18 {
        return None;
    }
    let from_corner = origin - triangle[0];
    let u = from_corner.dot(&across) / determinant;
    let along = from_corner.cross(&edge1);
    let v = direction.dot(&along) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| edge2.dot(&along) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = V3> {
        proptest::array::uniform3(-1.0..1.0f64).prop_map(V3::from)
    }

    proptest! {
        #[test]
        fn agrees_with_testing_every_triangle(
            soup in proptest::collection::vec((vector(), vector(), vector()), 1..60), origin in vector(), direction in vector(),
        ) {
            let triangles: Vec<[V3; 3]> = soup.into_iter().map(|(a, b, c)| [a, b, c]).collect();
            let brute = triangles.iter().any(|t| distance_to(t, &origin, &direction).is_some_and(|d| d > 1e-4));
            prop_assert_eq!(Bvh::new(triangles).occludes(&origin, &direction, 1e-4), brute);
        }
    }

    #[test]
    fn a_wall_occludes_in_front_only() {
        let wall = vec![[
            V3::new(-1.0, -1.0, 2.0),
            V3::new(3.0, -1.0, 2.0),
            V3::new(-1.0, 3.0, 2.0),
        ]];
        let bvh = Bvh::new(wall);
        assert!(bvh.occludes(&V3::zeros(), &V3::z(), 1e-6));
        assert!(!bvh.occludes(&V3::zeros(), &-V3::z(), 1e-6));
        assert!(!bvh.occludes(&V3::zeros(), &V3::x(), 1e-6));
        assert!(!bvh.occludes(&V3::zeros(), &V3::z(), 2.5));
        assert!(!Bvh::new(Vec::new()).occludes(&V3::zeros(), &V3::z(), 0.0));
    }
}
