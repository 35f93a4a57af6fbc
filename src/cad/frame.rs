//! From a file's axes to the canonical ones (+Y up, −Z front, +X right).

use super::Mesh;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// One of a file's axes, with its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Axis {
    #[serde(rename = "+x")]
    PlusX,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "+y")]
    PlusY,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "+z")]
    PlusZ,
    #[serde(rename = "-z")]
    MinusZ,
}

impl Axis {
    fn vector(self) -> Vector3<f64> {
        match self {
            Self::PlusX => Vector3::x(),
            Self::MinusX => -Vector3::x(),
            Self::PlusY => Vector3::y(),
            Self::MinusY => -Vector3::y(),
            Self::PlusZ => Vector3::z(),
            Self::MinusZ => -Vector3::z(),
        }
    }
}

/// Which of a (right-handed) file's axes point up and to the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes {
    up: Axis,
    front: Axis,
}

impl Axes {
    pub const CANONICAL: Self = Self {
        up: Axis::PlusY,
        front: Axis::MinusZ,
    };
    pub const Y_UP_Z_FRONT: Self = Self {
        up: Axis::PlusY,
        front: Axis::PlusZ,
    };
    pub const Y_UP_X_FRONT: Self = Self {
        up: Axis::PlusY,
        front: Axis::PlusX,
    };
    pub const Z_UP_Y_FRONT: Self = Self {
        up: Axis::PlusZ,
        front: Axis::PlusY,
    };

    /// The axes with these directions of up and front; `None` where both lie along one axis.
    pub fn new(up: Axis, front: Axis) -> Option<Self> {
        (up.vector().dot(&front.vector()) == 0.0).then_some(Self { up, front })
    }

    /// The rotation from the file's axes to the object frame's.
    fn canonical_from_file(self) -> Matrix3<f64> {
        let (up, front) = (self.up.vector(), self.front.vector());
        let right = front.cross(&up);
        Matrix3::from_rows(&[right.transpose(), up.transpose(), -front.transpose()])
    }
}

impl Mesh {
    /// Turns the mesh from a file's axes into the canonical ones; size stays.
    pub fn turn(&mut self, axes: Axes) {
        self.map(&axes.canonical_from_file());
    }

    /// Multiplies every vertex by `matrix`.
    pub(super) fn map(&mut self, matrix: &Matrix3<f64>) {
        for vertex in &mut self.vertices {
            *vertex = matrix * *vertex;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_of_axes_is_a_rotation_that_puts_front_at_minus_z() {
        use Axis::*;
        let all = [PlusX, MinusX, PlusY, MinusY, PlusZ, MinusZ];
        for (i, up) in all.into_iter().enumerate() {
            for (j, front) in all.into_iter().enumerate() {
                let axes = Axes::new(up, front);
                assert_eq!(axes.is_none(), i / 2 == j / 2);
                if let Some(axes) = axes {
                    let rotation = axes.canonical_from_file();
                    assert_eq!(rotation.determinant(), 1.0);
                    assert_eq!(rotation * up.vector(), Vector3::y());
                    assert_eq!(rotation * front.vector(), -Vector3::z());
                }
            }
        }
    }

    #[test]
    fn right_is_right_in_torcs() {
        assert_eq!(
            Axes::Y_UP_X_FRONT.canonical_from_file() * Vector3::z(),
            Vector3::x()
        );
        assert_eq!(Axes::CANONICAL.canonical_from_file(), Matrix3::identity());
    }
}
