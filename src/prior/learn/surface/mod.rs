//! Models in correspondence through one template mesh: the template is drawn onto each, replaced by the mean of what comes out,
//! and drawn again.

mod points;
mod register;
mod residual;
mod target;

pub use points::draw_points;
pub use residual::{Covariogram, field_scales, residual_covariogram};

use super::farthest::farthest_order;
use super::{LearnError, Progress, TrainingShape, components};
use crate::prior::field::{FieldScale, field_modes};
use crate::prior::mesh::MirroredMesh;
use crate::prior::surface::SurfacePrior;
use nalgebra::Vector3;
use rayon::prelude::*;
use register::Template;
use std::sync::Mutex;
use target::Target;

type V3 = Vector3<f64>;

/// The template is drawn onto all models so many times.
const PASSES: usize = 2;
/// Samples that pull their nearest vertex, for each vertex of the half.
const SAMPLES_PER_VERTEX: usize = 4;

/// Points that the free form's modes are computed at.
const FIELD_NODES: usize = 500;
/// The amplitude of asymmetric modes in units of the symmetric ones'. The models are all made symmetric before they are learned from, so
/// they cannot say; cars are but for a door's dent, an aerial, a steering wheel.
const ASYMMETRY: f64 = 0.2;

/// Models in correspondence: the half's vertices on each.
pub struct Registered {
    /// Per model, the vertices of the half x ≥ 0, object frame.
    pub shapes: Vec<Vec<V3>>,
}

/// Draws the template, a half-mesh with `rest` as its vertices, onto each of `shapes`. `weights` say how much each counts in the mean.
pub fn register_all(
    mesh: &MirroredMesh,
    rest: &[V3],
    shapes: &[TrainingShape],
    weights: &[f64],
    progress: &mut (dyn FnMut(Progress) + Send),
) -> Result<Registered, LearnError> {
    if shapes.len() < 3 {
        return Err(LearnError::TooFewModels(shapes.len()));
    }
    let targets: Vec<Target> = shapes
        .par_iter()
        .map(|shape| Target::new(&shape.outside, SAMPLES_PER_VERTEX * rest.len()))
        .collect();
    let total = PASSES * shapes.len();
    let done = Mutex::new((0, progress));
    let mut rest = rest.to_vec();
    let mut found = Vec::new();
    for _ in 0..PASSES {
        let template = Template::new(mesh, &rest);
        found = targets
            .par_iter()
            .map(|target| {
                let registered = template.register(target);
                if let Ok(mut done) = done.lock() {
                    done.0 += 1;
                    let count = done.0;
                    (done.1)(Progress {
                        stage: "registering",
                        done: count,
                        total,
                    });
                }
                registered
            })
            .collect();
        rest = mean(&found, weights);
    }
    Ok(Registered { shapes: found })
}

fn mean(shapes: &[Vec<V3>], weights: &[f64]) -> Vec<V3> {
    let total: f64 = weights.iter().sum();
    (0..shapes[0].len())
        .map(|i| shapes.iter().zip(weights).map(|(s, w)| s[i] * *w).sum::<V3>() / total)
        .collect()
}

/// What a surface prior is made of besides its models.
#[derive(Clone, Debug)]
pub struct SurfaceOptions {
    /// The number of style entries S.
    pub styles: usize,
    /// N, even: pairs of mirrored points.
    pub points: usize,
    /// Modes of each parity that the free form keeps.
    pub modes: usize,
    /// The free form's covariance.
    pub scales: Vec<FieldScale>,
    /// The seed by which points are drawn on the surface.
    pub seed: u64,
}

/// The prior of `shapes` (half-meshes in correspondence), each counting by its weight, and the share of the variance explained by the
/// first k + 1 styles.
pub fn surface_prior(
    mesh: &MirroredMesh,
    shapes: &[&Vec<V3>],
    weights: &[f64],
    options: &SurfaceOptions,
) -> Result<(SurfacePrior, Vec<f64>), LearnError> {
    let flat: Vec<Vec<f64>> = shapes
        .iter()
        .map(|shape| shape.iter().flat_map(|v| <[f64; 3]>::from(*v)).collect())
        .collect();
    let found = components(&flat, weights, options.styles);
    let vectors =
        |numbers: &[f64]| -> Vec<V3> { numbers.chunks_exact(3).map(V3::from_column_slice).collect() };
    let mean = vectors(&found.mean);
    let nodes: Vec<V3> = farthest_order(&mean, FIELD_NODES)
        .into_iter()
        .map(|i| mean[i])
        .collect();
    let field = field_modes(&mean, &nodes, &options.scales, options.modes);
    let points = draw_points(mesh, &mean, options.points / 2, options.seed);
    let modes = found.modes.iter().flat_map(|mode| vectors(mode)).collect();
    let prior = SurfacePrior::new(mesh.clone(), mean, modes, field, ASYMMETRY, points)?;
    Ok((prior, found.explained))
}
