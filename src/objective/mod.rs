//! The terms of Eq. 9: which points, pixels and weights go into the problem.

mod call;
mod inverse_depth;
mod options;
mod silhouette;
#[cfg(test)]
mod tests;

pub use call::{Block, Call, CallOutcome, Iteration};
pub use options::ObjectiveOptions;
use options::{MOTION_CAUCHY, MOTION_WEIGHT, limit};

use crate::bridge::ceres::{Observer, PriorCallback, ffi};
use crate::geometry::{Pinhole, Pose, RelativePose, Vector3};
use crate::image::{RgbImage, pyramid};
use crate::init::Estimate;
use crate::prior::ShapePrior;
use crate::sequence::{Frame, Sequence};
use crate::solver::ObjectiveValue;
use crate::visibility::{Surfels, Visibility, visible_points};
use cxx::UniquePtr;
use nalgebra::Vector6;
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
    #[error("the solver cannot go on: {0}")]
    Ceres(#[from] cxx::Exception),
}

/// L of Eq. 9 over a sequence: the Ceres problem and the current estimate in it.
///
/// Visibility is an input of one solver call; [`Objective::update_visibility`] renews it between calls.
pub struct Objective<'a> {
    problem: UniquePtr<ffi::Problem>,
    sequence: &'a Sequence,
    prior: Arc<dyn ShapePrior>,
    options: ObjectiveOptions,
    /// Per frame, finest first.
    pyramids: Vec<Vec<RgbImage>>,
    /// α at construction: inverse depths are compared in units in which α starts at 1, so that λ2 and δ2 mean
    /// the same whatever the unit of the off-the-shelf reconstruction.
    input_unit: f64,
}

impl<'a> Objective<'a> {
    /// The objective at `estimate`, its images at the finest of `levels` pyramid levels.
    ///
    /// # Errors
    /// Options out of range, an empty mask, an estimate that does not fit the sequence and the prior.
    pub fn new(
        sequence: &'a Sequence,
        prior: Arc<dyn ShapePrior>,
        options: &ObjectiveOptions,
        levels: usize,
        estimate: &Estimate,
    ) -> Result<Self, ObjectiveError> {
        options
            .check()
            .map_err(|(name, why)| ObjectiveError::Option(name, why))?;
        let frames = sequence.frames.len();
        if estimate.frame_count() != frames || estimate.style.len() != prior.style_len() {
            return Err(ObjectiveError::Shape {
                estimate: estimate.frame_count(),
                style: estimate.style.len(),
                frames,
                styles: prior.style_len(),
            });
        }
        let points = limit(options.points, prior.point_count());
        let held = options
            .motion_deviation
            .or(sequence.motion_deviation)
            .filter(|&deviation| deviation > 0.0);
        let unit_px = silhouette::unit_px(&sequence.frames, options.silhouette_size);
        let problem = ffi::new_problem(
            &ffi::ProblemOptions {
                frames,
                points: prior.point_count(),
                style: prior.style_len(),
                photometric_weight: options.photometric_weight_a_frame(frames) * options.point_weight,
                photometric_huber: options.photometric_huber,
                silhouette_weight: options.silhouette_weight / (unit_px * unit_px),
                silhouette_cauchy: options.silhouette_cauchy * unit_px,
                silhouette_tolerance: options.silhouette_tolerance * unit_px,
                inverse_depth_weight: options.inverse_depth_weight * options.point_weight,
                inverse_depth_huber: options.inverse_depth_huber,
                style_weight: options.style_weight,
                style_reach: options.style_reach * (prior.style_len() as f64).sqrt(),
                motion_weight: held.map_or(0.0, |deviation| MOTION_WEIGHT / deviation.powi(2)),
                motion_cauchy: MOTION_CAUCHY * held.unwrap_or(1.0),
                weak_perspective: options.weak_perspective,
            },
            Box::new(PriorCallback::new(prior.clone())),
        )?;
        let mut objective = Self {
            problem,
            sequence,
            prior,
            options: ObjectiveOptions {
                points,
                ..options.clone()
            },
            pyramids: sequence
                .frames
                .iter()
                .map(|f| pyramid(f.image.clone(), levels))
                .collect(),
            input_unit: estimate.alpha,
        };
        for (l, frame) in sequence.frames.iter().enumerate() {
            objective
                .problem
                .pin_mut()
                .set_camera(l, &camera(&frame.camera))?;
            if options.silhouette_weight > 0.0 {
                silhouette::add(objective.problem.pin_mut(), l, frame, &objective.options)?;
            }
        }
        if held.is_some() {
            objective.hold_motion()?;
        }
        objective.set_level(0)?;
        objective.set_estimate(estimate)?;
        objective.update_visibility()?;
        Ok(objective)
    }

