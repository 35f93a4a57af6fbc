//! COLMAP's camera models: their names, numbers and parameters, reduced to a pinhole and a distortion.

use crate::geometry::Pinhole;
use crate::sequence::SequenceError;
use crate::sequence::distortion::Distortion;
use std::path::Path;

/// One entry of `cameras.txt` or `cameras.bin`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Camera {
    pub pinhole: Pinhole,
    pub distortion: Distortion,
    /// (width, height) in pixels.
    pub size: (usize, usize),
}

/// A camera model as the file formats name it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CameraModel {
    /// In binary files.
    id: i32,
    /// In text files.
    name: &'static str,
    /// Number of parameters: focal lengths, principal point, distortion.
    pub parameter_count: usize,
}

const MODELS: [CameraModel; 11] = {
    const fn model(id: i32, name: &'static str, parameter_count: usize) -> CameraModel {
        CameraModel {
            id,
            name,
            parameter_count,
        }
    }
    [
        model(0, "SIMPLE_PINHOLE", 3),
        model(1, "PINHOLE", 4),
        model(2, "SIMPLE_RADIAL", 4),
        model(3, "RADIAL", 5),
        model(4, "OPENCV", 8),
        model(5, "OPENCV_FISHEYE", 8),
        model(6, "FULL_OPENCV", 12),
        model(7, "FOV", 5),
        model(8, "SIMPLE_RADIAL_FISHEYE", 4),
        model(9, "RADIAL_FISHEYE", 5),
        model(10, "THIN_PRISM_FISHEYE", 12),
    ]
};

impl CameraModel {
    pub fn by_id(id: i32, file: &Path) -> Result<Self, SequenceError> {
        Self::find(|model| model.id == id, &id.to_string(), file)
    }

    pub fn by_name(name: &str, file: &Path) -> Result<Self, SequenceError> {
        Self::find(|model| model.name == name, name, file)
    }

    fn find(wanted: impl Fn(&Self) -> bool, given: &str, file: &Path) -> Result<Self, SequenceError> {
        MODELS
            .into_iter()
            .find(wanted)
            .ok_or_else(|| SequenceError::UnknownCameraModel {
                file: file.to_owned(),
                model: given.escape_default().to_string(),
                known: MODELS.map(|model| model.name).join(", "),
            })
    }

    /// The camera with these parameters; `None` unless there are [`CameraModel::parameter_count`] of them.
    pub fn camera(&self, size: (usize, usize), parameters: &[f64]) -> Option<Camera> {
        let one_focal = |f, cx, cy| Pinhole { fx: f, fy: f, cx, cy };
        let two_focals = |fx, fy, cx, cy| Pinhole { fx, fy, cx, cy };
        let radial = |numerator| Distortion::Polynomial {
            numerator,
            denominator: [0.0; 3],
            tangential: [0.0; 2],
        };
        let (pinhole, distortion) = match (self.name, parameters) {
            ("SIMPLE_PINHOLE", &[f, cx, cy]) => (one_focal(f, cx, cy), Distortion::None),
            ("PINHOLE", &[fx, fy, cx, cy]) => (two_focals(fx, fy, cx, cy), Distortion::None),
            ("SIMPLE_RADIAL", &[f, cx, cy, k]) => (one_focal(f, cx, cy), radial([k, 0.0, 0.0])),
            ("RADIAL", &[f, cx, cy, k1, k2]) => (one_focal(f, cx, cy), radial([k1, k2, 0.0])),
            ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => (
                two_focals(fx, fy, cx, cy),
                Distortion::Polynomial {
                    numerator: [k1, k2, 0.0],
                    denominator: [0.0; 3],
                    tangential: [p1, p2],
                },
            ),
            ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => (
                two_focals(fx, fy, cx, cy),
                Distortion::Polynomial {
                    numerator: [k1, k2, k3],
                    denominator: [k4, k5, k6],
                    tangential: [p1, p2],
                },
            ),
            ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => (
                two_focals(fx, fy, cx, cy),
                Distortion::Fisheye { k: [k1, k2, k3, k4] },
            ),
            ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => (
                one_focal(f, cx, cy),
                Distortion::Fisheye {
                    k: [k, 0.0, 0.0, 0.0],
                },
            ),
            ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => (
                one_focal(f, cx, cy),
                Distortion::Fisheye {
                    k: [k1, k2, 0.0, 0.0],
                },
            ),
            ("FOV", &[fx, fy, cx, cy, omega]) => {
                (two_focals(fx, fy, cx, cy), Distortion::FieldOfView { omega })
            }
            ("THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1]) => (
                two_focals(fx, fy, cx, cy),
                Distortion::ThinPrismFisheye {
                    k: [k1, k2, k3, k4],
                    tangential: [p1, p2],
                    prism: [sx1, sy1],
                },
            ),
            _ => return None,
        };
        let distortion = if is_straight(&distortion) {
            Distortion::None
        } else {
            distortion
        };
        Some(Camera {
            pinhole,
            distortion,
            size,
        })
    }
}

