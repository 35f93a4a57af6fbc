//! A reconstruction from two views that grows by one frame at a time, as COLMAP's does.

use super::focal::{FREE, FocalEvidence, by_features};
use super::matching::{Matching, Pair};
use super::points::triangulated;
use super::tracks::{Seen, tracks};
use super::{Motion, MotionOptions, StructureFromMotionError};
use crate::bridge::bundle::ffi::{self as bundle, Bundle, BundleOptions, Observation};
use crate::bridge::vision::ffi::{self as vision, Found};
use crate::geometry::{Pinhole, Pose, Rotation3, Vector3};
use nalgebra::{Matrix3, Vector2, Vector6};
use rayon::prelude::*;

/// A pair, or a frame, with fewer features in common is none.
const MIN_COMMON_FEATURES: usize = 12;
/// So many points place a frame, and such a share of those that it sees.
const MIN_PLACING: usize = 8;
const MIN_PLACING_SHARE: f64 = 0.6;
/// Rays that meet at a smaller angle, in degrees, say nothing about depth.
const MIN_ANGLE_DEG: f64 = 1.5;
/// A first pair should have rays that meet at such an angle; a smaller one counts for less.
const START_ANGLE_DEG: f64 = 8.0;
/// No point lies so near to a camera, in baselines of the first pair.
const MIN_DISTANCE: f64 = 0.2;
/// So many reconstructions are tried.
const MAX_STARTS: usize = 8;
/// One that fits less well, in pixels of an object 500 pixels across, may be wrong.
const LIKELY_ERROR: f64 = 0.8;
/// Adjustments at the end, each after throwing out what does not fit.
const ROUNDS: usize = 4;

/// A pair whose matches fit one motion of the camera.
struct Verified {
    frames: [usize; 2],
    matches: Vec<[u32; 2]>,
    second_from_first: Pose,
    /// Median angle at which rays meet.
    angle_deg: f64,
}

#[derive(Clone)]
pub struct Reconstruction<'a> {
    matching: &'a Matching,
    options: &'a MotionOptions,
    /// Whether features may move the focal length.
    free_focal: bool,
    camera: Pinhole,
    /// Multiplies the camera's focal lengths.
    zoom: f64,
    poses: Vec<Option<Pose>>,
    tracks: Vec<Vec<Seen>>,
    points: Vec<Option<Vector3<f64>>>,
    /// Frames in the order of their placing.
    order: Vec<usize>,
}

/// The reconstruction of most frames, and of those the one that explains features best, among those that start from pairs of views, best pair
/// first, until one has all frames and, where the focal length is known, fits well: from two views alone, near and far may be taken for each
/// other. A start must have a frame that was not placed, or two that started none.
///
/// # Errors
/// No pair with enough in common.
pub fn reconstruct(
    matching: &Matching,
    camera: &Pinhole,
    options: &MotionOptions,
) -> Result<Motion, StructureFromMotionError> {
    let verified: Vec<Verified> = matching
        .pairs
        .par_iter()
        .map(|pair| verified(matching, camera, pair, options.error_px * matching.pixel))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten()
        .collect();
    let tracks = tracks_of(matching, &verified);
    let score = |pair: &Verified| pair.matches.len() as f64 * (pair.angle_deg / START_ANGLE_DEG).min(1.0);
    let mut starts: Vec<&Verified> = verified
        .iter()
        .filter(|pair| pair.angle_deg > MIN_ANGLE_DEG)
        .collect();
    starts.sort_by(|a, b| score(b).total_cmp(&score(a)));
    let mut placed = vec![false; matching.features.len()];
    let mut started = vec![false; matching.features.len()];
    let mut best: Option<(Reconstruction, Fit)> = None;
    for _ in 0..MAX_STARTS {
        let adds = |pair: &&&Verified| {
            let [a, b] = pair.frames;
            !placed[a] || !placed[b] || !(started[a] || started[b])
        };
        let Some(start) = starts.iter().find(adds) else {
            break;
        };
        let grown = Reconstruction::new(matching, camera, options, tracks.clone(), start).grown()?;
        let fit = grown.fit();
        start.frames.iter().for_each(|&frame| started[frame] = true);
        grown.order.iter().for_each(|&frame| placed[frame] = true);
        // Where the focal length is open, a flat shape far away may fit better than the right one.
        let is_open = options.focal_deviation >= FREE;
        let fits = is_open || fit.error_px < LIKELY_ERROR * matching.pixel;
        let is_likely = fit.frames == placed.len() && fits;
        if best.as_ref().is_none_or(|(_, best)| fit.is_better_than(best)) {
            best = Some((grown, fit));
        }
        if is_likely {
            break;
        }
    }
    let matched = || matching.pairs.iter().map(|pair| pair.matches.len()).max();
    let (best, _) = best.ok_or_else(|| StructureFromMotionError::NoPair {
        matched: matched().unwrap_or(0),
    })?;
    best.finished()
}

