//! Rigid motions, twists and the pinhole camera (Eq. 1–3): pure functions on nalgebra types.

mod camera;
mod pose;
mod similarity;

pub use camera::Pinhole;
pub use pose::{Pose, RelativePose};
pub use similarity::Similarity;

pub use nalgebra::{Matrix3, Matrix4, Point2, Point3, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4};
