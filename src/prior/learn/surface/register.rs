//! Non-rigid registration of a template mesh to a shape, coarse to fine: the box, then smooth fields of falling length, then each
//! vertex, held by its neighbours.
//!
//! The last stage minimises Σ w ((n · (x_i − p))² + τ |x_i − p|²) + λ Σ |d_i − d_j|² + μ Σ |Δd_i|², d being the displacement from
//! where the smooth fields put the template; λ and μ fall while pulls (p, n, w) are renewed.

use super::target::{Pull, Reach, Target};
use crate::prior::field::{FieldModes, FieldScale, field_modes};
use crate::prior::learn::farthest::farthest_order;
use crate::prior::mesh::{MirroredMesh, turned_over};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

type V3 = Vector3<f64>;

/// Lengths of the smooth fields, in diagonals, and rounds with each.
const LENGTHS: [f64; 3] = [0.4, 0.2, 0.1];
const SMOOTH_ROUNDS: usize = 12;
/// Points that smooth fields are made of.
const NODES: usize = 200;
/// Modes of a smooth field, of each parity.
const MODES: usize = 120;
/// Weight of the squared coefficients of a field of unit amplitude, for each vertex.
const SMOOTH_RIDGE: f64 = 2e-4;
/// Reach and the weight of normals fall from the first to the last in the smooth stages.
const SMOOTH_REACH: [f64; 2] = [0.12, 0.05];
const SMOOTH_NORMAL_WEIGHT: [f64; 2] = [0.25, 0.12];
/// The last stage's rounds and what falls in them: λ, μ and the reach.
const ROUNDS: usize = 30;
const STIFFNESS: [f64; 2] = [10.0, 0.07];
const BENDING: [f64; 2] = [20.0, 0.5];
const REACH: [f64; 2] = [0.05, 0.03];
const NORMAL_WEIGHT: f64 = 0.08;
/// τ: how hard a pull holds along the surface.
const TANGENTIAL: f64 = 0.1;
/// Where faces turned over, the displacement is smoothed, so many times before looking again, and so often at most.
const SMOOTHINGS: usize = 5;
const SMOOTHING: f64 = 0.7;
const UNFOLDING_ROUNDS: usize = 12;
const CONJUGATE_GRADIENT_STEPS: usize = 60;
const MIN_EXTENT: f64 = 1e-3;

/// A template made ready for many shapes.
pub struct Template<'a> {
    mesh: &'a MirroredMesh,
    rest: &'a [V3],
    fields: Vec<FieldModes>,
    laplacian: Laplacian,
}

impl<'a> Template<'a> {
    /// `rest` are the half's vertices.
    pub fn new(mesh: &'a MirroredMesh, rest: &'a [V3]) -> Self {
        let nodes: Vec<V3> = farthest_order(rest, NODES).into_iter().map(|i| rest[i]).collect();
        let fields = LENGTHS
            .iter()
            .map(|&length| {
                let scale = FieldScale {
                    amplitude: 1.0,
                    length,
                };
                field_modes(rest, &nodes, &[scale], MODES)
            })
            .collect();
        Self {
            mesh,
            rest,
            fields,
            laplacian: Laplacian::new(mesh),
        }
    }

    /// Where the half's vertices lie on `target`.
    pub fn register(&self, target: &Target) -> Vec<V3> {
        let stretched = self.stretched_to(target);
        let mut current = stretched.clone();
        for (stage, field) in self.fields.iter().enumerate() {
            let start = current.clone();
            let stages = self.fields.len() as f64 - 1.0;
            let normal_weight = falling(SMOOTH_NORMAL_WEIGHT, stage as f64 / stages.max(1.0));
            let samples = target.tree(normal_weight);
            for round in 0..SMOOTH_ROUNDS {
                let progress =
                    (stage * SMOOTH_ROUNDS + round) as f64 / (self.fields.len() * SMOOTH_ROUNDS - 1) as f64;
                let reach = Reach {
                    normal_weight,
                    distance: falling(SMOOTH_REACH, progress),
                };
                let normals = self.mesh.half_normals(&current);
                let pulls = target.pulls(&current, &normals, &samples, reach);
                current = moved_smoothly(&start, field, &pulls);
            }
        }
        self.fine(&stretched, current, target)
    }

