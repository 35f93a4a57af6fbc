//! Checks on declared numbers that every reader shares.

use super::error::SequenceError;
use crate::geometry::{Matrix3, Pinhole, Pose, Rotation3, Vector3};
use std::path::{Component, Path, PathBuf};

/// How far RᵀR may be from I: hand-written matrices with four decimals pass, sheared or scaled ones do not.
const ORTHONORMAL_TOLERANCE: f64 = 1e-3;
/// Below this the matrix is taken as it stands, so that what we wrote reads back bit for bit.
const EXACT_TOLERANCE: f64 = 1e-12;

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

/// A pose from a row-major 3 × 3 matrix and a translation; refuses what is no rotation.
pub(super) fn check_pose(
    rotation: &[[f64; 3]; 3],
    translation: &[f64; 3],
    file: &Path,
    field: &str,
) -> Result<Pose, SequenceError> {
    let matrix = Matrix3::from_fn(|row, column| rotation[row][column]);
    let deviation = (matrix.transpose() * matrix - Matrix3::identity()).norm();
    let wrong = |problem: String| {
        SequenceError::invalid(
            file,
            format!("{field}.rotation"),
            problem,
            "give an orthonormal row-major 3 × 3 matrix with determinant 1",
        )
    };
    if deviation.is_nan() || deviation > ORTHONORMAL_TOLERANCE {
        return Err(wrong(format!("not orthonormal (|RᵀR − I| = {deviation:.3})")));
    }
    if matrix.determinant() < 0.0 {
        return Err(wrong("a reflection (determinant −1)".into()));
    }
    let translation = Vector3::from(*translation);
    if !translation.iter().all(|value| value.is_finite()) {
        return Err(SequenceError::invalid(
            file,
            format!("{field}.translation"),
            "not finite",
            "give three finite numbers",
        ));
    }
    let rotation = if deviation < EXACT_TOLERANCE {
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