/// A lens model whose coefficients are all zero is a pinhole and needs no resampling.
fn is_straight(distortion: &Distortion) -> bool {
    match *distortion {
        Distortion::None => true,
        Distortion::Polynomial {
            numerator,
            denominator,
            tangential,
        } => [&numerator[..], &denominator, &tangential]
            .concat()
            .iter()
            .all(|&c| c == 0.0),
        Distortion::FieldOfView { omega } => omega.abs() < 1e-6,
        Distortion::Fisheye { .. } | Distortion::ThinPrismFisheye { .. } => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vector2, Vector3};

    fn pixel(model: &str, parameters: &[f64], point: [f64; 2]) -> Vector2<f64> {
        let model = CameraModel::by_name(model, Path::new("cameras.txt")).unwrap();
        let camera = model.camera((640, 480), parameters).unwrap();
        let moved = camera.distortion.distort(Vector2::from(point));
        camera
            .pinhole
            .project(&Vector3::new(moved.x, moved.y, 1.0))
            .unwrap()
    }

    /// Known answers: what COLMAP itself (pycolmap 4.2.1, `Camera.img_from_cam`) gives.
    #[test]
    fn every_model_projects_where_colmap_does() {
        let cases: [(&str, &[f64], [f64; 2]); 11] = [
            ("SIMPLE_PINHOLE", &[500., 320., 240.], [470.0, 40.0]),
            ("PINHOLE", &[500., 480., 320., 240.], [470.0, 48.0]),
            (
                "SIMPLE_RADIAL",
                &[500., 320., 240., 0.1],
                [473.75, 34.99999999999997],
            ),
            ("RADIAL", &[500., 320., 240., 0.1, -0.05], [473.28125, 35.625]),
            (
                "OPENCV",
                &[500., 480., 320., 240., 0.1, -0.05, 0.01, -0.02],
                [467.78125, 48.839999999999975],
            ),
            (
                "OPENCV_FISHEYE",
                &[500., 480., 320., 240., 0.1, -0.05, 0.02, -0.01],
                [461.78765589100146, 58.51180045951807],
            ),
            (
                "FULL_OPENCV",
                &[
                    500., 480., 320., 240., 0.1, -0.05, 0.01, -0.02, 0.03, 0.04, -0.06, 0.02,
                ],
                [466.8517541136293, 50.0297547345545],
            ),
            ("FOV", &[500., 480., 320., 240., 0.9], [470.0, 48.0]),
            (
                "SIMPLE_RADIAL_FISHEYE",
                &[500., 320., 240., 0.1],
                [462.08438005113084, 50.554159931825524],
            ),
            (
                "RADIAL_FISHEYE",
                &[500., 320., 240., 0.1, -0.05],
                [461.7629907749425, 50.98267896674335],
            ),
            (
                "THIN_PRISM_FISHEYE",
                &[
                    500., 480., 320., 240., 0.1, -0.05, 0.01, -0.02, 0.03, 0.04, -0.006, 0.002,
                ],
                [456.44209796076666, 63.015250744204735],
            ),
        ];
        for (model, parameters, expected) in cases {
            let found = pixel(model, parameters, [0.3, -0.4]);
            assert!(
                (found - Vector2::from(expected)).norm() < 1e-9,
                "{model}: {found}"
            );
        }
        // At r = 0.5 a field-of-view lens leaves every point where it is; so once more at r = 1.
        let found = pixel("FOV", &[500., 480., 320., 240., 0.9], [0.6, -0.8]);
        assert!(
            (found - Vector2::new(576.0542852513354, -87.74948512170931)).norm() < 1e-9,
            "{found}"
        );
    }

    #[test]
    fn unknown_models_are_refused_with_the_list_of_known_ones() {
        let file = Path::new("sparse/cameras.bin");
        let message = CameraModel::by_id(99, file).unwrap_err().to_string();
        assert!(
            message.contains("sparse/cameras.bin: camera model: `99`"),
            "{message}"
        );
        assert!(
            message.contains("SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL"),
            "{message}"
        );
        assert!(CameraModel::by_name("EQUIRECTANGULAR", file).is_err());
    }

    #[test]
    fn a_lens_without_coefficients_is_a_pinhole() {
        let model = CameraModel::by_name("OPENCV", Path::new("cameras.txt")).unwrap();
        let camera = model
            .camera((640, 480), &[500., 480., 320., 240., 0., 0., 0., 0.])
            .unwrap();
        assert_eq!(camera.distortion, Distortion::None);
        assert_eq!(model.camera((640, 480), &[1.0; 7]), None);
    }
}
