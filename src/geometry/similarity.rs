//! Similarities (Sim3): how the canonical object frame sits in the frame of an off-the-shelf reconstruction.

use nalgebra::{Rotation3, Vector3};

/// A similarity transform `b_from_a`: `x_b = scale · rotation x_a + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// The factor by which lengths grow from frame a to frame b; more than 0.
    pub scale: f64,
    /// The rotation from frame a to frame b.
    pub rotation: Rotation3<f64>,
    /// The origin of frame a in frame b, in units of b.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// The point `x_b` in frame b of `x_a` in frame a.
    pub fn transform(&self, point_in_a: &Vector3<f64>) -> Vector3<f64> {
        self.scale * (self.rotation * point_in_a) + self.translation
    }

    /// The inverse transform `a_from_b`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        let scale = 1.0 / self.scale;
        Self {
            scale,
            rotation,
            translation: -scale * (rotation * self.translation),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn inverse_undoes(omega in proptest::array::uniform3(-2.0..2.0f64), t in proptest::array::uniform3(-5.0..5.0f64),
                          scale in 0.1..10.0f64, x in proptest::array::uniform3(-5.0..5.0f64)) {
            let similarity = Similarity {
                scale,
                rotation: Rotation3::from_scaled_axis(Vector3::from(omega)),
                translation: Vector3::from(t),
            };
            let x = Vector3::from(x);
            prop_assert!((similarity.inverse().transform(&similarity.transform(&x)) - x).norm() < 1e-9);
        }
    }
}
