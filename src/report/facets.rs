//! Triangles between neighbouring points: an approximate surface, good enough to draw.

use crate::geometry::Vector3;

/// How many neighbours a point is joined to.
pub(super) const RING: u32 = 20;
/// Two neighbours further apart than this, as seen from the point, have the surface's border between them.
const WIDEST_CORNER_DEG: f64 = 150.0;
/// An edge longer than this many median ring radii joins things that do not belong together.
const LONGEST_EDGE: f64 = 2.5;

/// Joins each point to each pair of its neighbours that follow each other around its normal. `rings` holds
/// (index, distance), the point itself first. Triangles (corners ascending) are sorted and occur once.
pub(super) fn around_points(
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
