//! Checks on declared numbers that every reader shares.

use super::error::SequenceError;
use crate::geometry::{Matrix3, Pinhole, Pose, Rotation3, Vector3};
use std::path::{Component, Path, PathBuf};

/// How far RᵀR may be from I: hand-written matrices with four decimals pass, sheared or scaled ones do not.
const ORTHONORMAL_TOLERANCE: f64 = 1e-3;
/// Below this the matrix is taken as it stands, so that what we wrote reads back bit for bit.
const EXACT_TOLERANCE: f64 = 1e-12;
/// Focal lengths in longer sides of the image: a fisheye's 170° to far more than any tele lens's, as an orthographic camera may be
/// passed off as one.
const MIN_FOCAL: f64 = 0.05;
const MAX_FOCAL: f64 = 1e5;
/// Of the principal point, in longer sides: crops put it outside, but not far.
const MAX_PRINCIPAL_POINT_OFFSET: f64 = 10.0;
/// The largest standard deviation of poses, diagonals: more says nothing.
const MAX_DEVIATION: f64 = 100.0;
/// The largest coordinate of a translation, input units: the earth in tenths of a millimetre.
const MAX_TRANSLATION: f64 = 1e12;

/// Whether a number may be a standard deviation of poses in diagonals of the object, or of the logarithm of a focal length.
pub(super) fn is_deviation(value: f64) -> bool {
    value > 0.0 && value <= MAX_DEVIATION
}

/// Focal lengths positive and finite, principal point finite.
pub(super) fn check_pinhole(camera: &Pinhole, file: &Path, field: &str) -> Vec<SequenceError> {
    let mut problems = Vec::new();
    for (name, value) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(value.is_finite() && value > 0.0) {
            problems.push(SequenceError::invalid(
                file,
                format!("{field}.{name}"),
                format!("focal length is {value}"),
                "give it in pixels, greater than zero",
            ));
        }
    }
    for (name, value) in [("cx", camera.cx), ("cy", camera.cy)] {
        if !value.is_finite() {
            problems.push(SequenceError::invalid(
                file,
                format!("{field}.{name}"),
                format!("principal point is {value}"),
                "give it in pixels, the top-left pixel's centre being (0.5, 0.5)",
            ));
        }
    }
    problems
}

/// Focal lengths and principal point in proportion to the image: a focal length in millimetres is not.
pub(super) fn check_camera_fits(
    camera: &Pinhole,
    (width, height): (usize, usize),
    file: &Path,
    field: &str,
) -> Result<(), SequenceError> {
    let longest = width.max(height) as f64;
    for (name, value) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(MIN_FOCAL * longest..=MAX_FOCAL * longest).contains(&value) {
            return Err(SequenceError::invalid(
                file,
                format!("{field}.{name}"),
                format!("focal length is {value} in an image of {width} × {height}"),
                "give it in pixels of this image",
            ));
        }
    }
    for (name, value) in [("cx", camera.cx), ("cy", camera.cy)] {
        if value.abs() > MAX_PRINCIPAL_POINT_OFFSET * longest {
            return Err(SequenceError::invalid(
                file,
                format!("{field}.{name}"),
                format!("principal point is {value} in an image of {width} × {height}"),
                "give it in pixels of this image",
            ));
        }
    }
    Ok(())
}

/// A frame's name: something, on one line, and not taken.
pub(super) fn check_name(name: &str, taken: bool, file: &Path, index: usize) -> Result<(), SequenceError> {
    let problem = if name.is_empty() || name.chars().any(char::is_control) {
        "empty or with control characters".to_owned()
    } else if taken {
        format!("`{name}` is taken by an earlier frame")
    } else {
        return Ok(());
    };
    let field = format!("frames[{index}].name");
    Err(SequenceError::invalid(
        file,
        field,
        problem,
        "give every frame a name of its own",
    ))
}

/// Refuses what is no rotation.
pub(super) fn check_rotation(matrix: &Matrix3<f64>, file: &Path, field: &str) -> Result<(), SequenceError> {
    let deviation = off_orthonormal(matrix);
    let problem = if deviation.is_nan() || deviation > ORTHONORMAL_TOLERANCE {
        format!("not orthonormal (|RᵀR − I| = {deviation:.3})")
    } else if matrix.determinant() < 0.0 {
        "a reflection (determinant −1)".into()
    } else {
        return Ok(());
    };
    Err(SequenceError::invalid(
        file,
        format!("{field}.rotation"),
        problem,
        "give an orthonormal row-major 3 × 3 matrix with determinant 1",
    ))
}

/// Refuses what is not finite or farther away than anything.
pub(super) fn check_translation(
    translation: &Vector3<f64>,
    file: &Path,
    field: &str,
) -> Result<(), SequenceError> {
    let problem = if !translation.iter().all(|value| value.is_finite()) {
        "not finite".to_owned()
    } else if translation.amax() > MAX_TRANSLATION {
        format!("{:e} units away", translation.amax())
    } else {
        return Ok(());
    };
    Err(SequenceError::invalid(
        file,
        format!("{field}.translation"),
        problem,
        format!("give three numbers within ±{MAX_TRANSLATION:e}, or leave the frame out"),
    ))
}

