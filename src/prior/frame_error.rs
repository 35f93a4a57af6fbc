//! How well a prior knows the canonical frame of a shape that it never saw.
//!
//! Pictures give a shape up to a similarity; what pins size and orientation is likeness to the shapes learned from. So,
//! however good the pictures are, cameras are on average as far off in the object frame as is measured here.

use super::evaluate::{points_of, rest_of};
use super::learn::{Correspondences, LearnError};
use super::{LearnedPrior, Learner, ShapePrior};
use crate::cad::orbit;
use crate::geometry::{Pinhole, Pose};
use crate::visibility::{Cover, visible_points};
use nalgebra::{DMatrix, DVector, Rotation3, Vector3};
use rayon::prelude::*;

type V3 = Vector3<f64>;

const ROUNDS: usize = 12;
/// Weight of ‖s‖² per point: little, since many pictures tell much.
const RIDGE: f64 = 1e-7;
const IMAGE_PX: usize = 256;

/// The similarity by which the prior misplaces a shape: x_found = scale · R x + t.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameError {
    /// The factor on lengths; 1 without an error.
    pub scale: f64,
    /// The rotation R.
    pub rotation: Rotation3<f64>,
    /// The translation t, diagonals.
    pub translation: V3,
}

impl FrameError {
    /// How far a camera is displaced that stands at the front right, 1.7 diagonals away and 18° above, in diagonals.
    pub fn camera_location(&self) -> f64 {
        let camera = front_right().center();
        (self.scale * (self.rotation * camera) + self.translation - camera).norm()
    }
}

/// Which of a shape's points the fit gets to see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// All of them.
    All,
    /// The points that a camera at the front right sees.
    FromFrontRight,
}

fn front_right() -> Pose {
    orbit(35.0, 18.0, 1.7)
}

/// Leaves each shape out in turn with its `group`, and fits what `learner` makes of the rest to the known ones of its first
/// `points` corresponded points, by style and similarity at once.
pub fn frame_errors(
    correspondences: &Correspondences,
    group: &[usize],
    learner: &Learner,
    points: usize,
    known: Known,
) -> Result<Vec<FrameError>, LearnError> {
    (0..correspondences.shapes.len())
        .into_par_iter()
        .map(|out| {
            let rest = rest_of(group, out);
            let prior = learner(&rest)?;
            let shape = points_of(&correspondences.shapes[out], points);
            let known = match known {
                Known::All => vec![true; shape.len()],
                Known::FromFrontRight => seen(&shape, &front_right()),
            };
            Ok(place(&prior, &shape, &known))
        })
        .collect()
}

/// Which points are in the image and not hidden by others.
fn seen(shape: &[V3], camera_from_object: &Pose) -> Vec<bool> {
    let points: Vec<f64> = shape.iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    let side = IMAGE_PX as f64;
    let camera = Pinhole {
        fx: side,
        fy: side,
        cx: side / 2.0,
        cy: side / 2.0,
    };
    let cover = Cover::around(&points);
    visible_points(
        &points,
        &camera,
        camera_from_object,
        (IMAGE_PX, IMAGE_PX),
        Some(&cover),
    )
    .unoccluded
}

