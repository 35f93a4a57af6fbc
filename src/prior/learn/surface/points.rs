//! Points for sums over the surface: drawn by area from one half, in farthest-point order.

use crate::prior::learn::farthest::farthest_order;
use crate::prior::mesh::{MirroredMesh, area_normal};
use crate::prior::surface::{SurfacePoint, corners};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type V3 = Vector3<f64>;

/// So many are drawn for each that is kept: the farthest from one another are more even than chance.
const DRAWN: usize = 3;

/// `count` points of the half whose vertices are `half`.
pub fn draw_points(mesh: &MirroredMesh, half: &[V3], count: usize, seed: u64) -> Vec<SurfacePoint> {
    let areas: Vec<f64> = mesh
        .half_faces()
        .iter()
        .map(|face| area_normal(half, face).norm())
        .collect();
    let total: f64 = areas.iter().sum();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut face, mut below) = (0, 0.0);
    let drawn: Vec<SurfacePoint> = (0..DRAWN * count)
        .map(|k| {
            let target = (k as f64 + random.random::<f64>()) / (DRAWN * count) as f64 * total;
            while face + 1 < areas.len() && below + areas[face] <= target {
                below += areas[face];
                face += 1;
            }
            let (root, part) = (random.random::<f64>().sqrt(), random.random::<f64>());
            SurfacePoint {
                face: face as u32,
                weights: [root * (1.0 - part), root * part].map(|w| w as f32),
            }
        })
        .collect();
    let places: Vec<V3> = drawn
        .iter()
        .map(|point| corners(mesh, point).iter().map(|&(v, w)| half[v] * w).sum())
        .collect();
    farthest_order(&places, count)
        .into_iter()
        .map(|i| drawn[i])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::mesh::tests::half_octahedron;

    #[test]
    fn points_are_uniform_by_area_and_the_seed_decides() {
        let (mesh, mut half) = half_octahedron();
        // The lower faces are larger.
        half[3] *= 3.0;
        let found = draw_points(&mesh, &half, 2000, 1);
        let area = |f: usize| area_normal(&half, &mesh.half_faces()[f]).norm();
        let total: f64 = (0..4).map(area).sum();
        for face in 0..4 {
            let share = found.iter().filter(|p| p.face as usize == face).count() as f64 / 2000.0;
            assert!((share - area(face) / total).abs() < 0.02, "{share}");
        }
        assert_eq!(found, draw_points(&mesh, &half, 2000, 1));
        assert_ne!(found, draw_points(&mesh, &half, 2000, 2));
    }
}
