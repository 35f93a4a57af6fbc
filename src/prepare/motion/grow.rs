//! A reconstruction from two views that grows by one frame at a time, as COLMAP's does.

use super::focal::{FREE, FocalEvidence, OVERDISPERSION, Profile};
use super::matching::Matching;
use super::points::triangulated;
use super::start::{Quality, Verified};
use super::tracks::Seen;
use super::{Motion, MotionOptions, StructureFromMotionError};
use crate::bridge::bundle::ffi::{self as bundle, Bundle, BundleOptions, Observation};
use crate::bridge::vision::ffi::{self as vision, Found};
use crate::geometry::{Pinhole, Pose, Rotation3, Vector3};
use crate::prepare::depth::middle;
use nalgebra::{Matrix3, Vector2, Vector6};
use rayon::prelude::*;

/// A pair, or a frame, with fewer features in common is none.
pub(super) const MIN_COMMON_FEATURES: usize = 12;
/// So many points place a frame where they are such a share of those that it sees.
const MIN_PLACING: usize = 8;
const MIN_PLACING_SHARE: f64 = 0.6;
/// From [`MIN_COMMON_FEATURES`] on, such a share is enough.
const MIN_COMMON_SHARE: f64 = 0.5;
/// So many place a frame whatever their share, as in COLMAP: fewer may agree by chance on a wrong pose.
const SURE_PLACING: usize = 30;
/// Rays that meet at a smaller angle, in degrees, say nothing about depth.
pub(super) const MIN_ANGLE_DEG: f64 = 1.5;
/// No point lies so near to a camera, in baselines of the first pair.
const MIN_DISTANCE: f64 = 0.2;
/// By how much the logarithm of its likelihood is greater, a motion is more likely than its mirror image without doubt.
const CERTAIN: f64 = 5.0;
/// Adjustments at the end, each after throwing out what does not fit.
const ROUNDS: usize = 4;

#[derive(Clone)]
pub struct Reconstruction<'a> {
    matching: &'a Matching,
    options: &'a MotionOptions,
    /// How freely features may move the focal length: the standard deviation of its logarithm, 0 where it is held.
    focal_deviation: f64,
    camera: Pinhole,
    /// Multiplies the camera's focal lengths.
    zoom: f64,
    poses: Vec<Option<Pose>>,
    /// What belongs together by matches alone.
    all_tracks: &'a [Vec<Seen>],
    /// Of it, what fits.
    tracks: Vec<Vec<Seen>>,
    points: Vec<Option<Vector3<f64>>>,
    /// Frames in the order of their placing.
    pub(super) order: Vec<usize>,
}

impl<'a> Reconstruction<'a> {
    pub(super) fn new(
        matching: &'a Matching,
        camera: &Pinhole,
        options: &'a MotionOptions,
        all_tracks: &'a [Vec<Seen>],
        start: &Verified,
    ) -> Self {
        let mut poses = vec![None; matching.features.len()];
        let [first, second] = start.frames;
        poses[first] = Some(Pose::identity());
        poses[second] = Some(start.second_from_first);
        Self {
            matching,
            options,
            // Few frames fit any focal length, and from a very long one no adjustment leads back.
            focal_deviation: if options.focal_deviation < FREE {
                options.focal_deviation
            } else {
                0.0
            },
            camera: *camera,
            zoom: 1.0,
            poses,
            points: vec![None; all_tracks.len()],
            tracks: all_tracks.to_vec(),
            all_tracks,
            order: vec![first, second],
        }
    }

    /// With all frames that can be placed.
    pub(super) fn grown(mut self) -> Result<Self, StructureFromMotionError> {
        self.extend_points();
        self.adjust(1)?;
        let mut refused = vec![false; self.poses.len()];
        while let Some(frame) = self.next(&refused) {
            if self.place(frame)? {
                refused.fill(false);
                self.extend_points();
                self.adjust(if self.order.len() < 10 || self.order.len().is_multiple_of(4) {
                    1
                } else {
                    0
                })?;
            } else {
                refused[frame] = true;
            }
        }
        // What does not fit the last frames says nothing of how well the rest does.
        self.adjust(1)?;
        Ok(self)
    }

