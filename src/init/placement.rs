//! Where a template has to stand: the translation (and with off-the-shelf poses α) that makes its silhouettes
//! agree with the masks in place and size.

use super::cameras_from_input;
use super::cloud::Cloud;
use super::scale::scale_from_inverse_depth;
use super::silhouette::{Observation, Silhouette};
use crate::geometry::{Matrix3, Matrix4, Pinhole, Pose, Rotation3, Vector2, Vector3, Vector4};
use crate::image::{DepthMap, Mask};
use crate::surface::spacing;
use crate::visibility::{Cover, visible_points};

/// No part of an object of diagonal 1 is then behind the camera.
const MIN_DEPTH: f64 = 0.55;
/// Rounds of matching bounding boxes, which works from anywhere, then areas and centroids, which is exact.
const BOX_ROUNDS: usize = 4;
const AREA_ROUNDS: usize = 5;
/// The latter end where the centroid is moved by less, and the size changed by less.
const PLACED_PX: f64 = 0.2;
const PLACED_RATIO: f64 = 0.002;
/// Rounds of fitting translation and α to all frames.
const JOINT_ROUNDS: usize = 4;
/// How strongly the joint fit holds on to its present α, as a share of what the centroids say per frame: decides
/// only where the motion is too small for them to say anything.
const ALPHA_HOLD: f64 = 0.02;

/// What templates are rendered of.
pub(super) struct Shape {
    /// Object frame, as visibility wants them: xyz after xyz.
    points: Vec<f64>,
    /// The same points, laid out for rendering.
    cloud: Cloud,
    /// The median distance from a point to its nearest neighbour.
    spacing: f64,
    /// What hides points; `None` where there are so few of them that they hide each other in coarse pixels.
    cover: Option<Cover>,
}

impl Shape {
    /// Of points sampled evenly from a surface (xyz after xyz, object frame), and what hides them.
    pub fn new(points: &[f64], cover: Option<Cover>) -> Self {
        let vectors: Vec<_> = points.chunks_exact(3).map(Vector3::from_column_slice).collect();
        Self {
            points: points.to_vec(),
            spacing: spacing(&vectors),
            cloud: vectors.into_iter().collect(),
            cover,
        }
    }

    /// The shape of the first points alone, a share of all: rough, and quick.
    pub fn first(&self, share: f64) -> Self {
        let count = (share * (self.points.len() / 3) as f64).ceil() as usize;
        Self::new(&self.points[..3 * count], None)
    }

    /// Lowest and highest corner of its image's bounding box, pixels; `None` where it is behind the camera.
    fn bounds(&self, camera: &Pinhole, camera_from_object: &Pose) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let Pinhole { fx, fy, cx, cy } = *camera;
        let matrix = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        self.cloud.bounds(&matrix, camera_from_object)
    }

    /// The shape's silhouette in `frame`.
    pub fn render(&self, frame: &Observation, camera_from_object: &Pose) -> Silhouette {
        frame.render(&self.cloud, self.spacing, camera_from_object)
    }
}

/// What the frames show of the object: the evidence by which templates are placed.
pub(super) struct Evidence {
    pub target: Observation,
    pub reconstruction: Option<Reconstruction>,
}

/// What the off-the-shelf tools say, for a few frames spread over the sequence.
pub(super) struct Reconstruction {
    /// One per chosen frame, the target first.
    pub camera_from_input: Vec<Pose>,
    /// The observations of the chosen source frames.
    pub sources: Vec<Observation>,
    pub depth: Option<TargetDepth>,
    /// The same in coarse pixels, for few points.
    pub coarse_depth: Option<TargetDepth>,
}

/// The target's off-the-shelf depth, at any resolution.
pub(super) struct TargetDepth {
    pub depth: DepthMap,
    pub mask: Mask,
    pub camera: Pinhole,
}

/// A placed template.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub target_from_object: Pose,
    /// α of Eq. 10; `None` without a reconstruction.
    pub alpha: Option<f64>,
    /// Silhouette IoU in the target frame.
    pub target_iou: f64,
    /// Over the chosen frames, the target included; the target's alone without a reconstruction.
    pub mean_iou: f64,
}

/// A placed template and its silhouettes in all chosen frames, the target first.
pub(super) struct Shown {
    pub placement: Placement,
    silhouettes: Vec<Silhouette>,
}

impl Evidence {
    /// The template where the target's mask alone and the depth there put it. `None` where the template cannot be
    /// brought onto the mask.
    pub fn place_by_target(&self, shape: &Shape, rotation: &Rotation3<f64>) -> Option<Shown> {
        let translation = self.place_in(shape, &self.target, rotation)?;
        let alone = Pose {
            rotation: *rotation,
            translation,
        };
        let alpha = self.reconstruction.as_ref().map(|reconstruction| {
            let scale = reconstruction.scale(shape, &alone);
            scale.or_else(|| self.scale_from_centroids(&alone)).unwrap_or(1.0)
        });
        Some(self.show(shape, alone, alpha))
    }

