//! Where a reconstruction starts: pairs of frames whose matches fit a motion, and the best of what grows from them.

use super::focal::FREE;
use super::grow::{MIN_ANGLE_DEG, MIN_COMMON_FEATURES, Reconstruction, pose_of};
use super::matching::{Matching, Pair};
use super::points::triangulated;
use super::tracks::{Seen, tracks};
use super::{Motion, MotionOptions, StructureFromMotionError, score};
use crate::bridge::vision::ffi as vision;
use crate::geometry::{Pinhole, Pose};
use nalgebra::Vector2;
use rayon::prelude::*;

/// A first pair should have rays that meet at such an angle; a smaller one counts for less.
const START_ANGLE_DEG: f64 = 8.0;
/// So many reconstructions are tried.
const MAX_STARTS: usize = 8;
/// One that fits less well, in pixels of an object 500 pixels across, may be wrong.
const LIKELY_ERROR: f64 = 0.8;

/// A pair whose matches fit one motion of the camera.
pub struct Verified {
    pub frames: [usize; 2],
    pub matches: Vec<[u32; 2]>,
    pub second_from_first: Pose,
    /// Median angle at which rays meet.
    pub angle_deg: f64,
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
    let mut best: Option<(Reconstruction, Quality)> = None;
    for _ in 0..MAX_STARTS {
        let adds = |pair: &&&Verified| {
            let [a, b] = pair.frames;
            !placed[a] || !placed[b] || !(started[a] || started[b])
        };
        let Some(start) = starts.iter().find(adds) else {
            break;
        };
        let grown = Reconstruction::new(matching, camera, options, &tracks, start).grown()?;
        let quality = grown.quality();
        start.frames.iter().for_each(|&frame| started[frame] = true);
        grown.order.iter().for_each(|&frame| placed[frame] = true);
        // Where the focal length is open, a flat shape far away may fit better than the right one.
        let is_open = options.focal_deviation >= FREE;
        let fits = is_open || quality.error_px < LIKELY_ERROR * matching.pixel;
        let is_likely = quality.frames == placed.len() && fits;
        if best.as_ref().is_none_or(|(_, best)| quality.is_better_than(best)) {
            best = Some((grown, quality));
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
pub struct Quality {
    pub frames: usize,
    /// Of points in frames.
    pub observations: usize,
    /// Root mean square over them.
    pub error_px: f64,
}

impl Quality {
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        let score = |quality: &Self| score(quality.observations, quality.error_px);
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
    use crate::geometry::{Rotation3, Vector3};

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

    /// The last frame has nothing but 14 features in common with the one before it, of which others see nine.
    #[test]
    fn nine_points_of_nine_place_a_frame() {
        let mut matching = matching(&[(arc(5, 6.0), 60)]);
        for pair in &mut matching.pairs {
            let [a, b] = pair.frames;
            pair.matches.retain(|&[i, _]| match (a, b) {
                (3, 4) => (46..60).contains(&i),
                (_, 4) => false,
                _ => i < 55,
            });
        }
        let found = reconstruct(&matching, &CAMERA, &MotionOptions::default()).unwrap();
        assert!(found.camera_from_input.iter().all(Option::is_some));
        assert!(found.error_px < 1e-3, "{}", found.error_px);
    }

    /// Features of the last frame that slid along the lines on which matches are looked for, each its own way.
    #[test]
    fn few_that_agree_among_many_place_no_frame() {
        for (slid, is_placed) in [(40, false), (28, true)] {
            let mut matching = matching(&[(arc(6, 3.0), 60)]);
            for (i, feature) in matching.features[5][..slid].iter_mut().enumerate() {
                feature[0] += [-40.0, 40.0][i % 2] + (i as f64 * 0.618_034).fract() * 30.0;
            }
            let found = reconstruct(&matching, &CAMERA, &MotionOptions::default()).unwrap();
            let placed: Vec<bool> = found.camera_from_input.iter().map(Option::is_some).collect();
            assert_eq!(placed, [true, true, true, true, true, is_placed], "{slid}");
        }
    }

    /// Focal length and quality of what grows from the first pair and another.
    fn grown(matching: &Matching, camera: &Pinhole, options: &MotionOptions, other: usize) -> (f64, Quality) {
        let pairs = matching.pairs.iter();
        let verified: Vec<Verified> = pairs
            .filter_map(|pair| verified(matching, camera, pair, options.error_px).unwrap())
            .collect();
        let tracks = tracks_of(matching, &verified);
        let start = verified.iter().find(|pair| pair.frames == [0, other]).unwrap();
        let grown = Reconstruction::new(matching, camera, options, &tracks, start)
            .grown()
            .unwrap();
        (grown.focal_px(), grown.quality())
    }

    /// Features of the last frame that slid along the lines on which matches are looked for, and so fit every pair.
    #[test]
    fn a_start_is_judged_without_what_does_not_fit() {
        let mut matching = matching(&[(arc(11, 3.0), 60)]);
        for feature in &mut matching.features[10][..6] {
            feature[0] += 25.0;
        }
        let (_, quality) = grown(&matching, &CAMERA, &MotionOptions::default(), 3);
        assert_eq!(quality.frames, 11);
        assert!(quality.error_px < LIKELY_ERROR, "{}", quality.error_px);
    }

    #[test]
    fn a_known_focal_length_moves_by_its_deviation_while_frames_are_placed() {
        let matching = matching(&[(arc(8, 8.0), 60)]);
        let said = Pinhole {
            fx: 0.92 * CAMERA.fx,
            fy: 0.92 * CAMERA.fy,
            ..CAMERA
        };
        let focal = |focal_deviation| {
            let options = MotionOptions {
                focal_deviation,
                ..MotionOptions::default()
            };
            grown(&matching, &said, &options, 1).0
        };
        assert_eq!(focal(0.0), said.fx);
        let moved = focal(0.06);
        assert!((moved / CAMERA.fx - 1.0).abs() < 0.03, "{moved}");
        let hardly = focal(1e-4);
        assert!((hardly / said.fx - 1.0).abs() < 0.01, "{hardly}");
    }

    #[test]
    fn features_find_a_focal_length_of_which_nothing_is_known() {
        let matching = matching(&[(arc(10, 8.0), 60)]);
        let options = MotionOptions {
            focal_deviation: FREE,
            ..MotionOptions::default()
        };
        for guess in [0.7, 1.7, 4.0] {
            let said = Pinhole {
                fx: guess * CAMERA.fx,
                fy: guess * CAMERA.fy,
                ..CAMERA
            };
            let found = reconstruct(&matching, &said, &options).unwrap();
            let factor = found.camera.fx / CAMERA.fx;
            assert!((factor - 1.0).abs() < 0.05, "{guess}: {factor}");
            assert!(!found.may_be_swapped, "{guess}");
        }
    }

    /// Nearly the same pictures from 60 times as far away, with as much longer a lens.
    #[test]
    fn what_is_seen_from_far_away_may_be_swapped() {
        let mut matching = matching(&[(arc(6, 8.0), 60)]);
        let camera = Pinhole {
            fx: 60.0 * CAMERA.fx,
            fy: 60.0 * CAMERA.fy,
            ..CAMERA
        };
        for (pose, features) in arc(6, 8.0).iter().zip(&mut matching.features) {
            for (i, feature) in features.iter_mut().enumerate() {
                let share = |prime: f64| (i as f64 * prime).fract() - 0.5;
                let x = Vector3::new(share(0.819_172_513), share(0.671_043_607), share(0.549_700_478));
                let seen = pose.transform(&x) + Vector3::z() * 59.0 * 3.0;
                let pixel = camera.project(&seen).unwrap();
                *feature = [pixel.x, pixel.y];
            }
        }
        let found = reconstruct(&matching, &camera, &MotionOptions::default()).unwrap();
        assert!(found.camera_from_input.iter().all(Option::is_some));
        assert!(found.may_be_swapped);
    }

    #[test]
    fn more_frames_count_before_a_better_fit() {
        let of = |frames, observations, error_px| Quality {
            frames,
            observations,
            error_px,
        };
        assert!(of(5, 100, 2.0).is_better_than(&of(4, 900, 0.1)));
        assert!(of(5, 100, 0.5).is_better_than(&of(5, 100, 0.6)));
        assert!(of(5, 101, 0.5).is_better_than(&of(5, 100, 0.5)));
        assert!(!of(5, 100, 0.5).is_better_than(&of(5, 100, 0.5)));
    }
}
