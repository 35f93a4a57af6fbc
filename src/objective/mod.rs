//! The terms of Eq. 9: which points, pixels and weights go into the problem.

mod call;
mod footage;
mod inverse_depth;
mod options;
mod silhouette;
#[cfg(test)]
mod tests;
mod threads;

pub use call::{Block, Call, CallOutcome, Iteration};
pub use footage::Footage;
use inverse_depth::KnownDepths;
use options::{MOTION_CAUCHY, MOTION_WEIGHT, limit};
pub use options::{ObjectiveOptions, Pairs};

use crate::bridge::ceres::{Observer, PriorCallback, ffi};
use crate::geometry::{Matrix3, Pose, Rotation3, Vector3};
use crate::image::Grid;
use crate::init::Estimate;
use crate::prior::ShapePrior;
use crate::sequence::{Frame, Sequence};
use crate::solver::ObjectiveValue;
use crate::visibility::{Neighbourhoods, Surfels, Visibility as Seen, visible_points};
use cxx::UniquePtr;
use std::sync::Arc;

/// Why the objective could not be built or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum ObjectiveError {
    #[error("option {0}: {1}")]
    Option(&'static str, &'static str),
    #[error("frame {0}: the mask is empty; give a mask in which the object is white")]
    EmptyMask(String),
    #[error("the estimate has {estimate} frames and {style} styles, the problem {frames} and {styles}")]
    Shape {
        estimate: usize,
        style: usize,
        frames: usize,
        styles: usize,
    },
    #[error("the target is frame {target}, but there are {frames}")]
    Target { target: usize, frames: usize },
    #[error("the solver cannot go on: {0}")]
    Ceres(#[from] cxx::Exception),
}

/// L of Eq. 9 over a sequence. It holds no estimate and no visibility: both are inputs of every evaluation.
pub struct Objective<'a> {
    problem: UniquePtr<ffi::Problem>,
    sequence: &'a Sequence,
    /// One per frame.
    depths: Arc<[KnownDepths]>,
    outside_px: Arc<[Grid<u8>]>,
    prior: Arc<dyn ShapePrior>,
    /// Of the points that are looked at, in the prior's mean shape.
    neighbourhoods: Neighbourhoods,
    options: ObjectiveOptions,
    target: usize,
    threads: usize,
    /// The frames that Eq. 4 compares.
    pairs: Vec<(usize, usize)>,
    /// α at construction: inverse depths are compared in units in which α starts at 1, so that λ2 and δ2 mean
    /// the same whatever the unit of the off-the-shelf reconstruction.
    input_unit: f64,
}

/// Which points and pixels Eq. 4 and 6 compare, found at one estimate, and the pyramid level of their colours.
pub struct Visibility {
    input: UniquePtr<ffi::Visibility>,
}

impl<'a> Objective<'a> {
    /// The objective over the frames of `footage`, of which `target` is the paper's target frame. `start` is where the solver
    /// begins: its α is the unit in which inverse depths are compared. `threads` change no byte of any result.
    ///
    /// # Errors
    /// Options out of range, an estimate that does not fit the sequence and the prior, no such target.
    pub fn new(
        footage: &Footage<'a>,
        prior: Arc<dyn ShapePrior>,
        options: &ObjectiveOptions,
        target: usize,
        start: &Estimate,
        threads: usize,
    ) -> Result<Self, ObjectiveError> {
        options
            .check()
            .map_err(|(name, why)| ObjectiveError::Option(name, why))?;
        let sequence = footage.sequence();
        let frames = sequence.frames.len();
        if start.frame_count() != frames || start.style.len() != prior.style_len() {
            return Err(ObjectiveError::Shape {
                estimate: start.frame_count(),
                style: start.style.len(),
                frames,
                styles: prior.style_len(),
            });
        }
        if target >= frames {
            return Err(ObjectiveError::Target { target, frames });
        }
        let points = limit(options.points, prior.point_count());
        let targets = limit(options.silhouette_targets, prior.point_count());
        let options = ObjectiveOptions {
            points,
            motion_deviation: options.motion_deviation.or(sequence.motion_deviation),
            focal_deviation: options.focal_deviation.or(sequence.focal_deviation),
            ..options.clone()
        };
        let problem = ffi::new_problem(
            footage.shared.clone(),
            Box::new(PriorCallback::new(prior.clone(), points.max(targets))),
            &terms(sequence, &options, target, start.alpha),
        )?;
        let mut mean = vec![0.0; 3 * options.points];
        prior.points(&vec![0.0; prior.style_len()], &mut mean);
        Ok(Self {
            problem,
            sequence,
            depths: footage.depths.clone(),
            outside_px: footage.outside_px.clone(),
            neighbourhoods: Neighbourhoods::of(&mean),
            prior,
            pairs: options.pairs.of(frames, target),
            options,
            target,
            threads,
            input_unit: start.alpha,
        })
    }