/// How much a reconstruction explains, and how well.
struct Fit {
    frames: usize,
    /// Of points in frames.
    observations: usize,
    /// Root mean square over them.
    error_px: f64,
}

impl Fit {
    fn is_better_than(&self, other: &Self) -> bool {
        let score = |fit: &Self| fit.observations as f64 / (0.5 + fit.error_px);
        self.frames > other.frames || (self.frames == other.frames && score(self) > score(other))
    }
}

/// What belongs together by the matches of all pairs.
fn tracks_of(matching: &Matching, verified: &[Verified]) -> Vec<Vec<Seen>> {
    let counts: Vec<usize> = matching.features.iter().map(Vec::len).collect();
    // Pairs with much in common decide first.
    let mut in_order: Vec<&Verified> = verified.iter().collect();
    in_order.sort_by_key(|pair| std::cmp::Reverse(pair.matches.len()));
    tracks(
        &counts,
        in_order.iter().map(|pair| (pair.frames, pair.matches.as_slice())),
    )
}

impl<'a> Reconstruction<'a> {
    fn new(
        matching: &'a Matching,
        camera: &Pinhole,
        options: &'a MotionOptions,
        tracks: Vec<Vec<Seen>>,
        start: &Verified,
    ) -> Self {
        let mut poses = vec![None; matching.features.len()];
        let [first, second] = start.frames;
        poses[first] = Some(Pose::identity());
        poses[second] = Some(start.second_from_first);
        Self {
            matching,
            options,
            free_focal: options.focal_deviation >= FREE,
            camera: *camera,
            zoom: 1.0,
            poses,
            points: vec![None; tracks.len()],
            tracks,
            order: vec![first, second],
        }
    }

    /// With all frames that can be placed.
    fn grown(mut self) -> Result<Self, StructureFromMotionError> {
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
        Ok(self)
    }

    /// Adjusted as a whole, with the focal length by all evidence.
    fn finished(mut self) -> Result<Motion, StructureFromMotionError> {
        self.adjust(ROUNDS)?;
        let by_features = by_features(&self)?;
        let known = self.options.focal_deviation;
        let focal_deviation = if self.free_focal {
            by_features.deviation
        } else if known > 0.0 {
            let both = by_features.fused(FocalEvidence {
                px: self.focal_px(),
                deviation: known,
            });
            self.zoom = both.px / self.camera.fx;
            self.adjust(ROUNDS)?;
            both.deviation
        } else {
            0.0
        };
        Ok(self.motion(focal_deviation, by_features))
    }

    pub fn with_free_focal(self) -> Self {
        Self {
            free_focal: true,
            ..self
        }
    }

    pub fn focal_px(&self) -> f64 {
        self.zoomed().fx
    }

    pub fn points(&self) -> impl Iterator<Item = &Vector3<f64>> {
        self.points.iter().flatten()
    }

