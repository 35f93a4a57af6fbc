//! An estimate against a rendered sequence's truth (Sec. 3.2, Table 1).

use super::{DepthPairs, Estimated, MeanMax, align_to_truth, chamfer, location_error, orientation_error_deg};
use crate::geometry::{Pose, Vector3};
use crate::image::DepthMap;
use crate::report::{density, silhouette_iou};
use crate::sequence::Truth;
use serde::{Deserialize, Serialize};

/// One frame's errors. Lengths in object units unless the name says otherwise (diagonal 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameErrors {
    /// The frame's name.
    pub name: String,
    /// The angle between the estimated and the true rotation of the camera in the object frame, degrees.
    pub orientation_error_deg: f64,
    /// Distance of the camera centres, % of the object's diagonal.
    pub location_error_percent: f64,
    /// Mean |z − z_true| over the pixels known in both.
    pub depth_error: Option<f64>,
    /// The share of the true silhouette's pixels with an estimated depth.
    pub density: Option<f64>,
    /// The IoU of the estimated shape's silhouette with the true one, in \[0, 1\].
    pub silhouette_iou: Option<f64>,
}

/// [`FrameErrors`] and their summary; means are over frames, the depth error's over pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruthErrors {
    /// The orientation error over the frames, degrees; `None` without a frame of known truth.
    pub orientation_error_deg: Option<MeanMax>,
    /// The location error over the frames, % of the object's diagonal; `None` without a frame of known truth.
    pub location_error_percent: Option<MeanMax>,
    /// The same two after the first camera is given and the scale fitted (Eq. 8), as the paper judges methods without an
    /// object frame: what is left when the frame's own error is forgiven. The first camera's 0 counts in the means.
    pub aligned_orientation_error_deg: Option<MeanMax>,
    /// The location error after the first camera is given and the scale fitted, % of the object's diagonal.
    pub aligned_location_error_percent: Option<MeanMax>,
    /// Mean \|z − z_true\| over the pixels of all frames that are known in both, object units; `None` without such pixels.
    pub depth_error: Option<f64>,
    /// The depth error once all depths are multiplied by one more number, the same in every frame, that makes it least
    /// ([`DepthPairs::best_scale`]): what is left when the scale's own error is forgiven.
    pub depth_error_at_best_scale: Option<f64>,
    /// That number; 1 where the depths' scale is right.
    pub best_depth_scale: Option<f64>,
    /// The mean density over the frames that have one.
    pub density_mean: Option<f64>,
    /// The mean silhouette IoU over the frames that have one.
    pub silhouette_iou_mean: Option<f64>,
    /// ½ of both mean nearest-neighbour distances to the true shape, % of the diagonal.
    pub chamfer_percent: Option<f64>,
    /// The errors frame by frame, in the sequence's order.
    pub frames: Vec<FrameErrors>,
}