/// Gauss–Newton on Σ |x − Rᵀ (X(s) − t) / scale|² + ridge ‖s‖², over the known points.
fn place(prior: &LearnedPrior, shape: &[V3], known: &[bool]) -> FrameError {
    let styles = prior.style_len();
    let columns = 7 + styles;
    let mut found = FrameError {
        scale: 1.0,
        rotation: Rotation3::identity(),
        translation: V3::zeros(),
    };
    let mut style = DVector::zeros(styles);
    let mut model = vec![0.0; 3 * shape.len()];
    let mut by_style = vec![0.0; model.len() * styles];
    let ridge = RIDGE * known.iter().filter(|&&known| known).count() as f64;
    for _ in 0..ROUNDS {
        prior.points(style.as_slice(), &mut model);
        prior.jacobian(style.as_slice(), &mut by_style);
        let mut normal = DMatrix::zeros(columns, columns);
        let mut right = DVector::zeros(columns);
        let shape_from_model = found.rotation.inverse().matrix() / found.scale;
        let mut rows = DMatrix::zeros(3, columns);
        for (i, x) in shape.iter().enumerate().filter(|&(i, _)| known[i]) {
            let from_origin = V3::from_column_slice(&model[3 * i..3 * i + 3]) - found.translation;
            let y = shape_from_model * from_origin;
            // By log scale, a turn after `rotation`, the translation, and the style.
            rows.column_mut(0).copy_from(&-y);
            rows.view_mut((0, 1), (3, 3))
                .copy_from(&(shape_from_model * from_origin.cross_matrix()));
            rows.view_mut((0, 4), (3, 3)).copy_from(&-shape_from_model);
            let basis = &by_style[3 * i * styles..3 * (i + 1) * styles];
            let basis = nalgebra::DMatrixView::from_slice(basis, styles, 3).transpose();
            rows.view_mut((0, 7), (3, styles))
                .copy_from(&(shape_from_model * basis));
            normal.gemm_tr(1.0, &rows, &rows, 1.0);
            right.gemv_tr(1.0, &rows, &(x - y), 1.0);
        }
        for k in 0..styles {
            normal[(7 + k, 7 + k)] += ridge;
            right[7 + k] -= ridge * style[k];
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&right)) else {
            break;
        };
        found.scale *= step[0].exp();
        found.rotation = Rotation3::from_scaled_axis(V3::new(step[1], step[2], step[3])) * found.rotation;
        found.translation += V3::new(step[4], step[5], step[6]);
        style += step.rows(7, styles);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::LinearPrior;

    fn blob(i: usize) -> V3 {
        let [a, b] = [0.618_034, 0.754_878].map(|g| (i as f64 * g).fract());
        V3::new(0.4 * a - 0.2, 0.3 * b - 0.15, (0.9 * a * b + 0.1 * b).sin() - 0.4)
    }

    /// A family stretched along z, and one of it in another frame.
    #[test]
    fn a_similarity_is_found() {
        let member = |stretch: f64| -> Vec<f64> {
            (0..500)
                .map(blob)
                .flat_map(|p| [p.x, p.y, p.z * stretch])
                .collect()
        };
        let family = [0.9, 1.0, 1.1, 1.2].map(member);
        let normals = vec![[0.0, 1.0, 0.0]; 500];
        let (prior, _) =
            LinearPrior::from_correspondences(&family, &vec![1.0; family.len()], normals, 1).unwrap();
        let prior = LearnedPrior::from(prior);
        let truth = FrameError {
            scale: 0.97,
            rotation: Rotation3::from_scaled_axis(V3::new(0.02, -0.01, 0.03)),
            translation: V3::new(0.01, -0.02, 0.005),
        };
        let shape: Vec<V3> = points_of(&member(1.05), 500)
            .iter()
            .map(|p| truth.rotation.inverse() * (p - truth.translation) / truth.scale)
            .collect();
        let found = place(&prior, &shape, &[true; 500]);
        assert!((found.scale - truth.scale).abs() < 1e-4, "{found:?}");
        assert!(found.rotation.angle_to(&truth.rotation) < 1e-4, "{found:?}");
        assert!((found.translation - truth.translation).norm() < 1e-4, "{found:?}");
    }

    #[test]
    fn a_camera_moves_with_scale_and_turn() {
        let mut error = FrameError {
            scale: 1.01,
            rotation: Rotation3::identity(),
            translation: V3::zeros(),
        };
        assert!((error.camera_location() - 0.017).abs() < 1e-12);
        error.scale = 1.0;
        error.rotation = Rotation3::from_axis_angle(&V3::y_axis(), 0.01);
        let expected = 1.7 * 18f64.to_radians().cos() * 0.01;
        assert!((error.camera_location() - expected).abs() < 1e-6);
    }

    #[test]
    fn a_camera_at_the_front_right_sees_those_sides() {
        // A box's surface, ±0.2 × ±0.15 × ±0.4.
        let shape: Vec<V3> = (0..6000)
            .map(|i| {
                let [a, b] = [0.754_878, 0.569_840].map(|g| 2.0 * (f64::from(i) * g).fract() - 1.0);
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                let unit = match i % 6 / 2 {
                    0 => V3::new(side, a, b),
                    1 => V3::new(a, side, b),
                    _ => V3::new(a, b, side),
                };
                unit.component_mul(&V3::new(0.2, 0.15, 0.4))
            })
            .collect();
        let seen = seen(&shape, &front_right());
        let share = |faces: [usize; 3]| {
            let of_faces = (0..shape.len()).filter(|i| faces.contains(&(i % 6)));
            of_faces.map(|i| f64::from(u8::from(seen[i]))).sum::<f64>() / (shape.len() / 2) as f64
        };
        // Right, top and front; left, bottom and rear.
        let (near, far) = (share([0, 2, 5]), share([1, 3, 4]));
        assert!(near > 0.95 && far < 0.2, "{near} {far}");
    }
}