    /// X(s) of the points that Eq. 4, 6 and the second sum of Eq. 5 use: xyz after xyz, object frame.
    pub fn points(&self, estimate: &Estimate) -> Vec<f64> {
        let mut points = vec![0.0; 3 * self.options.points];
        self.prior.points(&estimate.style, &mut points);
        points
    }

    /// Which points and pixels Eq. 4 and 6 compare at `estimate`, with colours of pyramid level `level` (0 = finest).
    ///
    /// # Errors
    /// No such level.
    pub fn visibility(&self, estimate: &Estimate, level: usize) -> Result<Visibility, ObjectiveError> {
        let points = self.points(estimate);
        let surfels = Surfels::among(&self.neighbourhoods, &points);
        let frames = &self.sequence.frames;
        let photometric = self.options.photometric_weight > 0.0;
        let (known_depths, input_unit) = (&self.depths, self.input_unit);
        let seen = threads::map(frames.len(), self.threads, |l| {
            let (frame, pose) = (&frames[l], &estimate.camera_from_object[l]);
            let camera = estimate.camera(&frame.camera);
            let seen = visible_points(&points, &camera, pose, frame.image.size(), Some(&surfels));
            let inside = if photometric {
                inside_mask(&seen, frame)
            } else {
                Vec::new()
            };
            let depths = known_depths[l].seen(l, &seen, input_unit);
            (seen, inside, depths)
        });
        let mut input = ffi::VisibilityInput {
            level: level as u32,
            pairs: Vec::new(),
            comparisons: Vec::new(),
            depths: Vec::new(),
            silhouette_weights: self.silhouette_weights(&points, estimate),
        };
        if photometric {
            let weight = 1.0 / self.pairs.len().max(1) as f64;
            for (pair, &(a, b)) in (0u32..).zip(&self.pairs) {
                input.pairs.push(ffi::FramePair {
                    a: a as u32,
                    b: b as u32,
                    weight,
                });
                let compared = photometric_points(
                    [&seen[a].0, &seen[b].0],
                    [&seen[a].1, &seen[b].1],
                    self.options.covisible,
                );
                input
                    .comparisons
                    .extend(compared.map(|(point, directions)| ffi::Comparison {
                        point,
                        pair,
                        directions,
                    }));
            }
        }
        for (_, _, depths) in seen {
            input.depths.extend(depths);
        }
        Ok(Visibility {
            input: ffi::new_visibility(&self.problem, &input)?,
        })
    }

