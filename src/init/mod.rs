//! The start of the optimisation (Sec. 2.4): style, pose hypotheses from silhouettes, scale and motion.

mod hypotheses;
mod initialise;
mod motion;
mod placement;
mod scale;
mod silhouette;
mod templates;
#[cfg(test)]
mod testing;

pub use hypotheses::{HypothesisOptions, PoseHypothesis, pose_hypotheses};
pub use initialise::{InitError, InitOptions, Initialisation, initialise, initialise_at};
pub use motion::motion_from_input;
pub use scale::scale_from_inverse_depth;
pub use templates::TemplateGrid;

use crate::geometry::{Pose, RelativePose};
use serde::{Deserialize, Serialize};

/// Every variable of the problem: what initialisation hands to the solver, and what the solver refines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// p0: `camera_from_object` of the target frame (frame 0).
    pub target_from_object: Pose,
    /// Δp_l for l = 1..L−1 (index l − 1).
    pub motion: Vec<RelativePose>,
    /// s, S entries.
    pub style: Vec<f64>,
    /// α: x_cam = α x'_cam (Eq. 10).
    pub alpha: f64,
}

impl Estimate {
    /// L.
    pub fn frame_count(&self) -> usize {
        self.motion.len() + 1
    }

    /// p_l for l = 0..L−1 (Eq. 2).
    pub fn camera_from_object(&self, frame: usize) -> Pose {
        match frame {
            0 => self.target_from_object,
            l => self.motion[l - 1].compose(&self.target_from_object),
        }
    }

    /// The same cameras and shape for the frames in the order that [`Sequence::put_back`] restores, whose first
    /// frame's pose is p0 then.
    ///
    /// [`Sequence::put_back`]: crate::sequence::Sequence::put_back
    pub fn put_back(&mut self, target: usize) {
        self.reorder(|poses| poses[..=target].rotate_left(1));
    }

    /// The same cameras and shape for the frames in the order that [`Sequence::bring_to_front`] makes.
    ///
    /// [`Sequence::bring_to_front`]: crate::sequence::Sequence::bring_to_front
    pub fn bring_to_front(&mut self, target: usize) {
        self.reorder(|poses| poses[..=target].rotate_right(1));
    }

    fn reorder(&mut self, order: impl FnOnce(&mut [Pose])) {
        let mut poses: Vec<Pose> = (0..self.frame_count())
            .map(|l| self.camera_from_object(l))
            .collect();
        order(&mut poses);
        self.target_from_object = poses[0];
        self.motion = poses[1..]
            .iter()
            .map(|pose| RelativePose::between(&poses[0], pose))
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};

    #[test]
    fn putting_the_target_back_keeps_every_camera() {
        let pose = |i: usize| Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.3 * i as f64, -0.2, 0.1)),
            translation: Vector3::new(0.1 * i as f64, -0.1, 1.5 + i as f64),
        };
        // Frame 2 of 0, 1, 2, 3 is the target.
        let solved = [2, 0, 1, 3].map(pose);
        let mut estimate = Estimate {
            target_from_object: solved[0],
            motion: solved[1..]
                .iter()
                .map(|p| RelativePose::between(&solved[0], p))
                .collect(),
            style: vec![0.5],
            alpha: 0.7,
        };
        estimate.put_back(2);
        for frame in 0..4 {
            let (found, expected) = (estimate.camera_from_object(frame), pose(frame));
            assert!(
                (found.rotation.matrix() - expected.rotation.matrix()).norm() < 1e-12,
                "{frame}"
            );
            assert!(
                (found.translation - expected.translation).norm() < 1e-12,
                "{frame}"
            );
        }
        estimate.bring_to_front(2);
        assert!((estimate.target_from_object.translation - solved[0].translation).norm() < 1e-12);
    }
}
