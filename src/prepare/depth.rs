//! Semi-dense depth inside the masks by a plane sweep: every pixel with texture takes the plane, parallel to the image, on which
//! its surroundings look most alike in other frames, if those frames find the same point.

mod patches;

use super::motion::Motion;
use crate::geometry::{Pinhole, Pose, Vector3};
use crate::image::{DepthMap, Grid, Mask, RgbImage};
use patches::{Patches, Region, Scratch, warp};
use rayon::prelude::*;

/// Options of the plane sweep.
#[derive(Clone, Debug)]
pub struct DepthOptions {
    /// The number of planes, evenly spaced in inverse depth.
    pub planes: usize,
    /// The number of frames that each frame is compared with.
    pub neighbours: usize,
    /// Half a side of the compared patches, in pixels.
    pub radius_px: usize,
    /// The minimum normalised cross-correlation (NCC) of patches that match.
    pub min_ncc: f32,
    /// The number of other frames that must find the same point.
    pub agreeing: usize,
    /// Standard deviation of a patch, in grey levels, below which it has no texture.
    pub min_texture: f32,
}

impl Default for DepthOptions {
    fn default() -> Self {
        Self {
            planes: 128,
            neighbours: 6,
            radius_px: 3,
            min_ncc: 0.75,
            agreeing: 2,
            min_texture: 4.0,
        }
    }
}

/// Share of a depth by which another frame's may differ.
const AGREEMENT: f64 = 0.01;
/// Frames to compare see the object from angles apart by this many degrees.
const ANGLES_DEG: [f64; 2] = [2.0, 25.0];

/// Pictures are halved for the sweep until the object is no more pixels across than this: the planes' number stays, and details of single pixels
/// say little of depth.
const OBJECT_PX: f64 = 480.0;

/// How often pictures of an object so many pixels across are halved for the sweep.
pub fn halvings(object_px: f64) -> u32 {
    (object_px / OBJECT_PX).log2().ceil().max(0.0) as u32
}

/// Pictures at one size, and the camera that made them.
pub struct ScaledFrames<'a> {
    pub images: Vec<(&'a RgbImage, &'a Mask)>,
    pub camera: Pinhole,
}

/// One frame of the sweep.
struct Swept<'a> {
    gray: Grid<f32>,
    mask: &'a Mask,
    /// The mask's bounding box: left, top, right, bottom, pixels.
    bounds: [usize; 4],
    camera_from_input: Pose,
    /// Nearest and farthest inverse depth of the object.
    inverse_depth: [f64; 2],
}

