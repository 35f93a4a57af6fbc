//! How near a first guess of the shape comes, against the mean shape and against the known shape whose silhouettes fit best.

use super::{Regressor, RegressorError};
use crate::prior::{LearnedPrior, PriorInfo, ShapePrior, chamfer, style_of};
use crate::report::{Surface, silhouette_iou};
use crate::sequence::{Sequence, Truth};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Points that shapes are compared at.
pub const POINTS: usize = 2048;

/// Chamfer errors of first guesses at one sequence, in diagonals (½ of both mean distances).
#[derive(Clone, Debug, PartialEq)]
pub struct Guesses {
    /// The error of the regressor's guess.
    pub regressor: f64,
    /// The error of the mean shape.
    pub mean: f64,
    /// The known style whose shape, under the true cameras, has the best mean silhouette IoU.
    pub retrieved: Option<f64>,
    /// The style fitted to the true shape: what no guess can beat by much.
    pub best: f64,
}

/// Judges guesses from the frames of `sequence`, whose true cameras and shape are `truth`'s; `known` are styles to retrieve from.
pub fn judge(
    regressor: &Regressor,
    (prior, info): (&LearnedPrior, &PriorInfo),
    known: &[Vec<f64>],
    sequence: &Sequence,
    truth: &Truth,
) -> Result<Guesses, RegressorError> {
    let shape: Vec<Vector3<f64>> = truth.shape.iter().map(|x| Vector3::from(*x).cast()).collect();
    let points = |style: &[f64]| {
        let mut points = prior.shape(style);
        points.truncate(POINTS);
        if let Some(canonical) = prior.canonical_from_shape(style, &[]) {
            points
                .iter_mut()
                .for_each(|point| *point = canonical.transform(point));
        }
        points
    };
    let error = |style: &[f64]| chamfer(&points(style), &shape);
    let fit = |style: &Vec<f64>| -> f64 {
        let surface = Surface::from_points(points(style));
        let frames = sequence.frames.iter().zip(&truth.camera_from_object);
        let ious = frames.map(|(frame, pose)| {
            let seen = surface.render(&frame.camera, pose, frame.mask.size());
            silhouette_iou(&seen.mask(), &frame.mask)
        });
        ious.sum()
    };
    let fits: Vec<f64> = known.par_iter().map(fit).collect();
    let retrieved = (0..known.len()).max_by(|&a, &b| fits[a].total_cmp(&fits[b]));
    Ok(Guesses {
        regressor: error(&regressor.style(sequence, info)?),
        mean: error(&vec![0.0; prior.style_len()]),
        retrieved: retrieved.map(|k| error(&known[k])),
        best: error(&style_of(prior, &shape, POINTS)),
    })
}
