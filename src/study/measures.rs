//! What a study notes of one estimate.

use crate::eval::{Estimated, Platform, against_truth};
use crate::image::DepthMap;
use crate::init::Estimate;
use crate::report::{Surface, density, silhouette_iou};
use crate::sequence::Sequence;
use serde::{Deserialize, Serialize};

/// Means over the frames of one sequence (the depth error's over pixels), by truth where there is one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Mean angle between estimated and true rotations, degrees.
    pub orientation_error_deg: Option<f64>,
    /// % of the object's diagonal.
    pub location_error_percent: Option<f64>,
    /// Mean orientation error after the first camera is given and the scale fitted, degrees.
    pub aligned_orientation_error_deg: Option<f64>,
    /// Mean distance of the camera centres after that alignment, % of the object's diagonal.
    pub aligned_location_error_percent: Option<f64>,
    /// Mean absolute depth error over the pixels, diagonals.
    pub depth_error: Option<f64>,
    /// The depth error at the one scale of all depths that makes it least, diagonals.
    pub depth_error_at_best_scale: Option<f64>,
    /// Mean density within the true silhouettes, or within the given masks.
    pub density: Option<f64>,
    /// Mean IoU with the true silhouettes, or with the given masks.
    pub silhouette_iou: Option<f64>,
    /// % of the object's diagonal.
    pub chamfer_percent: Option<f64>,
    /// Mean rotation error against a turning platform, degrees ("turn error" in tables).
    pub turn_error_deg: Option<f64>,
    /// The absolute depth errors of all pixels, where the truth is known.
    pub depth_errors: Option<DepthHistogram>,
}

impl Measures {
    /// The measures of cameras and a shape for the frames of `sequence`, in their order.
    pub fn of_estimate(
        sequence: &Sequence,
        platform: Option<&Platform>,
        surface: &Surface,
        estimate: &Estimate,
    ) -> Self {
        let estimated = Estimated::of_estimate(sequence, surface, estimate);
        let mut measures = match sequence.truth {
            Some(_) => Self::against_truth(sequence, &estimated),
            None => Self::against_masks(sequence, &estimated),
        };
        measures.turn_error_deg = platform.and_then(|platform| {
            let rotations: Vec<_> = estimated
                .frames
                .iter()
                .map(|(name, _, pose)| (name.clone(), pose.rotation))
                .collect();
            Some(platform.errors(&rotations).ok()?.errors.summary.mean)
        });
        measures
    }

    /// The measures of the off-the-shelf poses and depth themselves.
    pub fn of_input(sequence: &Sequence, platform: Option<&Platform>) -> Self {
        let mut measures = Estimated::of_input(sequence, sequence, |_| true)
            .map(|input| Self::against_truth(sequence, &input))
            .unwrap_or_default();
        let rotations: Vec<_> = sequence
            .frames
            .iter()
            .filter_map(|frame| Some((frame.name.clone(), frame.camera_from_input?.rotation)))
            .collect();
        measures.turn_error_deg =
            platform.and_then(|platform| Some(platform.errors(&rotations).ok()?.errors.summary.mean));
        if sequence.truth.is_none() {
            let covered = sequence.frames.iter().map(|frame| {
                let depth = frame.depth.as_ref();
                depth.map_or(0.0, |depth| density(&frame.mask, &depth.known()))
            });
            measures.density = mean(covered);
        }
        measures
    }

    fn against_truth(sequence: &Sequence, estimated: &Estimated) -> Self {
        let Some(truth) = &sequence.truth else {
            return Self::default();
        };
        let errors = against_truth(estimated, truth);
        let mut histogram = DepthHistogram::default();
        for ((_, index, _), depth) in estimated.frames.iter().zip(&estimated.depth) {
            if let (Some(depth), Some(true_depth)) = (depth, truth.depth.get(*index)) {
                histogram.add(depth, estimated.depth_scale, true_depth);
            }
        }
        Self {
            orientation_error_deg: errors.orientation_error_deg.map(|m| m.mean),
            location_error_percent: errors.location_error_percent.map(|m| m.mean),
            aligned_orientation_error_deg: errors.aligned_orientation_error_deg.map(|m| m.mean),
            aligned_location_error_percent: errors.aligned_location_error_percent.map(|m| m.mean),
            depth_error: errors.depth_error,
            depth_error_at_best_scale: errors.depth_error_at_best_scale,
            density: errors.density_mean,
            silhouette_iou: errors.silhouette_iou_mean,
            chamfer_percent: errors.chamfer_percent,
            turn_error_deg: None,
            depth_errors: Some(histogram),
        }
    }

    fn against_masks(sequence: &Sequence, estimated: &Estimated) -> Self {
        let covered: Vec<_> = sequence
            .frames
            .iter()
            .zip(&estimated.depth)
            .filter_map(|(frame, depth)| Some((&frame.mask, depth.as_ref()?.known())))
            .collect();
        Self {
            density: mean(covered.iter().map(|(mask, covered)| density(mask, covered))),
            silhouette_iou: mean(
                covered
                    .iter()
                    .map(|(mask, covered)| silhouette_iou(mask, covered)),
            ),
            ..Self::default()
        }
    }
}

/// The mean; `None` of nothing.
pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// A histogram of absolute depth errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DepthHistogram {
    /// Bin i counts errors in \[i, i + 1) · [`DepthHistogram::BIN`]; the last one all beyond.
    pub counts: Vec<u64>,
}

impl Default for DepthHistogram {
    fn default() -> Self {
        Self {
            counts: vec![0; Self::BINS],
        }
    }
}

impl DepthHistogram {
    /// Width of a bin, object units.
    pub const BIN: f64 = 0.002;
    const BINS: usize = 101;

    /// Counts |`scale` · z − z_true| where both maps know one.
    pub fn add(&mut self, depth: &DepthMap, scale: f64, truth: &DepthMap) {
        if depth.size() != truth.size() {
            return;
        }
        for (&z, &true_z) in depth.data().iter().zip(truth.data()) {
            if z > 0.0 && true_z > 0.0 {
                let error = (scale * f64::from(z) - f64::from(true_z)).abs();
                self.counts[((error / Self::BIN) as usize).min(Self::BINS - 1)] += 1;
            }
        }
    }

    /// Adds another's counts.
    pub fn merge(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
        }
    }

    /// The share of pixels with an error below i · [`DepthHistogram::BIN`], for i = 0, 1, …
    pub fn cumulative(&self) -> Vec<f64> {
        let total = self.counts.iter().sum::<u64>().max(1) as f64;
        let below = self.counts.iter().scan(0u64, |sum, count| {
            let before = *sum;
            *sum += count;
            Some(before as f64 / total)
        });
        below.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn errors_fall_into_their_bins() {
        let grid = |values: [f32; 4]| Grid::from_vec(2, 2, values.to_vec()).unwrap();
        let mut histogram = DepthHistogram::default();
        histogram.add(
            &grid([1.0015, 0.0, 3.0, 1.0055]),
            2.0,
            &grid([2.0, 1.0, 2.0, 2.0]),
        );
        assert_eq!(
            (histogram.counts[1], histogram.counts[5], histogram.counts[100]),
            (1, 1, 1)
        );
        histogram.merge(&histogram.clone());
        let cumulative = histogram.cumulative();
        assert_eq!((cumulative[1], cumulative[2]), (0.0, 1.0 / 3.0));
        assert_eq!(cumulative[100], 2.0 / 3.0);
    }
}
