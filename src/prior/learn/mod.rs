//! Learning a linear prior from CAD models: outside samples, correspondences, principal components.
//!
//! Cars are symmetric, so everything is done on the half x ≥ 0 of each model united with its mirror image, and
//! the points are stored as mirrored pairs.

mod assignment;
mod augment;
mod coarse;
#[cfg(feature = "training")]
mod decoder;
mod farthest;
mod neighbours;
mod principal;
mod register;
mod surface;

pub use augment::augmented;
#[cfg(feature = "training")]
pub use decoder::{DECODER_RATE, DecoderOptions, decoder};
pub(super) use neighbours::tree_of;
pub(super) use principal::components;
pub use surface::{
    Covariogram, Registered, SurfaceOptions, draw_points, field_scales, register_all, residual_covariogram,
    surface_prior,
};

use crate::cad::{Mesh, OutsideSample, sample_outside};
use crate::geometry::{mirror, tangent_plane};
use farthest::{farthest_order, farthest_order_mirrored};
use nalgebra::Vector3;
use rayon::prelude::*;
use register::{Template, carry};

type V3 = Vector3<f64>;

/// What can be chosen; the defaults made the shipped prior.
#[derive(Clone, Debug)]
pub struct LearnOptions {
    /// N, even: pairs of mirrored points.
    pub points: usize,
    /// Points of the coarse correspondences, both halves together.
    pub coarse_points: usize,
    /// Rounds of assignment and averaging.
    pub passes: usize,
}

impl Default for LearnOptions {
    fn default() -> Self {
        Self {
            points: 32768,
            coarse_points: 1024,
            passes: 4,
        }
    }
}

impl LearnOptions {
    /// What can be refused before any work is done.
    pub fn check(&self) -> Result<(), LearnError> {
        let within = |option, value: usize, low: usize, high: usize, range| {
            let fine = (low..=high).contains(&value) && value.is_multiple_of(2);
            if fine {
                Ok(())
            } else {
                Err(LearnError::Option { option, value, range })
            }
        };
        within(
            "points",
            self.points,
            64,
            65536,
            "an even number from 64 to 65536",
        )?;
        within(
            "coarse-points",
            self.coarse_points,
            64,
            8192,
            "an even number from 64 to 8192",
        )?;
        if self.passes == 0 {
            return Err(LearnError::Option {
                option: "passes",
                value: 0,
                range: "1 or more",
            });
        }
        Ok(())
    }
}

/// Area-uniform samples to draw per model, inside ones included.
pub const SAMPLES: usize = 100_000;
/// Registration looks at so many samples a template point; more cost time and change nothing to speak of.
const SAMPLES_PER_POINT: usize = 3;