    /// Source frames with off-the-shelf poses, to those relative to the target's.
    fn hold_motion(&mut self) -> Result<(), ObjectiveError> {
        let mut frames = self.sequence.frames.iter().enumerate();
        let Some(target_from_input) = frames.next().and_then(|(_, frame)| frame.camera_from_input) else {
            return Ok(());
        };
        for (l, source_from_input) in frames.filter_map(|(l, frame)| Some((l, frame.camera_from_input?))) {
            let source_from_target = source_from_input.after(&target_from_input.inverse());
            let mut motion = ffi::InputMotion {
                rotation: [0.0; 9],
                translation: (self.input_unit * source_from_target.translation).into(),
            };
            motion
                .rotation
                .copy_from_slice(source_from_target.rotation.matrix().transpose().as_slice());
            self.problem.pin_mut().set_motion(l, &motion)?;
        }
        Ok(())
    }

    /// Samples the images at pyramid level `level` (0 = finest) from now on.
    pub fn set_level(&mut self, level: usize) -> Result<(), ObjectiveError> {
        for (l, frame) in self.sequence.frames.iter().enumerate() {
            let Some(image) = self.pyramids[l].get(level) else {
                continue;
            };
            let scale = 0.5f64.powi(level as i32);
            self.problem.pin_mut().set_image(
                l,
                image.width() as u32,
                image.height() as u32,
                image.data().as_flattened(),
                &camera(&frame.camera.scaled(scale, scale)),
            )?;
        }
        Ok(())
    }

    /// Moves to `estimate`; visibility stays as it was.
    pub fn set_estimate(&mut self, estimate: &Estimate) -> Result<(), ObjectiveError> {
        let motion: Vec<f64> = estimate
            .motion
            .iter()
            .flat_map(|m| m.0.to_twist().iter().copied().collect::<Vec<_>>())
            .collect();
        self.problem.pin_mut().set_variables(
            estimate.target_from_object.to_twist().as_slice(),
            &motion,
            &estimate.style,
        )?;
        self.set_alpha(estimate.alpha)
    }

    /// Where the solver stands.
    pub fn estimate(&self) -> Result<Estimate, ObjectiveError> {
        let mut target = [0.0; 6];
        let mut motion = vec![0.0; 6 * (self.sequence.frames.len() - 1)];
        let mut style = vec![0.0; self.prior.style_len()];
        self.problem.get_variables(&mut target, &mut motion, &mut style)?;
        Ok(Estimate {
            target_from_object: Pose::from_twist(&Vector6::from(target)),
            motion: motion
                .chunks_exact(6)
                .map(|twist| RelativePose(Pose::from_twist(&Vector6::from_column_slice(twist))))
                .collect(),
            style,
            alpha: self.problem.alpha() * self.input_unit,
        })
    }

    /// α of Eq. 6, x_cam = α x'_cam.
    pub fn set_alpha(&mut self, alpha: f64) -> Result<(), ObjectiveError> {
        Ok(self.problem.pin_mut().set_alpha(alpha / self.input_unit)?)
    }

    /// X(s) at the current style: xyz after xyz, object frame.
    pub fn points(&self) -> Result<Vec<f64>, ObjectiveError> {
        let mut points = vec![0.0; 3 * self.options.points];
        self.prior.points(&self.estimate()?.style, &mut points);
        Ok(points)
    }

