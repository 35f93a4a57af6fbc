//! Where a template has to stand: the translation (and with off-the-shelf poses α) that makes its silhouettes
//! agree with the masks in place and size.

use super::cameras_from_input;
use super::scale::scale_from_inverse_depth;
use super::silhouette::Observation;
use crate::geometry::{Matrix4, Pinhole, Pose, Rotation3, Vector2, Vector3, Vector4};
use crate::image::{DepthMap, Mask};
use crate::visibility::{Surfels, visible_points};

/// No part of an object of diagonal 1 is then behind the camera.
const NEAREST_DEPTH: f64 = 0.55;
/// Rounds of matching bounding boxes, which works from anywhere, then areas and centroids, which is exact.
const BOX_ROUNDS: usize = 4;
const AREA_ROUNDS: usize = 5;
/// Rounds of fitting translation and α to all frames.
const JOINT_ROUNDS: usize = 4;
/// How strongly the joint fit holds on to its present α, as a share of what the centroids say per frame: decides
/// only where the motion is too small for them to say anything.
const ALPHA_HOLD: f64 = 0.02;

/// The prior's mean shape and what the frames show of it.
pub(super) struct Scene {
    /// Object frame.
    pub points: Vec<Vector3<f64>>,
    /// Median distance between neighbouring points.
    pub spacing: f64,
    pub target: Observation,
    pub reconstruction: Option<Reconstruction>,
}

/// What the off-the-shelf tools say, for a few frames spread over the sequence.
pub(super) struct Reconstruction {
    /// One per chosen frame, the target first.
    pub camera_from_input: Vec<Pose>,
    /// Of the chosen source frames.
    pub sources: Vec<Observation>,
    pub depth: Option<TargetDepth>,
}

/// The target's off-the-shelf depth, at any resolution.
pub(super) struct TargetDepth {
    pub depth: DepthMap,
    pub mask: Mask,
    pub camera: Pinhole,
    /// The scene's points again, as visibility wants them.
    pub points: Vec<f64>,
    pub surfels: Surfels,
}

/// A placed template.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub target_from_object: Pose,
    /// `None` without a reconstruction.
    pub alpha: Option<f64>,
    /// Silhouette IoU in the target frame.
    pub target_iou: f64,
    /// Over the chosen frames, the target included; the target's alone without a reconstruction.
    pub mean_iou: f64,
}

impl Scene {
    /// `None` where the template cannot be brought onto the mask.
    pub fn place(&self, rotation: &Rotation3<f64>) -> Option<Placement> {
        let translation = self.place_in(&self.target, rotation)?;
        let alone = Pose {
            rotation: *rotation,
            translation,
        };
        let Some(reconstruction) = &self.reconstruction else {
            return Some(self.score(alone, None));
        };
        let alpha = reconstruction
            .scale(&alone)
            .or_else(|| self.scale_from_centroids(&alone))
            .unwrap_or(1.0);
        let mut best = self.score(alone, Some(alpha));
        let mut current = (alone, alpha);
        for _ in 0..JOINT_ROUNDS {
            let Some(next) = self.fit_all_frames(current) else {
                break;
            };
            current = next;
            let placement = self.score(current.0, Some(current.1));
            if placement.mean_iou > best.mean_iou {
                best = placement;
            }
        }
        Some(best)
    }

    /// The translation at which the silhouette has the mask's area and centroid in one frame.
    pub fn place_in(&self, frame: &Observation, rotation: &Rotation3<f64>) -> Option<Vector3<f64>> {
        let (low, high) = frame.bounds_px;
        let camera = &frame.camera;
        let mut translation = camera.unproject(&((low + high) / 2.0), 2.0);
        for _ in 0..BOX_ROUNDS {
            let (model_low, model_high) = self.projected_bounds(camera, rotation, &translation)?;
            let ratio = (model_high - model_low).norm() / (high - low).norm();
            let shift = (low + high - model_low - model_high) / 2.0;
            translation = moved(camera, &translation, &shift, ratio);
        }
        let goal = frame.centroid_px(&frame.mask)?;
        for _ in 0..AREA_ROUNDS {
            let pose = Pose {
                rotation: *rotation,
                translation,
            };
            let rendered = frame.render(&self.points, self.spacing, &pose);
            let shift = goal - frame.centroid_px(&rendered)?;
            let ratio = (f64::from(rendered.area()) / f64::from(frame.mask.area())).sqrt();
            translation = moved(camera, &translation, &shift, ratio);
        }
        translation.iter().all(|x| x.is_finite()).then_some(translation)
    }

    fn projected_bounds(
        &self,
        camera: &Pinhole,
        rotation: &Rotation3<f64>,
        translation: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let mut pixels = self
            .points
            .iter()
            .filter_map(|point| camera.project(&(rotation * point + translation)));
        let first = pixels.next()?;
        Some(pixels.fold((first, first), |(low, high), u| (low.inf(&u), high.sup(&u))))
    }

    fn score(&self, target_from_object: Pose, alpha: Option<f64>) -> Placement {
        let iou = |frame: &Observation, pose: &Pose| {
            frame.render(&self.points, self.spacing, pose).iou(&frame.mask)
        };
        let target_iou = iou(&self.target, &target_from_object);
        let mean_iou = match (&self.reconstruction, alpha) {
            (Some(reconstruction), Some(alpha)) => {
                let poses =
                    cameras_from_input(&target_from_object, 0, &reconstruction.camera_from_input, alpha);
                let sources = poses[1..].iter().zip(&reconstruction.sources);
                let sum: f64 = sources.map(|(pose, frame)| iou(frame, pose)).sum();
                (target_iou + sum) / (reconstruction.sources.len() + 1) as f64
            }
            _ => target_iou,
        };
        Placement {
            target_from_object,
            alpha,
            target_iou,
            mean_iou,
        }
    }

