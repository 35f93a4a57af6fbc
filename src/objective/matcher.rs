//! Which points and pixels the terms compare at an estimate.

use super::inverse_depth::KnownDepths;
use super::options::limit;
use super::{Footage, ObjectiveOptions, silhouette, threads};
use crate::bridge::ceres::ffi;
use crate::geometry::Vector3;
use crate::image::Grid;
use crate::init::Estimate;
use crate::prior::ShapePrior;
use crate::sequence::Frame;
use crate::visibility::{Cover, Visibility as Seen, visible_points};
use std::sync::Arc;

/// What does not depend on the estimate.
pub(super) struct Matcher {
    /// One per frame.
    depths: Arc<[KnownDepths]>,
    outside_px: Arc<[Grid<u8>]>,
    pub prior: Arc<dyn ShapePrior>,
    /// What hides the points that are looked at in the mean shape.
    cover_at_rest: Cover,
    /// With the number of points in use, and what the sequence says of itself.
    pub options: ObjectiveOptions,
    pub threads: usize,
    /// The frames that Eq. 4 compares.
    pairs: Vec<(usize, usize)>,
    /// α at construction: inverse depths are compared in units in which α starts at 1, so that λ2 and δ2 mean
    /// the same whatever the unit of the off-the-shelf reconstruction.
    pub input_unit: f64,
}

impl Matcher {
    /// `target` must be a frame, and `options` in range.
    pub fn new(
        footage: &Footage,
        prior: Arc<dyn ShapePrior>,
        options: &ObjectiveOptions,
        target: usize,
        alpha: f64,
        threads: usize,
    ) -> Self {
        let sequence = footage.sequence();
        let options = ObjectiveOptions {
            points: limit(options.points, prior.point_count()),
            motion_deviation: options.motion_deviation.or(sequence.motion_deviation),
            focal_deviation: options.focal_deviation.or(sequence.focal_deviation),
            ..options.clone()
        };
        let no_style = vec![0.0; prior.style_len()];
        let mut mean = vec![0.0; 3 * options.points];
        prior.points(&no_style, &mut mean);
        Self {
            depths: footage.depths.clone(),
            outside_px: footage.outside_px.clone(),
            cover_at_rest: Cover::of(&*prior, &no_style, &mean),
            prior,
            pairs: options.pairs.of(sequence.frames.len(), target),
            options,
            threads,
            input_unit: alpha,
        }
    }

    /// S.
    pub fn style_len(&self) -> usize {
        self.prior.style_len()
    }

    /// X(s) of the points in use.
    pub fn points(&self, style: &[f64]) -> Vec<f64> {
        let mut points = vec![0.0; 3 * self.options.points];
        self.prior.points(style, &mut points);
        points
    }

    /// What hides points, X(s) of those in use.
    pub fn cover(&self, style: &[f64], points: &[f64]) -> Cover {
        self.cover_at_rest.at(&*self.prior, style, points)
    }

    /// What is compared between `frames`, those of the footage, at `estimate`.
    pub fn find(&self, frames: &[Frame], estimate: &Estimate, level: usize) -> ffi::VisibilityInput {
        let points = self.points(&estimate.style);
        let cover = self.cover(&estimate.style, &points);
        let photometric = self.options.photometric_weight > 0.0;
        let (known_depths, input_unit, huber) =
            (&self.depths, self.input_unit, self.options.inverse_depth_huber);
        let seen = threads::map(frames.len(), self.threads, |l| {
            let (frame, pose) = (&frames[l], &estimate.camera_from_object[l]);
            let camera = estimate.camera(&frame.camera);
            let seen = visible_points(&points, &camera, pose, frame.image.size(), Some(&cover));
            let inside = if photometric {
                inside_mask(&seen, frame)
            } else {
                Vec::new()
            };
            let depths = known_depths[l].seen(l, &seen, input_unit, huber);
            (seen, inside, depths)
        });
        let mut input = ffi::VisibilityInput {
            level: level as u32,
            pairs: Vec::new(),
            comparisons: Vec::new(),
            depths: Vec::new(),
            silhouette_weights: self.silhouette_weights(frames, &points, estimate),
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
        input
    }

    /// What each point's distances outside the masks weigh: more, the more frames agree that it is outside. A mask that leaks is alone in what it
    /// shows, and so is one that lacks a part; the robust loss of [`ObjectiveOptions::silhouette_cauchy`] cannot tell them from a shape that is wrong.
    fn silhouette_weights(&self, frames: &[Frame], points: &[f64], estimate: &Estimate) -> Vec<f64> {
        let agreed = self.options.silhouette_agreement;
        if self.options.silhouette_weight == 0.0 || agreed == 0.0 {
            return Vec::new();
        }
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
pub(super) fn photometric_points(
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
