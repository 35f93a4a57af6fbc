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

/// The share of the outside of a shape beyond each face of its body's box.
pub(crate) const BODY_BEYOND: f64 = 0.01;

/// The reflection in x = 0, an object's plane of symmetry.
pub fn mirror(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(-v.x, v.y, v.z)
}

pub use nalgebra::{
    Matrix3, Matrix4, Point2, Point3, Quaternion, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4,
};
