//! Triangles between neighbouring points: an approximate surface, good enough to draw.

use super::Neighbours;
use crate::geometry::{Vector3, tangent_plane};

/// How many neighbours a point is joined to.
const RING: u32 = 20;
/// Two neighbours further apart than this, as seen from the point, have the surface's border between them.
const WIDEST_CORNER_DEG: f64 = 150.0;
/// An edge longer than this many median ring radii joins things that do not belong together.
const LONGEST_EDGE: f64 = 2.5;

/// Triangles that join points to their neighbours.
pub(crate) struct Facets {
    /// Indices of the points, ascending.
    pub faces: Vec<[u32; 3]>,
    /// Unit normals, one per point: least-squares planes', turned away from the centroid.
    pub normals: Vec<Vector3<f64>>,
    /// The median distance from a point to its nearest neighbour; 0 below two points.
    pub spacing: f64,
}

impl Facets {
    pub fn around(points: &[Vector3<f64>]) -> Self {
        let tree = Neighbours::new(points);
        let rings: Vec<_> = points.iter().map(|point| tree.nearest(point, RING + 1)).collect();
        let centroid = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let normal = |(point, ring): (&Vector3<f64>, &Vec<(usize, f64)>)| {
            let around: Vec<_> = ring.iter().map(|&(i, _)| points[i]).collect();
            let (normal, _) = tangent_plane(&around);
            let inward = normal.dot(&(point - centroid)) < 0.0;
            if inward { -normal } else { normal }
        };
        let normals: Vec<_> = points.iter().zip(&rings).map(normal).collect();
        let nearest = rings.iter().filter_map(|ring| ring.get(1));
        Self {
            faces: around_points(points, &normals, &rings),
            normals,
            spacing: median(nearest.map(|&(_, distance)| distance)),
        }
    }
}

/// 0 of none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<_> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Joins each point to each pair of its neighbours that follow each other around its normal. `rings` holds
/// (index, distance), the point itself first. Triangles (corners ascending) are sorted and occur once.
fn around_points(
    points: &[Vector3<f64>],
    normals: &[Vector3<f64>],
    rings: &[Vec<(usize, f64)>],
) -> Vec<[u32; 3]> {
    let mut reaches: Vec<_> = rings
        .iter()
        .filter_map(|ring| ring.last())
        .map(|last| last.1)
        .collect();
    reaches.sort_by(f64::total_cmp);
    let longest = LONGEST_EDGE * reaches.get(reaches.len() / 2).copied().unwrap_or(0.0);
    let mut facets = Vec::new();
    for (i, (normal, ring)) in normals.iter().zip(rings).enumerate() {
        let across = normal.cross(&least_aligned_axis(normal)).normalize();
        let along = normal.cross(&across);
        let mut around: Vec<(f64, usize)> = ring
            .iter()
            .filter(|&&(j, distance)| j != i && distance > 0.0 && distance <= longest)
            .map(|&(j, _)| {
                let offset = points[j] - points[i];
                (offset.dot(&along).atan2(offset.dot(&across)), j)
            })
            .collect();
        around.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (k, &(angle, j)) in around.iter().enumerate() {
            let (next_angle, next) = around[(k + 1) % around.len()];
            let corner = (next_angle - angle).rem_euclid(std::f64::consts::TAU);
            if j != next && corner <= WIDEST_CORNER_DEG.to_radians() {
                let mut facet = [i as u32, j as u32, next as u32];
                facet.sort_unstable();
                facets.push(facet);
            }
        }
    }
    facets.sort_unstable();
    facets.dedup();
    facets
}

fn least_aligned_axis(normal: &Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[normal.iamin()] = 1.0;
    axis
}
