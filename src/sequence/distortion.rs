//! Lens distortion on the normalised image plane (x/z, y/z). COLMAP's camera models reduce to these kinds.

use super::error::SequenceError;
use crate::geometry::Vector2;
use std::path::Path;

/// How the lens moves an undistorted point (u, v) of the normalised plane; r² = u² + v², θ = atan r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distortion {
    None,
    /// Radial factor (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶), plus the tangential part.
    Polynomial {
        numerator: [f64; 3],
        denominator: [f64; 3],
        tangential: [f64; 2],
    },
    /// Radius θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
    Fisheye {
        k: [f64; 4],
    },
    /// Radius atan(2 r tan(ω / 2)) / ω.
    FieldOfView {
        omega: f64,
    },
    /// Equidistant fisheye (radius θ), on whose plane the radial, tangential and thin-prism parts act.
    ThinPrismFisheye {
        k: [f64; 4],
        tangential: [f64; 2],
        prism: [f64; 2],
    },
}

/// Below this radius the series' first terms are exact in f64.
const SMALL: f64 = 1e-8;

impl Distortion {
    /// Refuses coefficients that are not finite; `field` names the camera in `file`.
    pub fn check(&self, file: &Path, field: &str) -> Result<(), SequenceError> {
        for (name, value) in self.coefficients() {
            if !value.is_finite() {
                return Err(SequenceError::invalid(
                    file,
                    format!("{field}.{name}"),
                    format!("lens coefficient is {value}"),
                    "calibrate again, or choose a simpler camera model",
                ));
            }
        }
        Ok(())
    }

    /// Every coefficient by its name in COLMAP.
    fn coefficients(&self) -> Vec<(&'static str, f64)> {
        let name = |names: &[&'static str], values: &[f64]| -> Vec<(&'static str, f64)> {
            names.iter().copied().zip(values.iter().copied()).collect()
        };
        match self {
            Self::None => Vec::new(),
            Self::Polynomial {
                numerator,
                denominator,
                tangential,
            } => [
                name(&["k1", "k2", "k3"], numerator),
                name(&["k4", "k5", "k6"], denominator),
                name(&["p1", "p2"], tangential),
            ]
            .concat(),
            Self::Fisheye { k } => name(&["k1", "k2", "k3", "k4"], k),
            Self::FieldOfView { omega } => vec![("omega", *omega)],
            Self::ThinPrismFisheye { k, tangential, prism } => [
                name(&["k1", "k2", "k3", "k4"], k),
                name(&["p1", "p2"], tangential),
                name(&["sx1", "sy1"], prism),
            ]
            .concat(),
        }
    }

    /// The distorted point of an undistorted one.
    pub fn distort(&self, point: Vector2<f64>) -> Vector2<f64> {
        let r2 = point.norm_squared();
        match *self {
            Self::None => point,
            Self::Polynomial {
                numerator,
                denominator,
                tangential,
            } => {
                let radial = (1.0 + polynomial(&numerator, r2)) / (1.0 + polynomial(&denominator, r2));
                point * radial + tangential_shift(point, tangential)
            }
            Self::Fisheye { k } => {
                let angle = r2.sqrt().atan();
                equidistant(point) * (1.0 + polynomial(&k, angle * angle))
            }
            Self::FieldOfView { omega } => {
                let (r, spread) = (r2.sqrt(), 2.0 * (omega / 2.0).tan());
                if r < SMALL {
                    point * (spread / omega)
                } else {
                    point * ((r * spread).atan() / (r * omega))
                }
            }
            Self::ThinPrismFisheye { k, tangential, prism } => {
                let point = equidistant(point);
                let r2 = point.norm_squared();
                point * (1.0 + polynomial(&k, r2))
                    + tangential_shift(point, tangential)
                    + Vector2::from(prism) * r2
            }
        }
    }

