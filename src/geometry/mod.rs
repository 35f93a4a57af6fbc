//! Rigid motions, twists and the pinhole camera (Eq. 1–3): pure functions on nalgebra types.

mod camera;
mod plane;
mod pose;
mod similarity;

pub use camera::Pinhole;
pub use plane::tangent_plane;
pub use pose::{Pose, RelativePose};
pub use similarity::Similarity;

/// The canonical object frame, in words for files; `cad::Mesh::normalise` makes it.
pub const OBJECT_FRAME: &str = "+Y up, -Z front, the body's box centred at the origin with diagonal 1 (beyond each of its faces \
                                lies 1 % of the surface: antennas, mirrors)";

pub use nalgebra::{Matrix3, Matrix4, Point2, Point3, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4};