    /// Renews which points and pixels Eq. 4 and 6 compare, from the current estimate.
    pub fn update_visibility(&mut self) -> Result<(), ObjectiveError> {
        let estimate = self.estimate()?;
        let points = self.points()?;
        let surfels = Surfels::new(&points);
        let poses: Vec<Pose> = (0..estimate.frame_count())
            .map(|l| estimate.camera_from_object(l))
            .collect();
        let visible: Vec<Visibility> = self
            .sequence
            .frames
            .iter()
            .zip(&poses)
            .map(|(frame, pose)| {
                visible_points(&points, &frame.camera, pose, frame.image.size(), Some(&surfels))
            })
            .collect();
        let inside: Vec<Vec<bool>> = self
            .sequence
            .frames
            .iter()
            .zip(&poses)
            .map(|(frame, pose)| inside_mask(&points, frame, pose))
            .collect();

        for (l, frame) in self.sequence.frames.iter().enumerate() {
            if l > 0 && self.options.photometric_weight > 0.0 {
                let (indices, directions) = photometric_points(
                    [&visible[0], &visible[l]],
                    [&inside[0], &inside[l]],
                    self.options.covisible,
                );
                self.problem.pin_mut().set_photometric(l, &indices, &directions)?;
            }
            let seen = inverse_depth::seen(&visible[l], frame, self.input_unit);
            self.problem.pin_mut().set_inverse_depth(l, &seen)?;
        }
        Ok(())
    }

    /// L and its terms at the current estimate.
    pub fn evaluate(&mut self) -> Result<ObjectiveValue, ObjectiveError> {
        Ok(self.problem.pin_mut().evaluate()?.into())
    }

    /// ∂L/∂(p0, Δp_1, …, Δp_{L−1}, s, log α): 6 L + S + 1 entries.
    pub fn gradient(&mut self) -> Result<Vec<f64>, ObjectiveError> {
        let mut gradient = vec![0.0; 6 * self.sequence.frames.len() + self.prior.style_len() + 1];
        self.problem.pin_mut().gradient(&mut gradient)?;
        Ok(gradient)
    }

    /// One Ceres call; the observer sees every iteration and stops it by returning false. The best state found
    /// is kept, whatever ended the call.
    pub fn minimise(
        &mut self,
        call: &Call,
        observer: &mut dyn FnMut(&Iteration) -> bool,
    ) -> Result<CallOutcome, ObjectiveError> {
        let input_unit = self.input_unit;
        let mut on_iteration = |iteration: &ffi::Iteration| observer(&Iteration::new(iteration, input_unit));
        let summary = self
            .problem
            .pin_mut()
            .solve(&call.options(), &mut Observer::new(&mut on_iteration))?;
        // Twists may have wandered past π, where their derivative degrades; the same rotations, shorter.
        let estimate = self.estimate()?;
        self.set_estimate(&estimate)?;
        Ok(summary.into())
    }
}

fn camera(camera: &Pinhole) -> ffi::Camera {
    ffi::Camera {
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
    }
}

/// Per point: does it project into the frame's mask?
fn inside_mask(points: &[f64], frame: &Frame, camera_from_object: &Pose) -> Vec<bool> {
    points
        .chunks_exact(3)
        .map(|x| {
            let point = camera_from_object.transform(&Vector3::new(x[0], x[1], x[2]));
            frame
                .camera
                .project(&point)
                .and_then(|pixel| frame.mask.pixel_at(pixel.x, pixel.y))
                .is_some_and(|pixel| frame.mask[pixel])
        })
        .collect()
}

/// The points of Eq. 4 for one source frame, each with how many of the two sums it is in. Of the target and the
/// source: what each sees, and which points lie inside its mask. A point outside either mask is left out; so is, if
/// `covisible`, one that either does not see.
fn photometric_points(
    visible: [&Visibility; 2],
    inside: [&[bool]; 2],
    covisible: bool,
) -> (Vec<u32>, Vec<u8>) {
    let mut directions = vec![0u8; inside[0].len()];
    for point in visible.iter().flat_map(|v| &v.points) {
        let j = point.point as usize;
        let kept =
            inside.iter().all(|inside| inside[j]) && (!covisible || visible.iter().all(|v| v.unoccluded[j]));
        directions[j] += u8::from(kept);
    }
    (0u32..).zip(directions).filter(|&(_, d)| d > 0).unzip()
}
