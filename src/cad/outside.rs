//! Oriented samples of a model's outside: what a camera around it could see, without seats, engine or driver.

use super::Mesh;
use super::bvh::Bvh;
use super::random::Random;
use crate::geometry::mirror;
use nalgebra::Vector3;
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// Directions tried from every sample.
const DIRECTIONS: usize = 60;
/// A sample is outside if at least so many directions are free.
const FREE_DIRECTIONS: usize = 2;
/// So many tell which side is out; the rest need not be tried.
const ENOUGH_DIRECTIONS: usize = 7;
/// A sample is on the shell if at least so many are free: what is seen through an open floor or a window sees less.
const SHELL_DIRECTIONS: usize = 12;
/// Where a ray starts to count, in diagonals: past the triangle it starts on and its doubles.
const RAY_START: f64 = 1e-4;

/// Points on the outside with their outward unit normals, object frame.
#[derive(Clone, Debug, Default)]
pub struct OutsideSample {
    /// Positions, in diagonals.
    pub points: Vec<V3>,
    /// Outward unit normals, one per point.
    pub normals: Vec<V3>,
}

impl OutsideSample {
    /// The sample and its mirror image in x = 0.
    pub fn symmetrised(&self) -> Self {
        let mirrored = |vectors: &[V3]| {
            vectors
                .iter()
                .copied()
                .chain(vectors.iter().map(mirror))
                .collect()
        };
        Self {
            points: mirrored(&self.points),
            normals: mirrored(&self.normals),
        }
    }

    /// The entries at `indices`.
    pub fn select(&self, indices: &[usize]) -> Self {
        Self {
            points: indices.iter().map(|&i| self.points[i]).collect(),
            normals: indices.iter().map(|&i| self.normals[i]).collect(),
        }
    }

    /// The entries with x ≥ 0.
    pub fn half(&self) -> Self {
        let indices: Vec<_> = (0..self.points.len())
            .filter(|&i| self.points[i].x >= 0.0)
            .collect();
        self.select(&indices)
    }
}

/// Draws `count` area-uniform samples of `mesh` and keeps those on the outside (about two thirds for a model
/// with an interior). Same mesh, count and seed: same samples.
pub fn sample_outside(mesh: &Mesh, count: usize, seed: u64) -> OutsideSample {
    sample(mesh, count, seed, FREE_DIRECTIONS, ENOUGH_DIRECTIONS)
}

/// Like [`sample_outside`], without what lies in cavities: the part that a closed surface can lie on.
pub fn sample_shell(mesh: &Mesh, count: usize, seed: u64) -> OutsideSample {
    sample(mesh, count, seed, SHELL_DIRECTIONS, SHELL_DIRECTIONS)
}

/// Keeps a sample if `least` directions are free; no more are tried once `enough` are.
fn sample(mesh: &Mesh, count: usize, seed: u64, least: usize, enough: usize) -> OutsideSample {
    let triangles: Vec<[V3; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.vertices.map(|i| mesh.vertices[i as usize]))
        .collect();
    let drawn = draw(&triangles, count, seed);
    let bvh = Bvh::new(triangles);
    let directions = sphere_directions();
    let kept: Vec<(V3, V3)> = drawn
        .par_iter()
        .filter_map(|(point, normal)| {
            let sides = free_sides(&bvh, &directions, point, normal, enough);
            let outward = if sides[0] >= sides[1] { *normal } else { -normal };
            (sides[0] + sides[1] >= least).then_some((*point, outward))
        })
        .collect();
    let (points, normals) = kept.into_iter().unzip();
    OutsideSample { points, normals }
}

/// How many directions are free on the normal's side of a point and on the other, `enough` at most.
fn free_sides(bvh: &Bvh, directions: &[V3], point: &V3, normal: &V3, enough: usize) -> [usize; 2] {
    let mut sides = [0; 2];
    for direction in directions {
        if sides[0] + sides[1] < enough && !bvh.occludes(point, direction, RAY_START) {
            sides[usize::from(direction.dot(normal) <= 0.0)] += 1;
        }
    }
    sides
}

/// Area-uniform points with their triangle's unit normal; stratified over the cumulated area.
fn draw(triangles: &[[V3; 3]], count: usize, seed: u64) -> Vec<(V3, V3)> {
    let crosses: Vec<V3> = triangles
        .iter()
        .map(|[a, b, c]| (b - a).cross(&(c - a)))
        .collect();
    let total: f64 = crosses.iter().map(V3::norm).sum();
    let mut random = Random::new(seed, 0, 0);
    let (mut index, mut below) = (0, 0.0);
    let mut drawn = Vec::with_capacity(count);
    for k in 0..count {
        let target = (k as f64 + random.uniform()) / count as f64 * total;
        while index + 1 < triangles.len() && below + crosses[index].norm() <= target {
            below += crosses[index].norm();
            index += 1;
        }
        let (Some([a, b, c]), Some(cross)) = (triangles.get(index), crosses.get(index)) else {
            break;
        };
        let Some(normal) = cross.try_normalize(1e-18) else {
            continue;
        };
        let (root, v) = (random.uniform().sqrt(), random.uniform());
        drawn.push((a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v), normal));
    }
    drawn
}

/// Even directions on the sphere (Fibonacci's spiral), in an order in which the first few are even too.
fn sphere_directions() -> Vec<V3> {
    // No common divisor with the number of directions.
    const STRIDE: usize = 23;
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..DIRECTIONS)
        .map(|i| {
            let i = i * STRIDE % DIRECTIONS;
            let y = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            let radius = (1.0 - y * y).sqrt();
            V3::new(radius * cos, y, radius * sin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::synthetic::cuboid;

    #[test]
    fn an_inner_box_is_dropped_and_normals_point_out() {
        let mut mesh = cuboid(V3::zeros(), V3::new(0.4, 0.2, 0.8));
        mesh.append(cuboid(V3::zeros(), V3::new(0.2, 0.1, 0.4)));
        let sample = sample_outside(&mesh, 4000, 7);
        assert!(sample.points.len() > 2500);
        for (point, normal) in sample.points.iter().zip(&sample.normals) {
            let outer = (0..3).any(|a| (point[a].abs() - [0.2, 0.1, 0.4][a]).abs() < 1e-9);
            assert!(outer && point.dot(normal) > 0.0 && (normal.norm() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn samples_are_uniform_by_area() {
        let sample = sample_outside(&cuboid(V3::zeros(), V3::new(0.4, 0.2, 0.8)), 20000, 1);
        let top = sample.points.iter().filter(|p| p.y > 0.1 - 1e-9).count() as f64;
        let expected = 0.32 / (2.0 * (0.32 + 0.08 + 0.16));
        assert!((top / 20000.0 - expected).abs() < 0.01);
    }

    #[test]
    fn the_seed_decides() {
        let mesh = cuboid(V3::zeros(), V3::new(0.4, 0.2, 0.8));
        assert_eq!(
            sample_outside(&mesh, 100, 3).points,
            sample_outside(&mesh, 100, 3).points
        );
        assert_ne!(
            sample_outside(&mesh, 100, 3).points,
            sample_outside(&mesh, 100, 4).points
        );
    }
}