    pub fn keep_points(&mut self, keep: impl Fn(&Vector3<f64>) -> bool) {
        for point in &mut self.points {
            *point = point.filter(&keep);
        }
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
        if !found.any || count < MIN_PLACING || (count < MIN_COMMON_FEATURES && share < MIN_PLACING_SHARE) {
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
            loss_width: 0.5 * self.tolerance(),
            // From few frames a focal length cannot be told from a distance.
            zoom_deviation: if self.free_focal && self.order.len() > 4 {
                FREE
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

    fn motion(&self, focal_deviation: f64, focal_by_features: FocalEvidence) -> Motion {
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
        Motion {
            camera: self.zoomed(),
            camera_from_input: self.poses.clone(),
            points,
            seen_in,
            focal_deviation,
            focal_by_features,
            error_px: self.fit().error_px,
        }
    }

    fn fit(&self) -> Fit {
        let known = self.tracks.iter().zip(&self.points);
        let squares: Vec<f64> = known
            .filter_map(|(track, point)| Some((track, point.as_ref()?)))
            .flat_map(|(track, point)| track.iter().map(move |seen| (point, *seen)))
            .filter_map(|(point, seen)| {
                let pose = self.poses[seen[0] as usize].as_ref()?;
                Some(self.error(pose, point, seen).powi(2))
            })
            .collect();
        Fit {
            frames: self.order.len(),
            observations: squares.len(),
            error_px: (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt(),
        }
    }
}

fn pose_of(found: &Found) -> Pose {
    Pose {
        rotation: Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&found.rotation)),
        translation: Vector3::from_column_slice(&found.translation),
    }
}

fn verified(
    matching: &Matching,
    camera: &Pinhole,
    pair: &Pair,
    tolerance: f64,
) -> Result<Option<Verified>, StructureFromMotionError> {
    let [a, b] = pair.frames;
    let rays = |frame: usize, side: usize| -> Vec<f64> {
        pair.matches
            .iter()
            .flat_map(|features| {
                let [x, y] = matching.features[frame][features[side] as usize];
                [(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy]
            })
            .collect()
    };
    if pair.matches.len() < MIN_COMMON_FEATURES {
        return Ok(None);
    }
    let (first, second) = (rays(a, 0), rays(b, 1));
    let mut inliers = vec![0; pair.matches.len()];
    let found = vision::two_views(&first, &second, tolerance / camera.fx, &mut inliers)?;
    let chosen: Vec<usize> = (0..inliers.len()).filter(|&k| inliers[k] != 0).collect();
    if !found.any || chosen.len() < MIN_COMMON_FEATURES {
        return Ok(None);
    }
    let second_from_first = pose_of(&found);
    let mut angles: Vec<f64> = chosen
        .iter()
        .filter_map(|&k| {
            let ray = |rays: &[f64]| Vector2::new(rays[2 * k], rays[2 * k + 1]);
            let seen = [(Pose::identity(), ray(&first)), (second_from_first, ray(&second))];
            triangulated(&seen).map(|(_, angle)| angle.to_degrees())
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    Ok(Some(Verified {
        frames: pair.frames,
        matches: chosen.iter().map(|&k| pair.matches[k]).collect(),
        second_from_first,
        angle_deg: angles.get(angles.len() / 2).copied().unwrap_or(0.0),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Pinhole = Pinhole {
        fx: 500.0,
        fy: 500.0,
        cx: 320.0,
        cy: 240.0,
    };

    /// A camera that walks about the origin, `step_deg` a frame.
    fn arc(count: usize, step_deg: f64) -> Vec<Pose> {
        (0..count)
            .map(|i| Pose {
                rotation: Rotation3::from_scaled_axis(Vector3::y() * (i as f64 * step_deg).to_radians()),
                translation: Vector3::new(0.0, 0.0, 3.0),
            })
            .collect()
    }

    /// What frames see of points of their own group, frame after frame; all of a group match, none of two groups.
    fn matching(groups: &[(Vec<Pose>, usize)]) -> Matching {
        let (mut features, mut group_of) = (Vec::new(), Vec::new());
        for (group, (poses, points)) in groups.iter().enumerate() {
            let points: Vec<Vector3<f64>> = (0..*points)
                .map(|i| {
                    let share = |prime: f64| (i as f64 * prime).fract() - 0.5;
                    Vector3::new(share(0.819_172_513), share(0.671_043_607), share(0.549_700_478))
                })
                .collect();
            for pose in poses {
                let seen = points.iter().map(|x| CAMERA.project(&pose.transform(x)).unwrap());
                features.push(seen.map(|pixel| [pixel.x, pixel.y]).collect::<Vec<_>>());
                group_of.push(group);
            }
        }
        let frames = features.len();
        let pairs = (0..frames)
            .flat_map(|a| (a + 1..frames).map(move |b| [a, b]))
            .map(|[a, b]| Pair {
                frames: [a, b],
                matches: match group_of[a] == group_of[b] {
                    true => (0..features[a].len() as u32).map(|i| [i, i]).collect(),
                    false => Vec::new(),
                },
            })
            .collect();
        Matching {
            features,
            pairs,
            pixel: 1.0,
        }
    }

    #[test]
    fn the_reconstruction_of_most_frames_counts() {
        // The best pair is of the smaller group.
        let (few, many) = (arc(3, 8.0), arc(6, 4.0));
        let matching = matching(&[(few, 120), (many.clone(), 40)]);
        let found = reconstruct(&matching, &CAMERA, &MotionOptions::default()).unwrap();
        assert!(found.camera_from_input[..3].iter().all(Option::is_none));
        assert!(found.error_px < 1e-3, "{}", found.error_px);
        let of = |i: usize| found.camera_from_input[3 + i].unwrap();
        for i in 1..6 {
            let turned = of(i).rotation * of(0).rotation.inverse();
            let truth = many[i].rotation * many[0].rotation.inverse();
            assert!(turned.angle_to(&truth).to_degrees() < 0.01);
        }
        assert_eq!(found.points.len(), 40);
    }

    #[test]
    fn frames_without_anything_in_common_have_no_motion() {
        let matching = matching(&[(arc(1, 0.0), 40), (arc(1, 0.0), 30)]);
        let refused = reconstruct(&matching, &CAMERA, &MotionOptions::default());
        assert!(matches!(
            refused,
            Err(StructureFromMotionError::NoPair { matched: 0 })
        ));
    }
}