    /// α from where the masks' centroids say that the object's centre is, as a fallback to Eq. 11.
    fn scale_from_centroids(&self, target_from_object: &Pose) -> Option<f64> {
        let goals = self.frames().map(|frame| frame.centroid_px(&frame.mask));
        let goals: Vec<_> = goals.collect::<Option<_>>()?;
        let depths = vec![1.0; goals.len()];
        let solution = self.triangulate(&goals, &depths, None)?;
        let alpha = solution.w * target_from_object.translation.norm() / solution.xyz().norm();
        (alpha.is_finite() && alpha > 0.0).then_some(alpha)
    }

    /// One step towards the (t0, α) at which every frame's silhouette has its mask's centroid, and the areas agree
    /// in the mean.
    fn fit_all_frames(&self, (target_from_object, alpha): (Pose, f64)) -> Option<(Pose, f64)> {
        let reconstruction = self.reconstruction.as_ref()?;
        let poses = cameras_from_input(&target_from_object, 0, &reconstruction.camera_from_input, alpha);
        let (mut goals, mut log_ratio) = (Vec::with_capacity(poses.len()), 0.0);
        for (frame, pose) in self.frames().zip(&poses) {
            let rendered = frame.render(&self.points, self.spacing, pose);
            let shift = frame.centroid_px(&frame.mask)? - frame.centroid_px(&rendered)?;
            goals.push(frame.camera.project(&pose.translation)? + shift);
            log_ratio += (f64::from(rendered.area()) / f64::from(frame.mask.area())).ln() / 2.0;
        }
        let depths: Vec<f64> = poses.iter().map(|pose| pose.translation.z).collect();
        let solution = self.triangulate(&goals, &depths, Some((&target_from_object.translation, alpha)))?;
        let size = (log_ratio / poses.len() as f64).exp() * target_from_object.translation.norm()
            / solution.xyz().norm();
        let (translation, alpha) = (solution.xyz() * size, solution.w * size);
        (translation.z > NEAREST_DEPTH && alpha > 0.0 && alpha.is_finite()).then_some((
            Pose {
                translation,
                ..target_from_object
            },
            alpha,
        ))
    }

    /// The (t0, α), up to a common factor, for which the object's origin projects to `goals`: with
    /// t_l = R'_l R'_0ᵀ t0 + α b_l (Eq. 13) each goal is two linear equations, weighted by 1 / `depths`.
    fn triangulate(
        &self,
        goals: &[Vector2<f64>],
        depths: &[f64],
        held: Option<(&Vector3<f64>, f64)>,
    ) -> Option<Vector4<f64>> {
        let poses = &self.reconstruction.as_ref()?.camera_from_input;
        let input_from_target = poses.first()?.inverse();
        let relative: Vec<Pose> = poses.iter().map(|pose| pose.after(&input_from_target)).collect();
        // Solved for α in units of the motion, so that the input's units do not matter.
        let unit = relative
            .iter()
            .map(|pose| pose.translation.norm())
            .fold(0.0, f64::max);
        if unit <= 0.0 {
            return None;
        }
        let mut normal = Matrix4::zeros();
        for (((frame, pose), goal), depth) in self.frames().zip(&relative).zip(goals).zip(depths) {
            let ray = frame.camera.unproject(goal, 1.0);
            let rotation = pose.rotation.matrix();
            for axis in 0..2 {
                let of_translation = rotation.row(axis) - rotation.row(2) * ray[axis];
                let of_alpha = (pose.translation[axis] - pose.translation.z * ray[axis]) / unit;
                let equation = of_translation.transpose().push(of_alpha) / *depth;
                normal += equation * equation.transpose();
            }
        }
        if let Some((translation, alpha)) = held {
            // α / |t0| stays what it is.
            let equation =
                (translation / translation.norm_squared()).push(-1.0 / (alpha * unit)) * ALPHA_HOLD;
            normal += equation * equation.transpose() * goals.len() as f64;
        }
        let eigen = normal.symmetric_eigen();
        let mut solution = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        solution.w /= unit;
        if solution.z < 0.0 {
            solution = -solution;
        }
        (solution.z > 0.0).then_some(solution)
    }

    /// The target, then the chosen sources.
    fn frames(&self) -> impl Iterator<Item = &Observation> {
        let sources = self.reconstruction.iter().flat_map(|r| &r.sources);
        std::iter::once(&self.target).chain(sources)
    }
}

impl Reconstruction {
    /// Eq. 11.
    fn scale(&self, target_from_object: &Pose) -> Option<f64> {
        let TargetDepth {
            depth,
            mask,
            camera,
            points,
            surfels,
        } = self.depth.as_ref()?;
        let seen = visible_points(points, camera, target_from_object, mask.size(), Some(surfels));
        scale_from_inverse_depth(&seen, mask, depth).filter(|&alpha| alpha > 0.0)
    }
}

/// The translation that moves the projection by `shift` pixels and divides its size by `ratio`.
fn moved(camera: &Pinhole, translation: &Vector3<f64>, shift: &Vector2<f64>, ratio: f64) -> Vector3<f64> {
    let pixel = Vector2::new(
        camera.fx * translation.x / translation.z + camera.cx + shift.x,
        camera.fy * translation.y / translation.z + camera.cy + shift.y,
    );
    camera.unproject(&pixel, (translation.z * ratio).max(NEAREST_DEPTH))
}