    /// Scales each axis so that the template's box is the target's.
    fn stretched_to(&self, target: &Target) -> Vec<V3> {
        let extent = |points: &[V3]| {
            let (mut low, mut high) = (V3::repeat(f64::INFINITY), V3::repeat(f64::NEG_INFINITY));
            for axis in 0..3 {
                let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
                along.sort_unstable_by(f64::total_cmp);
                let beyond = along.len() / 100;
                if let (Some(&first), Some(&last)) = (along.get(beyond), along.iter().nth_back(beyond)) {
                    (low[axis], high[axis]) = (first, last);
                }
            }
            low.x = -high.x;
            (low, high)
        };
        let (from_low, from_high) = extent(self.rest);
        let (to_low, to_high) = extent(target.points());
        let size = (from_high - from_low).sup(&V3::repeat(MIN_EXTENT));
        let scale = (to_high - to_low).component_div(&size);
        self.rest
            .iter()
            .map(|v| (v - from_low).component_mul(&scale) + to_low)
            .collect()
    }

    /// The last stage.
    fn fine(&self, stretched: &[V3], start: Vec<V3>, target: &Target) -> Vec<V3> {
        let samples = target.tree(NORMAL_WEIGHT);
        let mut displacement = vec![V3::zeros(); start.len()];
        let mut current = start.clone();
        for round in 0..ROUNDS {
            let progress = round as f64 / (ROUNDS - 1) as f64;
            let reach = Reach {
                normal_weight: NORMAL_WEIGHT,
                distance: falling(REACH, progress),
            };
            let normals = self.mesh.half_normals(&current);
            let pulls = target.pulls(&current, &normals, &samples, reach);
            self.system(&start, &pulls, progress).solve(&mut displacement);
            current = self.moved(&start, &displacement);
        }
        self.unfold(stretched, current)
    }

    fn moved(&self, start: &[V3], displacement: &[V3]) -> Vec<V3> {
        let moved = start.iter().zip(displacement).map(|(s, d)| s + d);
        moved.map(|v| V3::new(v.x.max(0.0), v.y, v.z)).collect()
    }

    /// Smooths the displacement from `stretched` around faces that lie the wrong way, in growing rings, until none does.
    fn unfold(&self, stretched: &[V3], mut current: Vec<V3>) -> Vec<V3> {
        let mut near = vec![false; stretched.len()];
        for _ in 0..UNFOLDING_ROUNDS {
            let wrong = turned_over(self.mesh, stretched, &current);
            if !wrong.contains(&true) {
                break;
            }
            for (face, _) in self
                .mesh
                .half_faces()
                .iter()
                .zip(&wrong)
                .filter(|(_, wrong)| **wrong)
            {
                face.iter().for_each(|&v| near[v as usize] = true);
            }
            let before = near.clone();
            for &([a, b], _) in &self.laplacian.edges {
                near[a] |= before[b];
                near[b] |= before[a];
            }
            let mut displacement: Vec<V3> = current.iter().zip(stretched).map(|(c, s)| c - s).collect();
            for _ in 0..SMOOTHINGS {
                let pulls = self.laplacian.apply(&displacement);
                let held = pulls.iter().zip(&self.laplacian.degree).zip(&near).enumerate();
                for (vertex, ((pull, degree), _)) in held.filter(|(_, (_, near))| **near) {
                    displacement[vertex] -= pull * (SMOOTHING / degree);
                }
            }
            current = self.moved(stretched, &displacement);
        }
        current
    }

    fn system(&self, start: &[V3], pulls: &[Pull], progress: f64) -> System<'_> {
        let mut data = vec![Matrix3::zeros(); start.len()];
        let mut right = vec![V3::zeros(); start.len()];
        for pull in pulls {
            let form =
                (pull.normal * pull.normal.transpose() + Matrix3::identity() * TANGENTIAL) * pull.weight;
            data[pull.vertex] += form;
            right[pull.vertex] += form * (pull.place - start[pull.vertex]);
        }
        System {
            laplacian: &self.laplacian,
            mesh: self.mesh,
            data,
            right,
            stiffness: falling(STIFFNESS, progress),
            bending: falling(BENDING, progress),
        }
    }
}

fn falling([first, last]: [f64; 2], progress: f64) -> f64 {
    first * (last / first).powf(progress)
}