    /// The best of a few rounds that bring all frames' silhouettes onto their masks together; `start` where none is
    /// better.
    pub fn place_by_all(&self, shape: &Shape, start: Shown) -> Placement {
        let mut best = start.placement;
        let mut current = start;
        for _ in 0..JOINT_ROUNDS {
            let Some((target_from_object, alpha)) = self.fit_all_frames(&current) else {
                break;
            };
            current = self.show(shape, target_from_object, Some(alpha));
            if current.placement.mean_iou > best.mean_iou {
                best = current.placement;
            }
        }
        best
    }

    /// The translation at which the silhouette has the mask's area and centroid in one frame.
    pub fn place_in(
        &self,
        shape: &Shape,
        frame: &Observation,
        rotation: &Rotation3<f64>,
    ) -> Option<Vector3<f64>> {
        let pose = |translation| Pose {
            rotation: *rotation,
            translation,
        };
        let (low, high) = frame.bounds_px;
        let camera = &frame.camera;
        let mut translation = camera.unproject(&((low + high) / 2.0), 2.0);
        for _ in 0..BOX_ROUNDS {
            let (model_low, model_high) = shape.bounds(camera, &pose(translation))?;
            let ratio = (model_high - model_low).norm() / (high - low).norm();
            let shift = (low + high - model_low - model_high) / 2.0;
            translation = moved(camera, &translation, &shift, ratio);
        }
        let goal = frame.centroid_px(&frame.mask)?;
        for _ in 0..AREA_ROUNDS {
            let rendered = shape.render(frame, &pose(translation));
            let shift = goal - frame.centroid_px(&rendered)?;
            let ratio = (f64::from(rendered.area()) / f64::from(frame.mask.area())).sqrt();
            translation = moved(camera, &translation, &shift, ratio);
            if shift.norm() < PLACED_PX && (ratio - 1.0).abs() < PLACED_RATIO {
                break;
            }
        }
        translation.iter().all(|x| x.is_finite()).then_some(translation)
    }

    /// The placement's silhouettes, and how they agree with the masks.
    fn show(&self, shape: &Shape, target_from_object: Pose, alpha: Option<f64>) -> Shown {
        let poses = match (&self.reconstruction, alpha) {
            (Some(reconstruction), Some(alpha)) => {
                cameras_from_input(&target_from_object, 0, &reconstruction.camera_from_input, alpha)
            }
            _ => vec![target_from_object],
        };
        let frames = self.frames().zip(&poses);
        let silhouettes: Vec<Silhouette> = frames.map(|(frame, pose)| shape.render(frame, pose)).collect();
        let ious = self.frames().zip(&silhouettes);
        let ious: Vec<f64> = ious.map(|(frame, rendered)| rendered.iou(&frame.mask)).collect();
        Shown {
            placement: Placement {
                target_from_object,
                alpha,
                target_iou: ious[0],
                mean_iou: ious.iter().sum::<f64>() / ious.len() as f64,
            },
            silhouettes,
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
    fn fit_all_frames(&self, shown: &Shown) -> Option<(Pose, f64)> {
        let reconstruction = self.reconstruction.as_ref()?;
        let target_from_object = shown.placement.target_from_object;
        let alpha = shown.placement.alpha?;
        let poses = cameras_from_input(&target_from_object, 0, &reconstruction.camera_from_input, alpha);
        let (mut goals, mut log_ratio) = (Vec::with_capacity(poses.len()), 0.0);
        for ((frame, pose), rendered) in self.frames().zip(&poses).zip(&shown.silhouettes) {
            let shift = frame.centroid_px(&frame.mask)? - frame.centroid_px(rendered)?;
            goals.push(frame.camera.project(&pose.translation)? + shift);
            log_ratio += (f64::from(rendered.area()) / f64::from(frame.mask.area())).ln() / 2.0;
        }
        let depths: Vec<f64> = poses.iter().map(|pose| pose.translation.z).collect();
        let solution = self.triangulate(&goals, &depths, Some((&target_from_object.translation, alpha)))?;
        let size = (log_ratio / poses.len() as f64).exp() * target_from_object.translation.norm()
            / solution.xyz().norm();
        let (translation, alpha) = (solution.xyz() * size, solution.w * size);
        (translation.z > MIN_DEPTH && alpha > 0.0 && alpha.is_finite()).then_some((
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
    /// α by Eq. 11.
    fn scale(&self, shape: &Shape, target_from_object: &Pose) -> Option<f64> {
        let known = match &shape.cover {
            Some(_) => &self.depth,
            None => &self.coarse_depth,
        };
        let TargetDepth { depth, mask, camera } = known.as_ref()?;
        let seen = visible_points(
            &shape.points,
            camera,
            target_from_object,
            mask.size(),
            shape.cover.as_ref(),
        );
        scale_from_inverse_depth(&seen, mask, depth).filter(|&alpha| alpha > 0.0)
    }
}

/// The translation that moves the projection by `shift` pixels and divides its size by `ratio`.
fn moved(camera: &Pinhole, translation: &Vector3<f64>, shift: &Vector2<f64>, ratio: f64) -> Vector3<f64> {
    let pixel = Vector2::new(
        camera.fx * translation.x / translation.z + camera.cx + shift.x,
        camera.fy * translation.y / translation.z + camera.cy + shift.y,
    );
    camera.unproject(&pixel, (translation.z * ratio).max(MIN_DEPTH))
}
