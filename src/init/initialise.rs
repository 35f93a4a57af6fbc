//! From a sequence and a prior to the solver's starting points (Sec. 2.4).

use super::Estimate;
use super::cameras_from_input;
use super::hypotheses::{HypothesisOptions, PoseHypothesis, search};
use super::placement::{Evidence, Reconstruction, Shape, TargetDepth};
use super::silhouette::Observation;
use super::templates::Template;
use crate::geometry::Pose;
use crate::image::{DepthMap, halve_depth, halve_mask};
use crate::prior::ShapePrior;
use crate::sequence::{Frame, Sequence};
use crate::visibility::Cover;
use rayon::prelude::*;

/// Depth is compared at a resolution of at most this many columns: α needs no more.
const DEPTH_COLUMNS: usize = 128;
/// Or of so many, where few points are to hide each other.
const COARSE_DEPTH_COLUMNS: usize = 32;

/// Options of [`initialise`].
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitOptions {
    /// The templates and how many hypotheses are kept.
    pub hypotheses: HypothesisOptions,
    /// Points of the prior that make a silhouette.
    pub points: usize,
    /// Frames, spread over the sequence, whose silhouettes rank a hypothesis where off-the-shelf poses exist.
    pub frames: usize,
}

impl Default for InitOptions {
    fn default() -> Self {
        Self {
            hypotheses: HypothesisOptions::default(),
            points: 2048,
            frames: 8,
        }
    }
}

/// One starting point.
#[derive(Clone, Debug, PartialEq)]
pub struct Initialisation {
    /// The variables at this starting point.
    pub estimate: Estimate,
    /// The hypothesis from which p0 comes.
    pub hypothesis: PoseHypothesis,
    /// What the list is sorted by: the mean silhouette IoU over the chosen frames where off-the-shelf poses exist,
    /// the target's own otherwise.
    pub mean_iou: f64,
}

/// Why there is no starting point.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum InitError {
    /// The sequence has no frame.
    #[error("sequence `{sequence}`: no frames; give at least two")]
    NoFrames {
        /// The sequence's name.
        sequence: String,
    },
    /// A mask holds no pixel of the object.
    #[error("frame {frame} `{name}`: the mask is empty; mark the object in it or leave the frame out")]
    EmptyMask {
        /// The frame's index.
        frame: usize,
        /// The frame's name.
        name: String,
    },
    /// The given style has not as many entries as the prior has modes.
    #[error("style has {given} entries, the prior wants {wanted}; give as many as the prior has modes")]
    StyleLength {
        /// The entries that were given.
        given: usize,
        /// The entries that the prior wants.
        wanted: usize,
    },
    /// An earlier estimate has not one pose per frame.
    #[error("{given} poses for {frames} frames; give one a frame")]
    Poses {
        /// The poses that were given.
        given: usize,
        /// The frames of the sequence.
        frames: usize,
    },
    /// An option of the initialisation is out of range.
    #[error("init option `{field}` is {value}; {mend}")]
    Option {
        /// The option's key under `init`.
        field: &'static str,
        /// Its value.
        value: String,
        /// What to give instead.
        mend: &'static str,
    },
    /// Not one template can be placed on the target's mask.
    #[error("frame {frame} `{name}`: no template fits the mask; check the mask and the focal length")]
    NothingFits {
        /// The target's index.
        frame: usize,
        /// The target's name.
        name: String,
    },
    /// The target frame does not exist.
    #[error("the target is frame {target}, but there are {frames}; give 0 to {}", frames - 1)]
    Target {
        /// The index that was given.
        target: usize,
        /// The frames of the sequence.
        frames: usize,
    },
    /// The caller stopped the search.
    #[error("interrupted before there was a starting point")]
    Interrupted,
}

/// Starting points for every variable, the most likely first (at most K of [`HypothesisOptions`]).
///
/// `style` (S entries) gives the shape that is looked for: the prior's mean, or what a regressor makes of the
/// frames. `target` is the frame that p0 is the pose of, which comes from silhouettes. Where the off-the-shelf reconstruction holds the target and another frame,
/// α comes from Eq. 11 (or, without depth, from where the masks' centroids meet), Δp_l from Eq. 13, and both are
/// refined together with t0 so that all chosen frames' silhouettes agree in place and size, if that raises
/// their mean IoU; a frame without a pose takes that of the nearest frame that has one. Without poses α is 1 and each
/// frame keeps the target's viewing angle, placed by its own mask.
pub fn initialise(
    sequence: &Sequence,
    prior: &dyn ShapePrior,
    style: &[f64],
    target: usize,
    options: &InitOptions,
) -> Result<Vec<Initialisation>, InitError> {
    initialise_while(&|| true, sequence, prior, style, target, options)
}

