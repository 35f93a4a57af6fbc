//! The start of the optimisation (Sec. 2.4): style, pose hypotheses from silhouettes, scale and motion.

mod cloud;
mod hypotheses;
mod initialise;
mod motion;
mod placement;
mod scale;
mod silhouette;
mod templates;
#[cfg(test)]
mod testing;

pub use hypotheses::{HypothesisOptions, PoseHypothesis};
pub(crate) use initialise::chosen;
pub use initialise::{InitError, InitOptions, Initialisation, initialise, initialise_at, initialise_while};
pub use motion::cameras_from_input;
pub use scale::scale_from_inverse_depth;
pub use templates::TemplateGrid;

use crate::geometry::{Pinhole, Pose, Similarity};
use crate::sequence::Sequence;
use serde::{Deserialize, Serialize};

/// Every variable of the problem: what initialisation hands to the solver, and what the solver refines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// p_l: one per frame of the sequence, in its order.
    pub camera_from_object: Vec<Pose>,
    /// The style s, S entries.
    pub style: Vec<f64>,
    /// α: x_cam = α x'_cam (Eq. 10).
    pub alpha: f64,
    /// By which all focal lengths are multiplied; 1 unless the solver was asked to find it.
    pub focal_factor: f64,
}

impl Estimate {
    /// The number of frames.
    pub fn frame_count(&self) -> usize {
        self.camera_from_object.len()
    }

    /// How the frame of the off-the-shelf reconstruction lies in the object's. From x_cam = α x'_cam (Eq. 10), x_cam = R x + t and
    /// x'_cam = R' x' + t' of the first frame with an input pose: x = α Rᵀ R' x' + Rᵀ (α t' − t). `None` where no frame has one.
    pub fn object_from_input(&self, sequence: &Sequence) -> Option<Similarity> {
        let known = sequence.frames.iter().zip(&self.camera_from_object);
        let (object, input) = known
            .filter_map(|(frame, object)| Some((object, frame.camera_from_input?)))
            .next()?;
        let object_from_camera = object.rotation.inverse();
        Some(Similarity {
            scale: self.alpha,
            rotation: object_from_camera * input.rotation,
            translation: object_from_camera * (self.alpha * input.translation - object.translation),
        })
    }

    /// The same cameras before the same shape, in another frame and unit of it.
    pub fn in_frame(&self, to_from_object: &Similarity) -> Self {
        let scale = to_from_object.scale;
        let moved = |pose: &Pose| {
            let rotation = pose.rotation * to_from_object.rotation.inverse();
            Pose {
                rotation,
                translation: scale * pose.translation - rotation * to_from_object.translation,
            }
        };
        Self {
            camera_from_object: self.camera_from_object.iter().map(moved).collect(),
            alpha: scale * self.alpha,
            ..self.clone()
        }
    }

    /// A frame's camera with the focal factor.
    pub fn camera(&self, camera: &Pinhole) -> Pinhole {
        Pinhole {
            fx: self.focal_factor * camera.fx,
            fy: self.focal_factor * camera.fy,
            ..*camera
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};

    #[test]
    fn another_frame_shows_the_same() {
        let pose = Pose {
            rotation: Rotation3::from_scaled_axis(Vector3::new(0.2, -0.5, 0.1)),
            translation: Vector3::new(0.1, -0.2, 1.7),
        };
        let estimate = Estimate {
            camera_from_object: vec![pose],
            style: vec![0.5],
            alpha: 0.3,
            focal_factor: 1.0,
        };
        let to_from_object = Similarity {
            scale: 1.25,
            rotation: Rotation3::from_scaled_axis(Vector3::new(-0.1, 0.3, 0.2)),
            translation: Vector3::new(0.0, 0.02, -0.01),
        };
        let moved = estimate.in_frame(&to_from_object);
        let x = Vector3::new(0.1, 0.2, -0.4);
        let seen = moved.camera_from_object[0].transform(&to_from_object.transform(&x));
        assert!((seen - 1.25 * pose.transform(&x)).norm() < 1e-12);
        assert!((moved.alpha - 0.375).abs() < 1e-12 && moved.style == [0.5]);
    }
}