/// A depth map for every placed frame, in the motion's units; `None` for the others. `neighbours`: those to compare each with. `watch` hears of every frame, and stops all by
/// returning false: then there is nothing.
pub fn sweep(
    frames: &ScaledFrames,
    motion: &Motion,
    neighbours: &[Vec<usize>],
    options: &DepthOptions,
    watch: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Option<DepthMap>>> {
    let swept: Vec<Option<Swept>> = frames
        .images
        .iter()
        .zip(&motion.camera_from_input)
        .enumerate()
        .map(|(frame, ((image, mask), pose))| {
            let camera_from_input = (*pose)?;
            Some(Swept {
                gray: gray(image),
                bounds: mask.bounds()?,
                mask,
                inverse_depth: range(motion, frame, &camera_from_input)?,
                camera_from_input,
            })
        })
        .collect();
    let first: Vec<Option<DepthMap>> = (0..swept.len())
        .into_par_iter()
        .map(|frame| {
            let Some(target) = &swept[frame] else {
                return Some(None);
            };
            if !watch() {
                return None;
            }
            let others: Vec<&Swept> = neighbours[frame]
                .iter()
                .filter_map(|&k| swept[k].as_ref())
                .collect();
            let depth = best_planes(target, &others, &frames.camera, options);
            Some(Some(depth))
        })
        .collect::<Option<_>>()?;
    let agreed = (0..swept.len())
        .into_par_iter()
        .map(|frame| {
            let (target, depth) = (swept[frame].as_ref()?, first[frame].as_ref()?);
            let others: Vec<(Pose, &DepthMap)> = neighbours[frame]
                .iter()
                .filter_map(|&k| {
                    let other_from_target = swept[k]
                        .as_ref()?
                        .camera_from_input
                        .after(&target.camera_from_input.inverse());
                    Some((other_from_target, first[k].as_ref()?))
                })
                .collect();
            Some(agreed(depth, &others, &frames.camera, options))
        })
        .collect();
    Some(agreed)
}

/// The median of each coordinate: single points may lie anywhere.
pub(super) fn middle(points: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|k, _| {
        let mut values: Vec<f64> = points.iter().map(|point| point[k]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    })
}

/// Grey levels less the middle one, so that sums of squares stay small.
fn gray(image: &RgbImage) -> Grid<f32> {
    Grid::from_fn(image.width(), image.height(), |column, row| {
        let [r, g, b] = image[(column, row)];
        0.299 * r + 0.587 * g + 0.114 * b - 128.0
    })
}

/// The inverse depths between which the object lies, from its points: those that the frame sees, and a margin.
fn range(motion: &Motion, frame: usize, camera_from_input: &Pose) -> Option<[f64; 2]> {
    let mut inverse: Vec<f64> = motion
        .points
        .iter()
        .zip(&motion.seen_in)
        .filter(|(_, seen_in)| seen_in.contains(&(frame as u32)))
        .map(|(point, _)| 1.0 / camera_from_input.transform(point).z)
        .filter(|inverse| *inverse > 0.0)
        .collect();
    if inverse.len() < 5 {
        return None;
    }
    inverse.sort_by(f64::total_cmp);
    let at = |share: f64| inverse[(share * (inverse.len() - 1) as f64).round() as usize];
    let (low, high) = (at(0.02), at(0.98));
    let margin = 0.35 * (high - low);
    Some([(low - margin).max(0.3 * low), high + margin])
}

/// Per frame, at most so many others that see the object from other angles, but not too different ones; evenly from both sides.
pub fn neighbours(motion: &Motion, count: usize) -> Vec<Vec<usize>> {
    let centre = middle(&motion.points);
    let rays: Vec<Option<Vector3<f64>>> = motion
        .camera_from_input
        .iter()
        .map(|pose| Some((pose.as_ref()?.center() - centre).normalize()))
        .collect();
    (0..rays.len()).map(|frame| near(&rays, frame, count)).collect()
}

/// `rays` point from the object to the cameras.
fn near(rays: &[Option<Vector3<f64>>], frame: usize, count: usize) -> Vec<usize> {
    let Some(own) = rays[frame] else {
        return Vec::new();
    };
    let mut fit: Vec<(f64, usize)> = (0..rays.len())
        .filter(|&k| k != frame)
        .filter_map(|k| {
            let other = rays[k]?;
            let angle = own.cross(&other).norm().atan2(own.dot(&other)).to_degrees();
            let wanted = 8.0;
            (ANGLES_DEG[0]..ANGLES_DEG[1])
                .contains(&angle)
                .then_some(((angle / wanted).ln().abs(), k))
        })
        .collect();
    fit.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    fit.into_iter().take(count).map(|(_, k)| k).collect()
}

/// Per pixel, the depth at which the best frames see what the target sees; 0 where none does.
fn best_planes(target: &Swept, others: &[&Swept], camera: &Pinhole, options: &DepthOptions) -> DepthMap {
    let mut depth = Grid::filled(target.gray.width(), target.gray.height(), 0.0f32);
    if others.is_empty() {
        return depth;
    }
    // What lies about the mask is all that is looked at.
    let [left, top, right, bottom] = target.bounds;
    let (left, top) = (
        left.saturating_sub(options.radius_px),
        top.saturating_sub(options.radius_px),
    );
    let (right, bottom) = (
        (right + options.radius_px).min(depth.width()),
        (bottom + options.radius_px).min(depth.height()),
    );
    let (width, height) = (right - left, bottom - top);
    let gray = Grid::from_fn(width, height, |column, row| {
        target.gray[(left + column, top + row)]
    });
    let [low, high] = target.inverse_depth;
    let step = (high - low) / (options.planes - 1) as f64;
    let own = Patches::new(gray, options.radius_px);
    let wanted: Vec<usize> = (0..width * height)
        .filter(|&i| target.mask[(left + i % width, top + i / width)])
        .filter(|&i| own.variance(i) > options.min_texture.powi(2))
        .collect();
    let region = Region::new(wanted, (width, height), options.radius_px);
    let wanted = region.wanted();
    let others: Vec<(&Grid<f32>, Pose)> = others
        .iter()
        .map(|other| {
            let other_from_target = other.camera_from_input.after(&target.camera_from_input.inverse());
            (&other.gray, other_from_target)
        })
        .collect();
    let mut scores = vec![0.0f32; wanted.len() * options.planes];
    // Of the two frames that are most alike: what one sees another may not.
    let mut likeness = vec![[f32::NEG_INFINITY; 2]; wanted.len()];
    let mut warped = Grid::filled(width, height, 0.0);
    let mut scratch = Scratch::default();
    for plane in 0..options.planes {
        let inverse_depth = low + step * plane as f64;
        likeness.fill([f32::NEG_INFINITY; 2]);
        for (gray, other_from_target) in &others {
            warp(
                gray,
                camera,
                other_from_target,
                inverse_depth,
                [left, top],
                &region,
                &mut warped,
            );
            own.correlate(&mut warped, &region, &mut scratch, |k, value| {
                let best = &mut likeness[k];
                if value > best[0] {
                    *best = [value, best[0]];
                } else if value > best[1] {
                    best[1] = value;
                }
            });
        }
        for (k, best) in likeness.iter().enumerate() {
            scores[k * options.planes + plane] = match *best {
                [first, second] if second.is_finite() => 0.5 * (first + second),
                [first, _] => first.max(-1.0),
            };
        }
    }
    for (scores, i) in scores.chunks_exact(options.planes).zip(wanted) {
        if let Some(plane) = peak(scores, options.min_ncc) {
            depth[(left + i % width, top + i / width)] = (1.0 / (low + step * plane)) as f32;
        }
    }
    depth
}

/// Where the scores have one clear maximum, between planes.
fn peak(scores: &[f32], least: f32) -> Option<f64> {
    let best = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    if best == 0 || best + 1 >= scores.len() || scores[best] < least {
        return None;
    }
    // Another peak as high says that the texture repeats.
    let repeated = scores
        .iter()
        .enumerate()
        .filter(|(k, _)| k.abs_diff(best) > 4)
        .any(|(k, &score)| {
            score > scores[best] - 0.05
                && score >= scores[k.saturating_sub(1)]
                && score >= scores[(k + 1).min(scores.len() - 1)]
        });
    if repeated {
        return None;
    }
    let [before, at, after] = [scores[best - 1], scores[best], scores[best + 1]].map(f64::from);
    let bend = before - 2.0 * at + after;
    let offset = if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    Some(best as f64 + offset.clamp(-0.5, 0.5))
}

/// What enough other frames find, too.
fn agreed(
    depth: &DepthMap,
    others: &[(Pose, &DepthMap)],
    camera: &Pinhole,
    options: &DepthOptions,
) -> DepthMap {
    let needed = options.agreeing.min(others.len()).max(1);
    Grid::from_fn(depth.width(), depth.height(), |column, row| {
        let z = depth[(column, row)];
        if z <= 0.0 {
            return 0.0;
        }
        let pixel = nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
        let point = camera.unproject(&pixel, f64::from(z));
        let agreeing = others
            .iter()
            .filter(|(other_from_target, other)| agrees(camera, &other_from_target.transform(&point), other))
            .count();
        if agreeing >= needed { z } else { 0.0 }
    })
}

/// Another frame sees, where it sees a point (in its camera's frame), something as far away.
pub(super) fn agrees(camera: &Pinhole, point: &Vector3<f64>, depth: &DepthMap) -> bool {
    camera
        .project(point)
        .and_then(|pixel| depth.pixel_at(pixel.x, pixel.y))
        .is_some_and(|at| {
            let theirs = f64::from(depth[at]);
            theirs > 0.0 && (theirs - point.z).abs() < AGREEMENT * point.z
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_is_found_between_planes_unless_there_are_two() {
        let bump = |at: f64| {
            (0..40)
                .map(|k| 1.0 - 0.05 * ((f64::from(k) - at) as f32).powi(2))
                .collect::<Vec<f32>>()
        };
        assert!((peak(&bump(17.3), 0.8).unwrap() - 17.3).abs() < 1e-5);
        assert_eq!(peak(&bump(0.0), 0.8), None, "at the end of the range");
        let twice: Vec<f32> = bump(10.0).iter().zip(bump(30.0)).map(|(a, b)| a.max(b)).collect();
        assert_eq!(peak(&twice, 0.8), None);
        assert_eq!(peak(&[0.5; 5], 0.8), None);
    }
}
