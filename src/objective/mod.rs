//! The terms of Eq. 9: which points, pixels and weights go into the problem.

mod call;
mod correspondences;
mod footage;
mod inverse_depth;
mod matcher;
mod options;
mod silhouette;
#[cfg(test)]
mod tests;
mod threads;

pub use call::{Block, Call, CallOutcome, Iteration};
pub use correspondences::{ComparedPoint, Correspondences, KnownInverseDepth, SilhouetteMatches};
pub use footage::Footage;
use matcher::Matcher;
use options::{MOTION_CAUCHY, MOTION_WEIGHT, limit};
pub use options::{ObjectiveOptions, Pairs};

use crate::bridge::ceres::{Observer, PriorCallback, ffi};
use crate::geometry::{Matrix3, Pose, Rotation3};
use crate::init::Estimate;
use crate::prior::ShapePrior;
use crate::sequence::Sequence;
use crate::solver::ObjectiveValue;
use cxx::UniquePtr;
use std::sync::Arc;

/// Why the objective could not be built or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum ObjectiveError {
    /// An option is out of range. The fields are its key and what to give instead.
    #[error("option {0}: {1}")]
    Option(&'static str, &'static str),
    /// A mask holds no pixel of the object. The field is the frame's name.
    #[error("frame {0}: the mask is empty; give a mask in which the object is white")]
    EmptyMask(String),
    /// The estimate does not fit the sequence or the prior.
    #[error("the estimate has {estimate} frames and {style} styles, the problem {frames} and {styles}")]
    Shape {
        /// The poses of the estimate.
        estimate: usize,
        /// The style entries of the estimate.
        style: usize,
        /// The frames of the sequence.
        frames: usize,
        /// The style entries of the prior.
        styles: usize,
    },
    /// The target frame does not exist.
    #[error("the target is frame {target}, but there are {frames}")]
    Target {
        /// The index that was given.
        target: usize,
        /// The frames of the sequence.
        frames: usize,
    },
    /// Ceres or the core threw an exception, for example of a residual that is not finite.
    #[error("the solver cannot go on: {0}")]
    Ceres(#[from] cxx::Exception),
}

/// L of Eq. 9 over a sequence. It holds no estimate and no visibility: both are inputs of every evaluation.
pub struct Objective<'a> {
    problem: UniquePtr<ffi::Problem>,
    sequence: &'a Sequence,
    matcher: Matcher,
    target: usize,
}

/// Which points and pixels Eq. 4 and 6 compare, found at one estimate, and the pyramid level of their colours.
pub struct Visibility {
    input: UniquePtr<ffi::Visibility>,
    /// What points' distances outside the masks weigh.
    silhouette_weights: Vec<f64>,
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
        let matcher = Matcher::new(footage, prior.clone(), options, target, start.alpha, threads);
        let targets = limit(options.silhouette_targets, prior.point_count());
        let problem = ffi::new_problem(
            footage.shared.clone(),
            Box::new(PriorCallback::new(prior, matcher.options.points.max(targets))),
            &terms(sequence, &matcher.options, target, start.alpha),
        )?;
        Ok(Self {
            problem,
            sequence,
            matcher,
            target,
        })
    }

    /// The options in use: what was given, with what the sequence says of itself where nothing was.
    pub fn options(&self) -> &ObjectiveOptions {
        &self.matcher.options
    }

    /// X(s) of the points that Eq. 4, 6 and the second sum of Eq. 5 use: xyz after xyz, object frame.
    pub fn points(&self, estimate: &Estimate) -> Vec<f64> {
        self.matcher.points(&estimate.style)
    }

    /// Which points and pixels Eq. 4 and 6 compare at `estimate`, with colours of pyramid level `level` (0 = finest).
    ///
    /// # Errors
    /// The footage has no such pyramid level.
    pub fn visibility(&self, estimate: &Estimate, level: usize) -> Result<Visibility, ObjectiveError> {
        self.visibility_of(self.matcher.find(&self.sequence.frames, estimate, level))
    }

    /// [`Objective::visibility`] after that of the step before, halfway to which the weights of points outside the masks stay. A point with a
    /// large weight goes inside, where it has a small one and comes out again: without that, steps go to and fro between two shapes.
    ///
    /// # Errors
    /// As [`Objective::visibility`].
    pub fn next_visibility(
        &self,
        estimate: &Estimate,
        level: usize,
        last: &Visibility,
    ) -> Result<Visibility, ObjectiveError> {
        let mut input = self.matcher.find(&self.sequence.frames, estimate, level);
        for (weight, last) in input.silhouette_weights.iter_mut().zip(&last.silhouette_weights) {
            *weight = f64::midpoint(*weight, *last);
        }
        self.visibility_of(input)
    }

    fn visibility_of(&self, input: ffi::VisibilityInput) -> Result<Visibility, ObjectiveError> {
        Ok(Visibility {
            input: ffi::new_visibility(&self.problem, &input)?,
            silhouette_weights: input.silhouette_weights,
        })
    }

    /// The objective L of Eq. 9 and its terms at an estimate.
    ///
    /// # Errors
    /// A point of the shape behind a camera, or a failing prior.
    pub fn evaluate(
        &mut self,
        estimate: &Estimate,
        visibility: &Visibility,
    ) -> Result<ObjectiveValue, ObjectiveError> {
        let variables = self.variables(estimate);
        let threads = self.matcher.threads as u32;
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
        let threads = self.matcher.threads as u32;
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
        let input_unit = self.matcher.input_unit;
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
            log_alpha: (estimate.alpha / self.matcher.input_unit).ln(),
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
            alpha: variables.log_alpha.exp() * self.matcher.input_unit,
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
                .map(|frame| silhouette::share(frame, options, unit_px))
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
