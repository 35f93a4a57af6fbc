//! Eq. 8: α from the camera motion, once the poses are trusted.

use crate::geometry::{Pose, Vector3};
use crate::init::Estimate;
use serde::{Deserialize, Serialize};

/// Off-the-shelf translations |b| below this share of the camera's distance are noise: they carry no scale.
const NEGLIGIBLE_TRANSLATION: f64 = 1e-3;

/// The method by which α of Eq. 6 is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleUpdate {
    /// As a variable of every solver call: what scale there is comes from the prior's size in the images.
    Variable,
    /// The paper's: held during a call, then Eq. 8, the mean of α_l = ⟨a_l, b_l⟩ / ⟨b_l, b_l⟩. Noise in the
    /// off-the-shelf poses lengthens b_l and so shortens α; as Eq. 6 ties the depth to α, the loss repeats at
    /// every step and the object creeps towards the camera.
    Regression,
}

/// α of Eq. 8 from a_l = R_l x̄ + t_l − R'_l R'_0ᵀ (R_0 x̄ + t_0) and b_l = t'_l − R'_l R'_0ᵀ t'_0, a_l = α b_l.
///
/// The inner sum of Eq. 8 runs over the points and is linear in them, so only their mean x̄ (object frame)
/// counts. `camera_from_input` holds R', t' per frame, `None` where a frame has none.
///
/// Frames with |b| ≈ 0 (no translation) are left out. `None`, meaning "keep the α there is", where no frame is
/// left, the target has no pose, or α is not positive: poses that far off say nothing about scale.
pub fn scale_from_motion(
    estimate: &Estimate,
    target: usize,
    camera_from_input: &[Option<Pose>],
    mean_point: &Vector3<f64>,
) -> Option<f64> {
    let target_from_input = (*camera_from_input.get(target)?)?;
    let sources: Vec<(usize, Pose)> = camera_from_input
        .iter()
        .enumerate()
        .take(estimate.frame_count())
        .filter(|&(frame, _)| frame != target)
        .filter_map(|(frame, pose)| pose.map(|pose| (frame, pose.after(&target_from_input.inverse()))))
        .collect();
    let lengths = sources.iter().map(|(_, pose)| pose.translation.norm());
    let negligible = NEGLIGIBLE_TRANSLATION * lengths.fold(target_from_input.translation.norm(), f64::max);
    let point_in_target = estimate.camera_from_object[target].transform(mean_point);
    let scales: Vec<f64> = sources
        .iter()
        .filter(|(_, source_from_target)| source_from_target.translation.norm() > negligible)
        .map(|(frame, source_from_target)| {
            let a = estimate.camera_from_object[*frame].transform(mean_point)
                - source_from_target.rotation * point_in_target;
            let b = source_from_target.translation;
            a.dot(&b) / b.norm_squared()
        })
        .collect();
    let alpha = scales.iter().sum::<f64>() / scales.len() as f64;
    (alpha.is_finite() && alpha > 0.0).then_some(alpha)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;
    use crate::image::{DepthMap, Mask};
    use crate::init::{cameras_from_input, scale_from_inverse_depth};
    use crate::visibility::{Visibility, VisiblePoint};
    use proptest::prelude::*;

    fn any_pose() -> impl Strategy<Value = Pose> {
        let three = || proptest::array::uniform3(-2.0..2.0f64);
        (three(), three()).prop_map(|(omega, t)| Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::from(omega)),
            translation: Vector3::from(t) + Vector3::new(0.0, 0.0, 5.0),
        })
    }

    /// The off-the-shelf poses that stand in the relation x_cam = α x'_cam (Eq. 10) to the true ones, the input
    /// frame being the object frame scaled by 1 / α and moved by `input_from_object`.
    fn off_the_shelf(truth: &[Pose], alpha: f64, input_from_object: &Pose) -> Vec<Pose> {
        let to_input = |camera_from_object: &Pose| {
            let scaled = Pose {
                translation: camera_from_object.translation / alpha,
                ..*camera_from_object
            };
            scaled.after(&input_from_object.inverse())
        };
        truth.iter().map(to_input).collect()
    }

    proptest! {
        /// Eq. 8, 11 and 13 each recover their unknown exactly from a consistent reconstruction.
        #[test]
        fn a_consistent_reconstruction_is_recovered(
            truth in proptest::collection::vec(any_pose(), 2..6),
            alpha in 0.1..10.0f64,
            input_from_object in any_pose(),
            points in proptest::collection::vec(proptest::array::uniform3(-0.5..0.5f64), 1..20),
            target in 0..2usize,
        ) {
            let input = off_the_shelf(&truth, alpha, &input_from_object);
            for point in &points {
                let point = Vector3::from(*point);
                for (camera, input_camera) in truth.iter().zip(&input) {
                    let in_input = input_from_object.transform(&(point / alpha));
                    let gap = camera.transform(&point) - alpha * input_camera.transform(&in_input);
                    prop_assert!(gap.norm() < 1e-9, "the scene itself is wrong");
                }
            }

            let cameras = cameras_from_input(&truth[target], target, &input, alpha);
            for (found, camera) in cameras.iter().zip(&truth) {
                prop_assert!((found.translation - camera.translation).norm() < 1e-8);
                prop_assert!((found.rotation.matrix() - camera.rotation.matrix()).norm() < 1e-9);
            }

            let estimate = Estimate {
                camera_from_object: cameras, style: vec![], alpha: 1.0, focal_factor: 1.0,
            };
            let mean = points.iter().map(|p| Vector3::from(*p)).sum::<Vector3<f64>>() / points.len() as f64;
            let poses: Vec<_> = input.iter().copied().map(Some).collect();
            let shift = |pose: &Pose| pose.after(&input[target].inverse()).translation.norm();
            let sources = || input.iter().enumerate().filter(|&(l, _)| l != target).map(|(_, pose)| pose);
            let longest = sources().map(shift).fold(input[target].translation.norm(), f64::max);
            prop_assume!(sources().all(|pose| shift(pose) > 2e-3 * longest));
            let found = scale_from_motion(&estimate, target, &poses, &mean).unwrap();
            prop_assert!((found / alpha - 1.0).abs() < 1e-6);

            let depths: Vec<f64> = points.iter().map(|p| truth[0].transform(&Vector3::from(*p)).z).collect();
            let visibility = Visibility {
                points: depths.iter().enumerate().map(|(i, z)| VisiblePoint {
                    pixel: (i as u32, 0), point: i as u32, inverse_depth: 1.0 / z,
                }).collect(),
                ..Visibility::default()
            };
            let depth = DepthMap::from_vec(depths.len(), 1, depths.iter().map(|z| (z / alpha) as f32).collect()).unwrap();
            let mask = Mask::filled(depths.len(), 1, true);
            let found = scale_from_inverse_depth(&visibility, &mask, &depth).unwrap();
            prop_assert!((found / alpha - 1.0).abs() < 1e-5, "f32 depth");
        }
    }

    fn walk(translations: &[f64], alpha: f64) -> (Estimate, Vec<Option<Pose>>) {
        let poses: Vec<Pose> = translations
            .iter()
            .map(|&x| Pose {
                rotation: Rotation3::identity(),
                translation: Vector3::new(x, 0.0, 3.0),
            })
            .collect();
        let estimate = Estimate {
            camera_from_object: cameras_from_input(&poses[0], 0, &poses, alpha),
            style: vec![],
            alpha: 1.0,
            focal_factor: 1.0,
        };
        (estimate, poses.into_iter().map(Some).collect())
    }

    #[test]
    fn frames_without_translation_or_pose_are_left_out() {
        let (estimate, mut input) = walk(&[0.0, 0.0, 1.0, 2.0], 0.7);
        assert!((scale_from_motion(&estimate, 0, &input, &Vector3::zeros()).unwrap() - 0.7).abs() < 1e-12);
        input[3] = None;
        assert!((scale_from_motion(&estimate, 0, &input, &Vector3::zeros()).unwrap() - 0.7).abs() < 1e-12);
        let (estimate, input) = walk(&[1.0, 1.0, 1.0], 0.7);
        assert_eq!(scale_from_motion(&estimate, 0, &input, &Vector3::zeros()), None);
    }

    #[test]
    fn a_motion_that_runs_backwards_gives_no_scale() {
        let (estimate, input) = walk(&[0.0, 1.0, 2.0], -0.4);
        assert_eq!(scale_from_motion(&estimate, 0, &input, &Vector3::zeros()), None);
    }
}