    /// What each point's distances outside the masks weigh: more, the more frames agree that it is outside. A mask that leaks is alone in what it
    /// shows, and so is one that lacks a part; the robust loss of [`ObjectiveOptions::silhouette_cauchy`] cannot tell them from a shape that is wrong.
    fn silhouette_weights(&self, points: &[f64], estimate: &Estimate) -> Vec<f64> {
        let agreed = self.options.silhouette_agreement;
        if self.options.silhouette_weight == 0.0 || agreed == 0.0 {
            return Vec::new();
        }
        let frames = &self.sequence.frames;
        let unit_px = silhouette::unit_px(frames, self.options.silhouette_size);
        let outside_px = &self.outside_px;
        let used = limit(self.options.silhouette_points, self.options.points);
        let points: Vec<_> = points[..3 * used]
            .chunks_exact(3)
            .map(Vector3::from_column_slice)
            .collect();
        let outside = threads::map(frames.len(), self.threads, |l| {
            let (camera, pose) = (
                estimate.camera(&frames[l].camera),
                &estimate.camera_from_object[l],
            );
            silhouette::outside(&outside_px[l], &camera, pose, &points, unit_px)
        });
        (0..used)
            .map(|j| 1.0 + agreed * silhouette::agreement(outside.iter().filter_map(|frame| frame[j])))
            .collect()
    }

    /// L and its terms.
    ///
    /// # Errors
    /// A point of the shape behind a camera, or a failing prior.
    pub fn evaluate(
        &mut self,
        estimate: &Estimate,
        visibility: &Visibility,
    ) -> Result<ObjectiveValue, ObjectiveError> {
        let variables = self.variables(estimate);
        let threads = self.threads as u32;
        let costs = self
            .problem
            .pin_mut()
            .evaluate(&variables, &visibility.input, threads)?;
        Ok(costs.into())
    }

    /// The gradient, and the Gauss–Newton matrix row by row, over [ω_l; t_l] for each frame (a twist about the current pose),
    /// s, log α and the logarithm of the focal factor: 6 L + S + 2 entries and their square.
    ///
    /// # Errors
    /// As [`Objective::evaluate`].
    pub fn differentiate(
        &mut self,
        estimate: &Estimate,
        visibility: &Visibility,
    ) -> Result<(Vec<f64>, Vec<f64>), ObjectiveError> {
        let variables = self.variables(estimate);
        let threads = self.threads as u32;
        let found = self
            .problem
            .pin_mut()
            .differentiate(&variables, &visibility.input, threads)?;
        Ok((found.gradient, found.normal_matrix))
    }

    /// One Ceres call from `estimate`, which becomes the best state found, whatever ended the call. The observer sees
    /// every iteration and stops it by returning false.
    ///
    /// # Errors
    /// As [`Objective::evaluate`] at the start; options that Ceres cannot use.
    pub fn minimise(
        &mut self,
        estimate: &mut Estimate,
        visibility: &Visibility,
        call: &Call,
        observer: &mut dyn FnMut(&Iteration) -> bool,
    ) -> Result<CallOutcome, ObjectiveError> {
        let input_unit = self.input_unit;
        let mut on_iteration = |iteration: &ffi::Iteration| observer(&Iteration::new(iteration, input_unit));
        let mut variables = self.variables(estimate);
        let options = call.options(self);
        let summary = self.problem.pin_mut().minimise(
            &mut variables,
            &visibility.input,
            &options,
            &mut Observer::new(&mut on_iteration),
        )?;
        *estimate = self.estimate(&variables);
        Ok(summary.into())
    }

    fn variables(&self, estimate: &Estimate) -> ffi::Variables {
        let poses = estimate.camera_from_object.iter().map(|pose| {
            let mut rotation = [0.0; 9];
            rotation.copy_from_slice(pose.rotation.matrix().transpose().as_slice());
            ffi::Pose {
                rotation,
                translation: pose.translation.into(),
            }
        });
        ffi::Variables {
            camera_from_object: poses.collect(),
            style: estimate.style.clone(),
            log_alpha: (estimate.alpha / self.input_unit).ln(),
            log_focal: estimate.focal_factor.ln(),
        }
    }

    fn estimate(&self, variables: &ffi::Variables) -> Estimate {
        let poses = variables.camera_from_object.iter().map(|pose| {
            let mut rotation =
                Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(pose.rotation.as_slice()));
            // Products of rotations drift from being one.
            rotation.renormalize();
            Pose {
                rotation,
                translation: pose.translation.into(),
            }
        });
        Estimate {
            camera_from_object: poses.collect(),
            style: variables.style.clone(),
            alpha: variables.log_alpha.exp() * self.input_unit,
            focal_factor: variables.log_focal.exp(),
        }
    }
}