    /// Whether the lens maps the neighbourhood of an undistorted point one to one. Polynomials fold back far
    /// from the centre, where calibration saw nothing; what they say there is not to be used.
    pub fn is_regular_at(&self, point: Vector2<f64>) -> bool {
        const STEP: f64 = 1e-6;
        let here = self.distort(point);
        let du = self.distort(point + Vector2::new(STEP, 0.0)) - here;
        let dv = self.distort(point + Vector2::new(0.0, STEP)) - here;
        // A fold turns the Jacobian's sign; a second one turns it back, but puts the point on the other side.
        du.x * dv.y - du.y * dv.x > 0.0 && (here.dot(&point) > 0.0 || point.norm() < SMALL)
    }
}

/// c0 x + c1 x² + …
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| (sum + c) * x)
}

/// (u, v) moved from radius r to radius atan r.
fn equidistant(point: Vector2<f64>) -> Vector2<f64> {
    let r = point.norm();
    if r < SMALL { point } else { point * (r.atan() / r) }
}

fn tangential_shift(point: Vector2<f64>, [p1, p2]: [f64; 2]) -> Vector2<f64> {
    let (u, v, r2) = (point.x, point.y, point.norm_squared());
    Vector2::new(
        2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u),
        2.0 * p2 * u * v + p1 * (r2 + 2.0 * v * v),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strong_barrel_folds_outside_its_peak() {
        // r (1 − 0.5 r²) rises up to r = √(2/3) ≈ 0.816.
        let barrel = Distortion::Polynomial {
            numerator: [-0.5, 0.0, 0.0],
            denominator: [0.0; 3],
            tangential: [0.0; 2],
        };
        for (r, regular) in [
            (0.0, true),
            (0.8, true),
            (0.83, false),
            (1.3, false),
            (1.6, false),
        ] {
            let (sin, cos) = 0.7f64.sin_cos();
            assert_eq!(
                barrel.is_regular_at(Vector2::new(r * cos, r * sin)),
                regular,
                "{r}"
            );
        }
    }

    #[test]
    fn every_coefficient_must_be_finite() {
        let mut names = Vec::new();
        for index in 0..8 {
            let value = |i: usize| if i == index { f64::NAN } else { 0.1 };
            for lens in [
                Distortion::Polynomial {
                    numerator: [value(0), value(1), value(2)],
                    denominator: [value(3), value(4), value(5)],
                    tangential: [value(6), value(7)],
                },
                Distortion::ThinPrismFisheye {
                    k: [value(0), value(1), value(2), value(3)],
                    tangential: [value(4), value(5)],
                    prism: [value(6), value(7)],
                },
            ] {
                let message = lens
                    .check(Path::new("cameras.txt"), "camera 1")
                    .unwrap_err()
                    .to_string();
                assert!(message.contains("lens coefficient is NaN"), "{message}");
                names.push(message.split(": ").nth(1).unwrap().to_owned());
            }
        }
        assert_eq!(names[0], "camera 1.k1");
        assert_eq!(names.iter().collect::<std::collections::BTreeSet<_>>().len(), 10);
        assert!(
            Distortion::Fisheye { k: [0.1; 4] }
                .check(Path::new("f"), "c")
                .is_ok()
        );
        let infinite = Distortion::FieldOfView { omega: f64::INFINITY };
        assert!(
            infinite
                .check(Path::new("f"), "c")
                .unwrap_err()
                .to_string()
                .contains("c.omega")
        );
    }

    #[test]
    fn the_centre_is_smooth() {
        for lens in [
            Distortion::Fisheye { k: [0.1; 4] },
            Distortion::FieldOfView { omega: 0.9 },
            Distortion::ThinPrismFisheye {
                k: [0.1; 4],
                tangential: [0.01; 2],
                prism: [0.01; 2],
            },
        ] {
            let scale = |r: f64| lens.distort(Vector2::new(r, 0.0)).x / r;
            assert!((scale(0.9 * SMALL) - scale(1.1 * SMALL)).abs() < 1e-7, "{lens:?}");
            assert_eq!(lens.distort(Vector2::zeros()), Vector2::zeros());
        }
    }
}