    /// Adjusted as a whole, with the focal length by all evidence.
    pub(super) fn finished(mut self) -> Result<Motion, StructureFromMotionError> {
        self.adjust(ROUNDS)?;
        if self.may_be_swapped()? {
            let (own, swapped) = (self.with_all_tracks()?, self.swapped().with_all_tracks()?);
            self = match swapped.quality().is_better_than(&own.quality()) {
                true => swapped,
                false => own,
            };
        }
        let known = match self.options.focal_deviation {
            0.0 => None,
            FREE.. => Some(FocalEvidence::usual(&self.camera)),
            deviation => Some(FocalEvidence {
                px: self.camera.fx,
                deviation,
            }),
        };
        let mut profile = Profile::of(&self)?;
        let Some(known) = known else {
            return self.motion(0.0, profile.evidence(None));
        };
        // What fits depends on the focal length, and the other way round.
        let nearest = |profile: &Profile<'a>| {
            let px = profile.evidence(Some(known)).px;
            let mut nearest = profile.near(px).unwrap_or(&self).clone();
            nearest.hold_focal(px);
            nearest
        };
        profile = Profile::of(&nearest(&profile).with_all_tracks()?)?;
        let mut adjusted = nearest(&profile);
        adjusted.adjust(ROUNDS)?;
        let deviation = profile.evidence(Some(known)).deviation;
        adjusted.motion(deviation, profile.evidence(None))
    }

    /// Adjusted after taking in again what did not fit before.
    fn with_all_tracks(&self) -> Result<Self, StructureFromMotionError> {
        let mut all = self.clone();
        all.tracks = self.all_tracks.to_vec();
        all.adjust(ROUNDS)?;
        Ok(all)
    }

    /// With near and far swapped: the points mirrored in the plane through their middle that faces the first camera, the cameras turned the other
    /// way. Seen from far away the pictures stay nearly what they were.
    fn swapped(&self) -> Self {
        let mut swapped = self.clone();
        let Some(first) = self.order.first().and_then(|&frame| self.poses[frame]) else {
            return swapped;
        };
        let points: Vec<Vector3<f64>> = self.points.iter().flatten().map(|x| first.transform(x)).collect();
        let middle = middle(&points);
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
        for point in swapped.points.iter_mut().flatten() {
            *point = middle + mirror * (first.transform(point) - middle);
        }
        for pose in swapped.poses.iter_mut().flatten() {
            let from_first = pose.after(&first.inverse());
            let rotation = Rotation3::from_matrix_unchecked(mirror * from_first.rotation.matrix() * mirror);
            *pose = Pose {
                rotation,
                translation: from_first.transform(&middle) - rotation * middle,
            };
        }
        swapped
    }

    /// Whether the features fit nearly as well with near and far swapped.
    fn may_be_swapped(&self) -> Result<bool, StructureFromMotionError> {
        let mut swapped = self.swapped();
        swapped.bundle()?;
        Ok(swapped.cost() - self.cost() < OVERDISPERSION * CERTAIN)
    }

    pub fn with_free_focal(self) -> Self {
        Self {
            focal_deviation: FREE,
            ..self
        }
    }

    /// Another focal length, which adjustments keep. Every camera goes where it sees the middle of the points as large as before.
    pub fn hold_focal(&mut self, px: f64) {
        let factor = px / self.focal_px();
        let points: Vec<Vector3<f64>> = self.points.iter().flatten().copied().collect();
        let middle = middle(&points);
        for pose in self.poses.iter_mut().flatten() {
            pose.translation.z += (factor - 1.0) * pose.transform(&middle).z;
        }
        self.zoom = px / self.camera.fx;
        self.focal_deviation = 0.0;
    }

    pub fn focal_px(&self) -> f64 {
        self.zoomed().fx
    }

    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// What adjustments minimise, in pixels of an object 500 pixels across. What is further off than what belongs to a point costs no more than
    /// that.
    pub fn cost(&self) -> f64 {
        let width = self.loss_width();
        let weight = 0.5 * (width / self.matching.pixel).powi(2);
        let placed = |seen: &Seen| self.poses[seen[0] as usize].as_ref();
        self.tracks
            .iter()
            .zip(&self.points)
            .filter_map(|(track, point)| Some((track, point.as_ref()?)))
            .flat_map(|(track, point)| track.iter().map(move |&seen| (point, seen)))
            .filter_map(|(point, seen)| Some(self.error(placed(&seen)?, point, seen)))
            .map(|error| weight * (error.min(self.tolerance()) / width).powi(2).ln_1p())
            .sum()
    }

    /// x and y on the plane z = 1 of a feature.
    fn ray(&self, [frame, feature]: Seen) -> Vector2<f64> {
        let [x, y] = self.matching.features[frame as usize][feature as usize];
        let camera = self.zoomed();
        Vector2::new((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy)
    }

    fn zoomed(&self) -> Pinhole {
        Pinhole {
            fx: self.zoom * self.camera.fx,
            fy: self.zoom * self.camera.fy,
            ..self.camera
        }
    }

    /// How far from where a pose sees a point its feature is, in pixels; infinite at or behind the camera.
    fn error(&self, pose: &Pose, point: &Vector3<f64>, [frame, feature]: Seen) -> f64 {
        let [x, y] = self.matching.features[frame as usize][feature as usize];
        let in_camera = pose.transform(point);
        self.zoomed()
            .project(&in_camera)
            .filter(|_| in_camera.z > MIN_DISTANCE)
            .map_or(f64::INFINITY, |pixel| (pixel - Vector2::new(x, y)).norm())
    }

    fn tolerance(&self) -> f64 {
        self.options.error_px * self.matching.pixel
    }

    /// Cauchy scale of an adjustment, in pixels.
    fn loss_width(&self) -> f64 {
        0.5 * self.tolerance()
    }

    /// The frame not yet placed that sees most points, unless it was refused or sees too few.
    fn next(&self, refused: &[bool]) -> Option<usize> {
        let mut counts = vec![0; self.poses.len()];
        for (track, _) in self
            .tracks
            .iter()
            .zip(&self.points)
            .filter(|(_, point)| point.is_some())
        {
            track.iter().for_each(|seen| counts[seen[0] as usize] += 1);
        }
        (0..self.poses.len())
            .filter(|&frame| self.poses[frame].is_none() && !refused[frame] && counts[frame] >= MIN_PLACING)
            .max_by_key(|&frame| (counts[frame], std::cmp::Reverse(frame)))
    }

    /// Places a frame where the points that it sees tell where it stands; whether they do.
    fn place(&mut self, frame: usize) -> Result<bool, StructureFromMotionError> {
        let (mut points, mut rays) = (Vec::new(), Vec::new());
        for (track, point) in self.tracks.iter().zip(&self.points) {
            let (Some(point), Some(&seen)) = (point, track.iter().find(|seen| seen[0] as usize == frame))
            else {
                continue;
            };
            points.extend_from_slice(point.as_slice());
            rays.extend_from_slice(self.ray(seen).as_slice());
        }
        let mut inliers = vec![0; points.len() / 3];
        let threshold = self.tolerance() / self.zoomed().fx;
        let found = vision::resect(&points, &rays, threshold, &mut inliers)?;
        let count = inliers.iter().filter(|&&inlier| inlier != 0).count();
        let share = count as f64 / inliers.len() as f64;
        let least_share = match count {
            SURE_PLACING.. => 0.0,
            MIN_COMMON_FEATURES.. => MIN_COMMON_SHARE,
            MIN_PLACING.. => MIN_PLACING_SHARE,
            _ => f64::INFINITY,
        };
        if !found.any || share < least_share {
            return Ok(false);
        }
        let pose = pose_of(&found);
        if !pose.to_twist().iter().all(|x| x.is_finite()) {
            return Ok(false);
        }
        self.poses[frame] = Some(pose);
        self.order.push(frame);
        Ok(true)
    }

    /// Points of all tracks that have none, where placed frames see them well.
    fn extend_points(&mut self) {
        let found: Vec<Option<Vector3<f64>>> = self
            .tracks
            .par_iter()
            .zip(&self.points)
            .map(|(track, point)| point.or_else(|| self.point(track)))
            .collect();
        self.points = found;
    }

    fn point(&self, track: &[Seen]) -> Option<Vector3<f64>> {
        let placed: Vec<(Seen, Pose)> = track
            .iter()
            .filter_map(|&seen| Some((seen, self.poses[seen[0] as usize]?)))
            .collect();
        let rays: Vec<_> = placed
            .iter()
            .map(|&(seen, pose)| (pose, self.ray(seen)))
            .collect();
        let (point, angle) = triangulated(&rays)?;
        let fits = placed
            .iter()
            .all(|(seen, pose)| self.error(pose, &point, *seen) < self.tolerance());
        (angle.to_degrees() > MIN_ANGLE_DEG && fits).then_some(point)
    }

    /// So many adjustments of everything, each after throwing out what does not fit.
    fn adjust(&mut self, rounds: usize) -> Result<(), StructureFromMotionError> {
        for _ in 0..rounds {
            self.bundle()?;
            for k in 0..self.tracks.len() {
                let Some(point) = self.points[k] else {
                    continue;
                };
                let fits = |seen: &Seen| match &self.poses[seen[0] as usize] {
                    Some(pose) => self.error(pose, &point, *seen) < self.tolerance(),
                    None => true,
                };
                let kept: Vec<Seen> = self.tracks[k].iter().filter(|seen| fits(seen)).copied().collect();
                let placed = kept
                    .iter()
                    .filter(|seen| self.poses[seen[0] as usize].is_some())
                    .count();
                if placed < 2 {
                    self.points[k] = None;
                }
                self.tracks[k] = kept;
            }
            self.extend_points();
        }
        Ok(())
    }

    /// Adjusts all poses and points, and the focal length if it is free.
    pub fn bundle(&mut self) -> Result<(), StructureFromMotionError> {
        let mut place = vec![None; self.poses.len()];
        let mut cameras = Vec::with_capacity(6 * self.order.len());
        for (k, &frame) in self.order.iter().enumerate() {
            place[frame] = Some(k as u32);
            let pose = self.poses[frame].unwrap_or_else(Pose::identity);
            cameras.extend_from_slice(pose.to_twist().as_slice());
        }
        let (mut points, mut observations, mut used) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (track, point)) in self.tracks.iter().zip(&self.points).enumerate() {
            let Some(point) = point else {
                continue;
            };
            for &seen in track {
                let [frame, feature] = seen.map(|index| index as usize);
                let (Some(camera), Some(pose)) = (place[frame], &self.poses[frame]) else {
                    continue;
                };
                // A wrong match may put its point behind or into the camera, whence nothing leads back.
                if self.error(pose, point, seen).is_finite() {
                    let [x, y] = self.matching.features[frame][feature];
                    observations.push(Observation {
                        camera,
                        point: used.len() as u32,
                        x,
                        y,
                    });
                }
            }
            points.extend_from_slice(point.as_slice());
            used.push(k);
        }
        let mut bundle = Bundle {
            cameras,
            points,
            zoom: self.zoom,
            observations,
        };
        let options = BundleOptions {
            fx: self.camera.fx,
            fy: self.camera.fy,
            cx: self.camera.cx,
            cy: self.camera.cy,
            loss_width: self.loss_width(),
            // From few frames a focal length cannot be told from a distance.
            zoom_deviation: if self.order.len() > 4 {
                self.focal_deviation
            } else {
                0.0
            },
            max_iterations: 40,
        };
        bundle::adjust(&mut bundle, &options)?;
        self.zoom = bundle.zoom;
        for (twist, &frame) in bundle.cameras.chunks_exact(6).zip(&self.order) {
            self.poses[frame] = Some(Pose::from_twist(&Vector6::from_column_slice(twist)));
        }
        for (point, k) in bundle.points.chunks_exact(3).zip(used) {
            self.points[k] = Some(Vector3::from_column_slice(point));
        }
        Ok(())
    }

    fn motion(
        &self,
        focal_deviation: f64,
        focal_by_features: FocalEvidence,
    ) -> Result<Motion, StructureFromMotionError> {
        let (points, seen_in) = self
            .tracks
            .iter()
            .zip(&self.points)
            .filter_map(|(track, point)| {
                let frames = track.iter().map(|seen| seen[0]);
                let placed = frames.filter(|&frame| self.poses[frame as usize].is_some());
                Some(((*point)?, placed.collect()))
            })
            .unzip();
        Ok(Motion {
            camera: self.zoomed(),
            camera_from_input: self.poses.clone(),
            points,
            seen_in,
            focal_deviation,
            focal_by_features,
            error_px: self.quality().error_px,
            may_be_swapped: self.may_be_swapped()?,
        })
    }

    pub(super) fn quality(&self) -> Quality {
        let known = self.tracks.iter().zip(&self.points);
        let squares: Vec<f64> = known
            .filter_map(|(track, point)| Some((track, point.as_ref()?)))
            .flat_map(|(track, point)| track.iter().map(move |seen| (point, *seen)))
            .filter_map(|(point, seen)| {
                let pose = self.poses[seen[0] as usize].as_ref()?;
                Some(self.error(pose, point, seen).powi(2))
            })
            .collect();
        Quality {
            frames: self.order.len(),
            observations: squares.len(),
            error_px: (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt(),
        }
    }
}

pub(super) fn pose_of(found: &Found) -> Pose {
    Pose {
        rotation: Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&found.rotation)),
        translation: Vector3::from_column_slice(&found.translation),
    }
}