/// The terms with their weights, for a solver that starts at `alpha`.
fn terms(sequence: &Sequence, options: &ObjectiveOptions, target: usize, alpha: f64) -> ffi::Terms {
    let frames = sequence.frames.len();
    let held = options.motion_deviation.filter(|&deviation| deviation > 0.0);
    let pairs = options.pairs.of(frames, target);
    let share_of_pair = (frames - 1) as f64 / pairs.len() as f64;
    let unit_px = silhouette::unit_px(&sequence.frames, options.silhouette_size);
    ffi::Terms {
        photometric: ffi::PhotometricTerm {
            weight: options.photometric_weight_of_all(frames) * options.point_weight,
            huber_width: options.photometric_huber,
        },
        silhouette: ffi::SilhouetteTerm {
            weight: options.silhouette_weight / (unit_px * unit_px),
            cauchy_width: options.silhouette_cauchy * unit_px,
            tolerance: options.silhouette_tolerance * unit_px,
            frames: sequence
                .frames
                .iter()
                .map(|frame| silhouette::share(frame, options))
                .collect(),
        },
        inverse_depth: ffi::InverseDepthTerm {
            weight: options.inverse_depth_weight * options.point_weight,
            huber_width: options.inverse_depth_huber,
        },
        style: ffi::StyleTerm {
            weight: options.style_weight,
        },
        motion: ffi::MotionTerm {
            weight: held.map_or(0.0, |deviation| share_of_pair * MOTION_WEIGHT / deviation.powi(2)),
            cauchy_width: MOTION_CAUCHY * held.unwrap_or(1.0),
            motions: known_motions(sequence, &pairs, alpha),
        },
        focal: ffi::FocalTerm {
            deviation: options.focal_deviation.unwrap_or(0.0),
        },
        weak_perspective: options.weak_perspective,
    }
}

/// Of the pairs that are compared, where the off-the-shelf reconstruction holds both frames.
fn known_motions(sequence: &Sequence, pairs: &[(usize, usize)], input_unit: f64) -> Vec<ffi::KnownMotion> {
    let frames = &sequence.frames;
    pairs
        .iter()
        .filter_map(|&(a, b)| {
            let b_from_input = frames[b].camera_from_input?;
            let b_from_a = b_from_input.after(&frames[a].camera_from_input?.inverse());
            let mut rotation = [0.0; 9];
            rotation.copy_from_slice(b_from_a.rotation.matrix().transpose().as_slice());
            Some(ffi::KnownMotion {
                a: a as u32,
                b: b as u32,
                rotation,
                translation: (input_unit * b_from_a.translation).into(),
            })
        })
        .collect()
}

/// Per point: does it project into the frame's mask?
fn inside_mask(seen: &Seen, frame: &Frame) -> Vec<bool> {
    let cells = seen.cells.iter();
    cells
        .map(|cell| cell.is_some_and(|cell| frame.mask.data()[cell as usize]))
        .collect()
}

/// The points of Eq. 4 for one pair of frames, each with how many of the two sums it is in. Of both frames: what each
/// sees, and which points lie inside its mask. A point outside either mask is left out; so is, if
/// `covisible`, one that either does not see.
fn photometric_points(
    visible: [&Seen; 2],
    inside: [&[bool]; 2],
    covisible: bool,
) -> impl Iterator<Item = (u32, u8)> + use<> {
    let mut directions = vec![0u8; inside[0].len()];
    for point in visible.iter().flat_map(|v| &v.points) {
        let j = point.point as usize;
        let kept =
            inside.iter().all(|inside| inside[j]) && (!covisible || visible.iter().all(|v| v.unoccluded[j]));
        directions[j] += u8::from(kept);
    }
    (0u32..).zip(directions).filter(|&(_, d)| d > 0)
}