/// Why nothing could be learned.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// There are fewer than three models. The field is their number.
    #[error("{0} models are too few to learn from: give at least 3")]
    TooFewModels(usize),
    /// An option of learning is out of range.
    #[error("{option} = {value} is out of range: give {range}")]
    Option {
        /// The option as on the command line.
        option: &'static str,
        /// Its value.
        value: usize,
        /// The values that it may have.
        range: &'static str,
    },
    /// A model has too few samples on its outside.
    #[error(
        "model `{model}`: only {found} of its samples lie outside on one half, {needed} are needed: raise the samples or drop the model"
    )]
    TooFewSamples {
        /// The model's name.
        model: String,
        /// The samples that lie outside on one half.
        found: usize,
        /// The samples that are needed.
        needed: usize,
    },
    /// The models do not give as many styles as were asked for.
    #[error("{styles} styles are too many: these shapes give at most {possible}")]
    TooManyStyles {
        /// The styles that were asked for.
        styles: usize,
        /// The styles that the models give.
        possible: usize,
    },
    /// The trained decoder maps all styles to one shape.
    #[error("training left no style to tell shapes by: train longer, or with a lower rate")]
    Collapsed,
    /// What was learned does not make a prior.
    #[error(transparent)]
    Invalid(#[from] super::InvalidPrior),
    /// The library was built without the feature `training`.
    #[error("this build cannot train networks: build it with `cargo build --release --features training`")]
    NoTraining,
    /// Training ended without a network.
    #[cfg(feature = "training")]
    #[error(transparent)]
    Training(#[from] crate::training::TrainingError),
}

/// Models in correspondence: everything the principal components need.
pub struct Correspondences {
    /// One per model: N points, each pair mirrored, xyz after xyz, in farthest-point order of the mean.
    pub shapes: Vec<Vec<f64>>,
    /// N outward unit normals of the mean shape.
    pub normals: Vec<[f32; 3]>,
}

impl Correspondences {
    /// The first `points` points of all shapes, an even sample of them.
    pub fn first(mut self, points: usize) -> Self {
        self.shapes
            .iter_mut()
            .for_each(|shape| shape.truncate(3 * points));
        self.normals.truncate(points);
        self
    }
}

/// A model's outside, both for learning from it and for judging fits to it.
pub struct TrainingShape {
    /// The model's name.
    pub name: String,
    /// Samples on the outside of the model, object frame.
    pub outside: OutsideSample,
}

/// What is being done, for a progress bar: `done` of `total`.
pub struct Progress {
    /// The stage in words.
    pub stage: &'static str,
    /// The steps of this stage that are done.
    pub done: usize,
    /// The steps of this stage.
    pub total: usize,
}

impl TrainingShape {
    /// Samples the outside of `mesh` (object frame) with `samples` draws.
    pub fn new(name: &str, mesh: &Mesh, samples: usize, seed: u64) -> Self {
        Self {
            name: name.to_owned(),
            outside: sample_outside(mesh, samples, seed),
        }
    }
}

/// Puts `shapes` into correspondence (see the module).
pub fn correspond(
    shapes: &[TrainingShape],
    options: &LearnOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<Correspondences, LearnError> {
    if shapes.len() < 3 {
        return Err(LearnError::TooFewModels(shapes.len()));
    }
    options.check()?;
    let (half_count, coarse_count) = (options.points / 2, options.coarse_points / 2);
    let halves: Vec<OutsideSample> = shapes.iter().map(|s| s.outside.symmetrised().half()).collect();
    for (half, shape) in halves.iter().zip(shapes) {
        let needed = half_count.max(coarse_count);
        if half.points.len() < needed {
            return Err(LearnError::TooFewSamples {
                model: shape.name.clone(),
                found: half.points.len(),
                needed,
            });
        }
    }
    let coarse_shapes: Vec<OutsideSample> = halves
        .par_iter()
        .map(|half| half.select(&farthest_order_mirrored(&half.points, coarse_count)))
        .collect();
    let total = options.passes + 2;
    let mut done = 0;
    let coarse = coarse::correspond(&coarse_shapes, options.passes, || {
        done += 1;
        progress(Progress {
            stage: "corresponding",
            done,
            total,
        });
    });
    let coarse_points: Vec<Vec<V3>> = coarse_shapes
        .iter()
        .zip(&coarse.partner)
        .map(|(shape, partner)| partner.iter().map(|&i| shape.points[i]).collect())
        .collect();

    let targets: Vec<OutsideSample> = halves
        .iter()
        .map(|half| thinned(half, SAMPLES_PER_POINT * half_count))
        .collect();
    // First the dense points of the shape nearest to the template, then those of the mean.
    let reference = nearest_to(&coarse.template, &coarse_points);
    let dense = halves[reference].select(&farthest_order_mirrored(&halves[reference].points, half_count));
    let template = Template::new(dense);
    let first: Vec<Vec<V3>> = coarse_points
        .par_iter()
        .zip(&targets)
        .map(|(goal, target)| {
            let start = carry(&template.sample.points, &coarse_points[reference], goal);
            template.register(&start, target)
        })
        .collect();
    progress(Progress {
        stage: "corresponding",
        done: done + 1,
        total,
    });
    let template = mean_template(&first, &template.sample.normals);
    let second: Vec<Vec<V3>> = first
        .par_iter()
        .zip(&targets)
        .map(|(start, target)| template.register(start, target))
        .collect();
    progress(Progress {
        stage: "corresponding",
        done: total,
        total,
    });
    let mean = mean_template(&second, &template.sample.normals).sample;
    Ok(ordered(&mean, &second))
}

/// At most `count` entries at even strides; samples lie in order of their triangles, so these stay even.
fn thinned(sample: &OutsideSample, count: usize) -> OutsideSample {
    let all = sample.points.len();
    let count = count.min(all);
    let indices: Vec<usize> = (0..count).map(|k| k * all / count).collect();
    sample.select(&indices)
}

/// The shape whose corresponded points lie nearest to the template, both box-normalised.
fn nearest_to(template: &[V3], shapes: &[Vec<V3>]) -> usize {
    let cost = |shape: &Vec<V3>| -> f64 {
        let normalised = coarse::box_normalised(shape);
        normalised
            .iter()
            .zip(template)
            .map(|(a, b)| (a - b).norm_squared())
            .sum()
    };
    (0..shapes.len())
        .min_by(|&a, &b| cost(&shapes[a]).total_cmp(&cost(&shapes[b])))
        .unwrap_or(0)
}

/// The mean of corresponded halves, its normals fitted to it and turned like `normals`.
fn mean_template(halves: &[Vec<V3>], normals: &[V3]) -> Template {
    let points: Vec<V3> = (0..normals.len())
        .map(|i| halves.iter().map(|half| half[i]).sum::<V3>() / halves.len() as f64)
        .collect();
    let normals = fitted_normals(&points, normals);
    Template::new(OutsideSample { points, normals })
}

/// The normal of the plane through each point's neighbours that face the same way, blended with the hint.
fn fitted_normals(points: &[V3], hints: &[V3]) -> Vec<V3> {
    const SUPPORT: usize = 12;
    let tree = neighbours::Neighbours::new(
        points
            .iter()
            .zip(hints)
            .map(|(p, n)| neighbours::oriented(p, n, 0.05)),
    );
    points
        .iter()
        .zip(hints)
        .map(|(point, hint)| {
            let near = tree.k_nearest(neighbours::oriented(point, hint, 0.05), SUPPORT);
            let around: Vec<V3> = near.iter().map(|n| points[n.index]).collect();
            let (fitted, _) = tangent_plane(&around);
            let fitted = if fitted.dot(hint) < 0.0 { -fitted } else { fitted };
            (fitted + hint).try_normalize(1e-9).unwrap_or(*hint)
        })
        .collect()
}

/// Mirrored pairs in the mean's farthest-point order.
fn ordered(mean: &OutsideSample, halves: &[Vec<V3>]) -> Correspondences {
    let order = farthest_order(&mean.points, mean.points.len());
    let shapes = halves
        .iter()
        .map(|half| {
            order
                .iter()
                .flat_map(|&i| [half[i], mirror(&half[i])])
                .flat_map(|p| [p.x, p.y, p.z])
                .collect()
        })
        .collect();
    let normals = order
        .iter()
        .flat_map(|&i| [mean.normals[i], mirror(&mean.normals[i])])
        .map(|n| [n.x as f32, n.y as f32, n.z as f32])
        .collect();
    Correspondences { shapes, normals }
}

#[cfg(test)]
mod tests;