fn off_orthonormal(matrix: &Matrix3<f64>) -> f64 {
    (matrix.transpose() * matrix - Matrix3::identity()).norm()
}

/// A pose from a row-major 3 × 3 matrix and a translation; refuses what is no rotation.
pub(super) fn check_pose(
    rotation: &[[f64; 3]; 3],
    translation: &[f64; 3],
    file: &Path,
    field: &str,
) -> Result<Pose, SequenceError> {
    let matrix = Matrix3::from_fn(|row, column| rotation[row][column]);
    let translation = Vector3::from(*translation);
    check_rotation(&matrix, file, field)?;
    check_translation(&translation, file, field)?;
    let rotation = if off_orthonormal(&matrix) < EXACT_TOLERANCE {
        Rotation3::from_matrix_unchecked(matrix)
    } else {
        Rotation3::from_matrix(&matrix)
    };
    Ok(Pose {
        rotation,
        translation,
    })
}

/// `folder/relative`, refused where `relative` is absolute or climbs out with `..`.
pub(super) fn inside(
    folder: &Path,
    relative: &str,
    file: &Path,
    field: &str,
) -> Result<PathBuf, SequenceError> {
    let path = Path::new(relative);
    let stays = !relative.is_empty()
        && path
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if stays {
        Ok(folder.join(path))
    } else {
        Err(SequenceError::invalid(
            file,
            field,
            format!("path `{}` leaves the folder", relative.escape_default()),
            format!("give a path relative to {}, without ..", folder.display()),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(pose: &Rotation3<f64>) -> [[f64; 3]; 3] {
        std::array::from_fn(|row| std::array::from_fn(|column| pose[(row, column)]))
    }

    #[test]
    fn rotations_pass_and_others_do_not() {
        let rotation = Rotation3::from_euler_angles(0.3, -1.2, 2.0);
        let check = |rows: [[f64; 3]; 3]| check_pose(&rows, &[0.0; 3], Path::new("f"), "p");
        assert_eq!(
            *check(matrix(&rotation)).unwrap().rotation.matrix(),
            *rotation.matrix()
        );

        let rounded = matrix(&rotation).map(|row| row.map(|value| (value * 1e4).round() / 1e4));
        let mended = check(rounded).unwrap().rotation;
        assert!((mended.matrix() - rotation.matrix()).norm() < 2e-4);
        assert!((mended.matrix().transpose() * mended.matrix() - Matrix3::identity()).norm() < 1e-9);

        let scaled = matrix(&rotation).map(|row| row.map(|value| value * 1.01));
        assert!(
            check(scaled)
                .unwrap_err()
                .to_string()
                .contains("p.rotation: not orthonormal")
        );
        let mirrored = matrix(&rotation).map(|row| row.map(|value| -value));
        assert!(check(mirrored).unwrap_err().to_string().contains("reflection"));
        assert!(check([[f64::NAN; 3]; 3]).is_err());
    }

    #[test]
    fn cameras_out_of_proportion_are_refused() {
        let check = |fx: f64, cx: f64| {
            let camera = Pinhole {
                fx,
                fy: 500.0,
                cx,
                cy: 240.0,
            };
            check_camera_fits(&camera, (640, 480), Path::new("f"), "camera")
                .map_err(|fault| fault.to_string())
        };
        for (fx, cx) in [(500.0, 320.0), (1e6, 320.0), (40.0, -900.0)] {
            assert!(check(fx, cx).is_ok(), "{fx} {cx}");
        }
        // Millimetres; metres; what came out of a diverged adjustment.
        for fx in [4.25, 0.00425, 1e30, 1e-300] {
            assert!(
                check(fx, 320.0)
                    .unwrap_err()
                    .contains("camera.fx: focal length is"),
                "{fx}"
            );
        }
        assert!(
            check(500.0, 1e9)
                .unwrap_err()
                .contains("camera.cx: principal point is")
        );
    }

    #[test]
    fn translations_out_of_all_proportion_are_refused() {
        let check = |x: f64| {
            check_pose(
                &matrix(&Rotation3::identity()),
                &[x, 0.0, 0.0],
                Path::new("f"),
                "p",
            )
        };
        assert!(check(6.4e9).is_ok());
        for x in [f64::NAN, f64::INFINITY, 1e177] {
            assert!(check(x).unwrap_err().to_string().contains("p.translation"), "{x}");
        }
    }

    #[test]
    fn paths_stay_inside() {
        let folder = Path::new("data");
        assert_eq!(
            inside(folder, "a/b.png", folder, "image").unwrap(),
            Path::new("data/a/b.png")
        );
        for path in ["", "../b.png", "a/../../b.png", "/etc/passwd"] {
            assert!(inside(folder, path, folder, "image").is_err(), "{path}");
        }
    }
}