/// Frames whose index lies beyond the truth are left out.
pub fn against_truth(estimated: &Estimated, truth: &Truth) -> TruthErrors {
    let mut pooled = DepthPairs::default();
    let mut frames = Vec::new();
    for ((name, index, pose), depth) in estimated.frames.iter().zip(&estimated.depth) {
        let (Some(true_pose), Some(true_depth)) =
            (truth.camera_from_object.get(*index), truth.depth.get(*index))
        else {
            continue;
        };
        let covered = depth.as_ref().map(DepthMap::known);
        let pairs = depth
            .as_ref()
            .map(|depth| DepthPairs::between(depth, true_depth))
            .unwrap_or_default();
        let depth_error = pairs.error(estimated.depth_scale);
        pooled.extend(pairs);
        let silhouette = true_depth.known();
        frames.push(FrameErrors {
            name: name.clone(),
            orientation_error_deg: orientation_error_deg(&pose.rotation, &true_pose.rotation),
            location_error_percent: 100.0 * location_error(pose, true_pose),
            depth_error,
            density: covered.as_ref().map(|covered| density(&silhouette, covered)),
            silhouette_iou: covered
                .filter(|_| estimated.dense)
                .map(|covered| silhouette_iou(&silhouette, &covered)),
        });
    }
    let posed: Vec<(Pose, Pose)> = estimated
        .frames
        .iter()
        .filter_map(|(_, index, pose)| Some((*pose, *truth.camera_from_object.get(*index)?)))
        .collect();
    let true_poses: Vec<Pose> = posed.iter().map(|&(_, true_pose)| true_pose).collect();
    let poses: Vec<_> = posed.iter().map(|&(pose, _)| Some(pose)).collect();
    let aligned: Vec<(Pose, Pose)> = align_to_truth(&poses, &true_poses)
        .map(|(aligned, _)| aligned.into_iter().flatten().zip(true_poses).collect())
        .unwrap_or_default();
    let true_shape: Vec<_> = truth
        .shape
        .iter()
        .map(|p| Vector3::from(*p).map(f64::from))
        .collect();
    let mean =
        |value: fn(&FrameErrors) -> Option<f64>| MeanMax::of(frames.iter().filter_map(value)).map(|m| m.mean);
    let best_scale = pooled.best_scale();
    TruthErrors {
        orientation_error_deg: MeanMax::of(frames.iter().map(|frame| frame.orientation_error_deg)),
        location_error_percent: MeanMax::of(frames.iter().map(|frame| frame.location_error_percent)),
        aligned_orientation_error_deg: MeanMax::of(
            aligned
                .iter()
                .map(|(pose, truth)| orientation_error_deg(&pose.rotation, &truth.rotation)),
        ),
        aligned_location_error_percent: MeanMax::of(
            aligned
                .iter()
                .map(|(pose, truth)| 100.0 * location_error(pose, truth)),
        ),
        depth_error: pooled.error(estimated.depth_scale),
        depth_error_at_best_scale: best_scale.and_then(|scale| pooled.error(scale)),
        best_depth_scale: best_scale.map(|scale| scale / estimated.depth_scale),
        density_mean: mean(|frame| frame.density),
        silhouette_iou_mean: mean(|frame| frame.silhouette_iou),
        chamfer_percent: estimated
            .shape
            .as_ref()
            .and_then(|shape| chamfer(shape, &true_shape))
            .map(|distance| 100.0 * distance),
        frames,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;
    use crate::image::Grid;
    use crate::report::Surface;
    use crate::report::fixture::{box_car, solved};

    #[test]
    fn known_errors_are_found() {
        let (sequence, _) = solved(&Surface::from_points(box_car(2000)), 3);
        let truth = sequence.truth.clone().unwrap();
        // Every camera turned in place by 2° and moved by 0.03 in the object frame; depth off by 0.01 and half
        // of it missing; the shape far away.
        let wrong = |pose: &Pose| {
            let rotation =
                Rotation3::from_scaled_axis(Vector3::new(0.0, 2f64.to_radians(), 0.0)) * pose.rotation;
            Pose {
                rotation,
                translation: -(rotation * (pose.center() + Vector3::new(0.03, 0.0, 0.0))),
            }
        };
        let half = |depth: &DepthMap| {
            let data = depth.data().iter().enumerate();
            let data = data
                .map(|(i, z)| {
                    if *z > 0.0 && i % 2 == 0 {
                        0.5 * (z + 0.01)
                    } else {
                        0.0
                    }
                })
                .collect();
            Grid::from_vec(depth.width(), depth.height(), data).unwrap()
        };
        let shape = truth
            .shape
            .iter()
            .map(|p| Vector3::from(*p).map(f64::from) + Vector3::new(0.0, 9.0, 0.0));
        let estimated = Estimated {
            frames: (0..3)
                .map(|i| (format!("{i}"), i, wrong(&truth.camera_from_object[i])))
                .collect(),
            depth: truth.depth.iter().map(|depth| Some(half(depth))).collect(),
            depth_scale: 2.0,
            dense: true,
            shape: Some(shape.collect()),
        };
        let errors = against_truth(&estimated, &truth);
        assert!((errors.orientation_error_deg.unwrap().max - 2.0).abs() < 1e-9);
        assert!((errors.location_error_percent.unwrap().mean - 3.0).abs() < 1e-9);
        assert!((errors.depth_error.unwrap() - 0.01).abs() < 1e-6);
        // 0.01 of depths of about 1.6: nearly all of it is scale.
        assert!(errors.depth_error_at_best_scale.unwrap() < 0.002);
        assert!((errors.density_mean.unwrap() - 0.5).abs() < 0.02);
        assert_eq!(errors.silhouette_iou_mean, errors.density_mean);
        assert!(errors.chamfer_percent.unwrap() > 800.0);
    }

    #[test]
    fn a_wrong_object_frame_is_forgiven_once_the_first_camera_is_given() {
        let (sequence, _) = solved(&Surface::from_points(box_car(200)), 4);
        let truth = sequence.truth.clone().unwrap();
        let turn = Rotation3::from_scaled_axis(Vector3::new(0.0, 3f64.to_radians(), 0.0));
        // The object frame turned, moved and scaled; in frame 2 the camera turned by 1° in place on top of that.
        let wrong = |(index, pose): (usize, &Pose)| {
            let rotation = pose.rotation * turn;
            let center = turn.inverse() * (pose.center() * 1.2 + Vector3::new(0.1, 0.0, 0.2));
            let more = if index == 2 { 1f64.to_radians() } else { 0.0 };
            let rotation = Rotation3::from_scaled_axis(Vector3::new(more, 0.0, 0.0)) * rotation;
            let pose = Pose {
                rotation,
                translation: -(rotation * center),
            };
            (index.to_string(), index, pose)
        };
        let estimated = Estimated {
            frames: truth.camera_from_object.iter().enumerate().map(wrong).collect(),
            depth: vec![None; 4],
            depth_scale: 1.0,
            dense: true,
            shape: None,
        };
        let errors = against_truth(&estimated, &truth);
        assert!(errors.orientation_error_deg.unwrap().mean > 2.9);
        assert!(errors.location_error_percent.unwrap().mean > 10.0);
        let orientation = errors.aligned_orientation_error_deg.unwrap();
        assert!((orientation.max - 1.0).abs() < 1e-9 && (orientation.mean - 0.25).abs() < 1e-9);
        assert!(errors.aligned_location_error_percent.unwrap().max < 1e-9);
    }

    #[test]
    fn a_wrong_scale_of_the_depth_is_forgiven_at_the_best_scale() {
        let (sequence, _) = solved(&Surface::from_points(box_car(500)), 3);
        let truth = sequence.truth.clone().unwrap();
        let twice = |depth: &DepthMap| {
            let data = depth.data().iter().map(|z| 2.0 * z).collect();
            Grid::from_vec(depth.width(), depth.height(), data).unwrap()
        };
        let estimated = Estimated {
            frames: (0..3)
                .map(|i| (format!("{i}"), i, truth.camera_from_object[i]))
                .collect(),
            depth: truth.depth.iter().map(|depth| Some(twice(depth))).collect(),
            depth_scale: 0.625,
            dense: true,
            shape: None,
        };
        let errors = against_truth(&estimated, &truth);
        // A quarter of the depth itself, which is the distance of the car.
        assert!(errors.depth_error.unwrap() > 0.2);
        assert_eq!(errors.depth_error_at_best_scale, Some(0.0));
        assert_eq!(errors.best_depth_scale, Some(0.8));
    }

    #[test]
    fn what_is_not_there_is_not_measured() {
        let (sequence, _) = solved(&Surface::from_points(box_car(500)), 2);
        let truth = sequence.truth.clone().unwrap();
        let estimated = Estimated {
            frames: vec![
                ("a".into(), 1, truth.camera_from_object[1]),
                ("b".into(), 7, Pose::identity()),
            ],
            depth: vec![None, None],
            depth_scale: 1.0,
            dense: false,
            shape: None,
        };
        let errors = against_truth(&estimated, &truth);
        assert_eq!(errors.frames.len(), 1);
        assert_eq!(
            (errors.depth_error, errors.density_mean, errors.chamfer_percent),
            (None, None, None)
        );
        assert_eq!(
            (errors.depth_error_at_best_scale, errors.best_depth_scale),
            (None, None)
        );
    }
}