/// Likewise, as long as `go_on` says so, which is asked before every template, from several threads.
///
/// # Errors
/// As [`initialise`], and [`InitError::Interrupted`] once `go_on` has said no; it must not change its mind.
pub fn initialise_while(
    go_on: &(dyn Fn() -> bool + Sync),
    sequence: &Sequence,
    prior: &dyn ShapePrior,
    style: &[f64],
    target: usize,
    options: &InitOptions,
) -> Result<Vec<Initialisation>, InitError> {
    check(sequence, prior, style, target, options)?;
    let observations = observe(sequence)?;

    let mut points = vec![0.0; 3 * options.points.min(prior.point_count())];
    prior.points(style, &mut points);
    let input_poses = input_poses(&sequence.frames, target);
    let reconstruction = input_poses.as_ref().map(|poses| {
        let chosen = chosen(sequence.frames.len(), target, options.frames);
        Reconstruction {
            camera_from_input: chosen.iter().map(|&frame| poses[frame]).collect(),
            sources: chosen
                .iter()
                .skip(1)
                .map(|&frame| observations[frame].clone())
                .collect(),
            depth: target_depth(&sequence.frames[target], DEPTH_COLUMNS),
            coarse_depth: target_depth(&sequence.frames[target], COARSE_DEPTH_COLUMNS),
        }
    });
    let evidence = Evidence {
        target: observations[target].clone(),
        reconstruction,
    };

    let shape = Shape::new(&points, Some(Cover::of(prior, style, &points)));
    let candidates = search(&evidence, &shape, &options.hypotheses, go_on);
    if !go_on() {
        return Err(InitError::Interrupted);
    }
    if candidates.is_empty() {
        return Err(InitError::NothingFits {
            frame: target,
            name: sequence.frames[target].name.clone(),
        });
    }
    let starts = candidates.iter().map(|candidate| {
        let hypothesis = candidate.hypothesis();
        let alpha = candidate.placement.alpha.unwrap_or(1.0);
        let camera_from_object = match &input_poses {
            Some(poses) => cameras_from_input(&hypothesis.target_from_object, target, poses, alpha),
            None => cameras_from_masks(
                &evidence,
                &shape,
                &observations,
                &hypothesis.target_from_object,
                target,
            ),
        };
        Initialisation {
            estimate: Estimate {
                camera_from_object,
                style: style.to_vec(),
                alpha,
                focal_factor: 1.0,
            },
            hypothesis,
            mean_iou: candidate.placement.mean_iou,
        }
    });
    Ok(starts.collect())
}

/// The starting point of an earlier estimate, in the canonical frame: `camera_from_object` of every frame and α. The style is `style`, whose shape
/// takes the earlier one's place: where it is the earlier style, `free_form` is what bent it, else empty.
///
/// # Errors
/// As [`initialise`]; not as many poses as frames.
pub fn initialise_at(
    sequence: &Sequence,
    prior: &dyn ShapePrior,
    (style, free_form): (&[f64], &[f64]),
    target: usize,
    camera_from_object: &[Pose],
    alpha: f64,
    options: &InitOptions,
) -> Result<Initialisation, InitError> {
    check(sequence, prior, style, target, options)?;
    if camera_from_object.len() != sequence.frames.len() {
        return Err(InitError::Poses {
            given: camera_from_object.len(),
            frames: sequence.frames.len(),
        });
    }
    let mut estimate = Estimate {
        camera_from_object: camera_from_object.to_vec(),
        style: style.to_vec(),
        alpha,
        focal_factor: 1.0,
    };
    if let Some(canonical_from_shape) = prior.canonical_from_shape(style, free_form) {
        estimate = estimate.in_frame(&canonical_from_shape.inverse());
    }
    let mut points = vec![0.0; 3 * options.points.min(prior.point_count())];
    prior.points(style, &mut points);
    let shape = Shape::new(&points, Some(Cover::of(prior, style, &points)));
    let ious: Vec<f64> = observe(sequence)?
        .iter()
        .zip(&estimate.camera_from_object)
        .map(|(frame, pose)| shape.render(frame, pose).iou(&frame.mask))
        .collect();
    let target_from_object = estimate.camera_from_object[target];
    Ok(Initialisation {
        estimate,
        hypothesis: Template::of(&target_from_object).hypothesis(target_from_object, ious[target]),
        mean_iou: ious.iter().sum::<f64>() / ious.len() as f64,
    })
}