/// `start` moved by the field that `pulls` ask for.
fn moved_smoothly(start: &[V3], field: &FieldModes, pulls: &[Pull]) -> Vec<V3> {
    let mut weights = DVector::zeros(start.len());
    let mut sums = DMatrix::zeros(start.len(), 3);
    for pull in pulls {
        weights[pull.vertex] += pull.weight;
        let wanted = (pull.place - start[pull.vertex]) * pull.weight;
        for axis in 0..3 {
            sums[(pull.vertex, axis)] += wanted[axis];
        }
    }
    let moved: Vec<DVector<f64>> = [&field.odd, &field.even, &field.even]
        .into_iter()
        .enumerate()
        .map(|(axis, modes)| {
            let mut weighted = modes.clone();
            for (mut row, weight) in weighted.row_iter_mut().zip(&weights) {
                row *= *weight;
            }
            let mut normal = modes.tr_mul(&weighted);
            for k in 0..normal.nrows() {
                normal[(k, k)] += SMOOTH_RIDGE * start.len() as f64;
            }
            let right = modes.tr_mul(&sums.column(axis));
            let solved = normal.cholesky().map(|c| c.solve(&right));
            solved.map_or_else(|| DVector::zeros(start.len()), |c| modes * c)
        })
        .collect();
    start
        .iter()
        .enumerate()
        .map(|(i, v)| v + V3::new(moved[0][i], moved[1][i], moved[2][i]))
        .collect()
}

/// Neighbours on the half, as if its mirror image were there.
struct Laplacian {
    /// Two vertices and a weight: ½ along the seam, whose edges both halves share.
    edges: Vec<([usize; 2], f64)>,
    degree: Vec<f64>,
}

impl Laplacian {
    fn new(mesh: &MirroredMesh) -> Self {
        let mut degree = vec![0.0; mesh.half_len()];
        let edges = mesh
            .half_edges()
            .into_iter()
            .map(|[a, b]| {
                let weight = if mesh.on_seam(a) && mesh.on_seam(b) {
                    0.5
                } else {
                    1.0
                };
                degree[a] += weight;
                degree[b] += weight;
                ([a, b], weight)
            })
            .collect();
        Self { edges, degree }
    }

    fn apply(&self, x: &[V3]) -> Vec<V3> {
        let mut y = vec![V3::zeros(); x.len()];
        for &([a, b], weight) in &self.edges {
            let pull = (x[a] - x[b]) * weight;
            y[a] += pull;
            y[b] -= pull;
        }
        y
    }
}

struct System<'a> {
    laplacian: &'a Laplacian,
    mesh: &'a MirroredMesh,
    data: Vec<Matrix3<f64>>,
    right: Vec<V3>,
    stiffness: f64,
    bending: f64,
}

impl System<'_> {
    fn apply(&self, x: &[V3]) -> Vec<V3> {
        let once = self.laplacian.apply(x);
        let scaled: Vec<V3> = once
            .iter()
            .zip(&self.laplacian.degree)
            .map(|(y, d)| y / *d)
            .collect();
        let twice = self.laplacian.apply(&scaled);
        let mut out: Vec<V3> = (0..x.len())
            .map(|i| self.data[i] * x[i] + once[i] * self.stiffness + twice[i] * self.bending)
            .collect();
        self.pin(&mut out);
        out
    }

    /// The seam stays on the plane of symmetry.
    fn pin(&self, x: &mut [V3]) {
        for (vertex, x) in x.iter_mut().enumerate() {
            if self.mesh.on_seam(vertex) {
                x.x = 0.0;
            }
        }
    }

    /// Conjugate gradients from `solution` on, scaled by the diagonal.
    fn solve(&self, solution: &mut [V3]) {
        let dot = |a: &[V3], b: &[V3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(b)).sum() };
        let inverse: Vec<V3> = self
            .data
            .iter()
            .zip(&self.laplacian.degree)
            .map(|(data, degree)| {
                let held = self.stiffness * degree + self.bending * (degree + 1.0);
                data.diagonal().map(|d| 1.0 / (d + held))
            })
            .collect();
        let applied = self.apply(solution);
        let mut residual: Vec<V3> = self.right.iter().zip(&applied).map(|(r, a)| r - a).collect();
        self.pin(&mut residual);
        let scaled = |residual: &[V3]| -> Vec<V3> {
            residual
                .iter()
                .zip(&inverse)
                .map(|(r, i)| r.component_mul(i))
                .collect()
        };
        let mut preconditioned = scaled(&residual);
        let mut direction = preconditioned.clone();
        let mut product = dot(&residual, &preconditioned);
        for _ in 0..CONJUGATE_GRADIENT_STEPS {
            if product < 1e-18 {
                break;
            }
            let applied = self.apply(&direction);
            let step = product / dot(&direction, &applied);
            for i in 0..residual.len() {
                solution[i] += direction[i] * step;
                residual[i] -= applied[i] * step;
            }
            preconditioned = scaled(&residual);
            let next = dot(&residual, &preconditioned);
            for (d, p) in direction.iter_mut().zip(&preconditioned) {
                *d = p + *d * (next / product);
            }
            product = next;
        }
    }
}