fn check(
    sequence: &Sequence,
    prior: &dyn ShapePrior,
    style: &[f64],
    target: usize,
    options: &InitOptions,
) -> Result<(), InitError> {
    let wrong = |field, value: String, mend| Err(InitError::Option { field, value, mend });
    let HypothesisOptions {
        grid,
        count,
        distinct_deg,
    } = &options.hypotheses;
    if !(1.0..=180.0).contains(&grid.azimuth_step_deg) {
        return wrong(
            "azimuth_step_deg",
            grid.azimuth_step_deg.to_string(),
            "give 1 to 180",
        );
    }
    if grid.elevations_deg.is_empty() || !grid.elevations_deg.iter().all(|e| e.abs() <= 90.0) {
        return wrong(
            "elevations_deg",
            format!("{:?}", grid.elevations_deg),
            "give some within ±90",
        );
    }
    if grid.rolls_deg.is_empty() || !grid.rolls_deg.iter().all(|r| r.abs() <= 180.0) {
        return wrong(
            "rolls_deg",
            format!("{:?}", grid.rolls_deg),
            "give some within ±180",
        );
    }
    if *count == 0 {
        return wrong("count", count.to_string(), "give at least 1");
    }
    if !(0.0..=180.0).contains(distinct_deg) {
        return wrong("distinct_deg", distinct_deg.to_string(), "give 0 to 180");
    }
    if options.points < 100 {
        return wrong("points", options.points.to_string(), "give at least 100");
    }
    if options.frames == 0 {
        return wrong("frames", options.frames.to_string(), "give at least 1");
    }
    if style.len() != prior.style_len() {
        return Err(InitError::StyleLength {
            given: style.len(),
            wanted: prior.style_len(),
        });
    }
    if sequence.frames.is_empty() {
        return Err(InitError::NoFrames {
            sequence: sequence.name.clone(),
        });
    }
    let frames = sequence.frames.len();
    if target >= frames {
        return Err(InitError::Target { target, frames });
    }
    Ok(())
}

fn observe(sequence: &Sequence) -> Result<Vec<Observation>, InitError> {
    let observe = |(index, frame): (usize, &Frame)| {
        Observation::new(&frame.mask, frame.camera).ok_or_else(|| InitError::EmptyMask {
            frame: index,
            name: frame.name.clone(),
        })
    };
    let observed: Vec<_> = sequence.frames.par_iter().enumerate().map(observe).collect();
    observed.into_iter().collect()
}

/// Every frame's R', t', gaps filled from the nearest frame that has one (the earlier on a tie); `None` unless the
/// target and another frame have theirs.
fn input_poses(frames: &[Frame], target: usize) -> Option<Vec<Pose>> {
    frames[target].camera_from_input?;
    let known: Vec<(usize, Pose)> = frames
        .iter()
        .enumerate()
        .filter_map(|(index, frame)| Some((index, frame.camera_from_input?)))
        .collect();
    if known.len() < 2 {
        return None;
    }
    let nearest = |frame: usize| known.iter().min_by_key(|(index, _)| index.abs_diff(frame));
    (0..frames.len())
        .map(|frame| nearest(frame).map(|(_, pose)| *pose))
        .collect()
}

/// At most `count` of 0..`total`: the target first, then others evenly spread.
pub(crate) fn chosen(total: usize, target: usize, count: usize) -> Vec<usize> {
    let target_first: Vec<usize> = std::iter::once(target)
        .chain((0..total).filter(|&frame| frame != target))
        .collect();
    let places = spread(total, count).into_iter();
    places.map(|place| target_first[place]).collect()
}

/// At most `count` of 0..`total`, evenly spread, the first and the last among them.
fn spread(total: usize, count: usize) -> Vec<usize> {
    let count = count.min(total);
    (0..count).map(|i| i * (total - 1) / (count - 1).max(1)).collect()
}

/// The target's depth within its mask, reduced to at most so many columns; `None` where nothing is known.
fn target_depth(frame: &Frame, columns: usize) -> Option<TargetDepth> {
    let given = frame.depth.as_ref()?;
    let mut mask = frame.mask.clone();
    let within = given.data().iter().zip(mask.data());
    let within = within.map(|(&z, &inside)| if inside && z.is_finite() { z } else { 0.0 });
    let mut depth = DepthMap::from_vec(mask.width(), mask.height(), within.collect())?;
    let mut camera = frame.camera;
    while mask.width() > columns {
        (depth, mask) = (halve_depth(&depth), halve_mask(&mask));
        camera = camera.scaled(0.5, 0.5);
    }
    depth
        .data()
        .iter()
        .any(|&z| z > 0.0)
        .then_some(TargetDepth { depth, mask, camera })
}

/// Without off-the-shelf poses: the target's rotation everywhere, each frame placed by its own mask.
fn cameras_from_masks(
    evidence: &Evidence,
    shape: &Shape,
    observations: &[Observation],
    target_from_object: &Pose,
    target: usize,
) -> Vec<Pose> {
    let place = |(l, frame): (usize, &Observation)| {
        if l == target {
            return *target_from_object;
        }
        let translation = evidence
            .place_in(shape, frame, &target_from_object.rotation)
            .unwrap_or(target_from_object.translation);
        Pose {
            translation,
            ..*target_from_object
        }
    };
    observations.par_iter().enumerate().map(place).collect()
}

#[cfg(test)]
mod tests;
