//! Off-the-shelf cameras brought into the object frame by the truth, as Sec. 3.2 compares other methods.

use crate::geometry::Pose;

/// Poses aligned with the truth in frame 0, where they agree exactly, and by scale: `camera_from_object` of every
/// frame (`None` where there is no input pose), and α (x_cam = α x'_cam, Eq. 10) that brings the camera centres
/// closest to the true ones in the least-squares sense.
///
/// With R_l = R'_l R'_0ᵀ R_0 and b_l = t'_l − R'_l R'_0ᵀ t'_0 (Eq. 13 and 8): t_l = R'_l R'_0ᵀ t_0 + α b_l, so the
/// centres are linear in α: C_l = C_0 − α R_lᵀ b_l. `None` unless frame 0 has a pose and another camera moves.
pub fn align_to_truth(
    camera_from_input: &[Option<Pose>],
    camera_from_object: &[Pose],
) -> Option<(Vec<Option<Pose>>, f64)> {
    let (input_0, truth_0) = ((*camera_from_input.first()?)?, camera_from_object.first()?);
    let rotated: Vec<_> = camera_from_input
        .iter()
        .map(|input| {
            input.map(|input| {
                let turn = input.rotation * input_0.rotation.inverse();
                let moved = input.translation - turn * input_0.translation;
                (turn, moved)
            })
        })
        .collect();
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for ((turn, moved), truth) in rotated
        .iter()
        .zip(camera_from_object)
        .filter_map(|(r, t)| Some(((*r)?, t)))
    {
        let direction = -((turn * truth_0.rotation).inverse() * moved);
        numerator += direction.dot(&(truth.center() - truth_0.center()));
        denominator += direction.norm_squared();
    }
    let alpha = numerator / denominator;
    (alpha.is_finite() && alpha > 0.0).then(|| {
        let poses = rotated
            .iter()
            .map(|frame| {
                frame.map(|(turn, moved)| Pose {
                    rotation: turn * truth_0.rotation,
                    translation: turn * truth_0.translation + alpha * moved,
                })
            })
            .collect();
        (poses, alpha)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::{location_error, orientation_error_deg};
    use crate::report::Surface;
    use crate::report::fixture::{box_car, solved};

    #[test]
    fn poses_that_differ_by_a_similarity_align_exactly() {
        let (sequence, _) = solved(&Surface::from_points(box_car(200)), 5);
        let truth = sequence.truth.clone().unwrap().camera_from_object;
        let mut input: Vec<_> = sequence
            .frames
            .iter()
            .map(|frame| frame.camera_from_input)
            .collect();
        input[2] = None;
        let (aligned, alpha) = align_to_truth(&input, &truth).unwrap();
        assert!((alpha - 0.4).abs() < 1e-9, "{alpha}");
        assert!(aligned[2].is_none());
        for (pose, truth) in aligned.iter().zip(&truth).filter_map(|(a, t)| Some(((*a)?, t))) {
            assert!(location_error(&pose, truth) < 1e-9);
            assert!(orientation_error_deg(&pose.rotation, &truth.rotation) < 1e-6);
        }
    }

    #[test]
    fn a_camera_that_never_moves_has_no_scale() {
        let still = vec![Some(Pose::identity()); 3];
        assert!(align_to_truth(&still, &[Pose::identity(); 3]).is_none());
        assert!(align_to_truth(&[None, still[0]], &[Pose::identity(); 2]).is_none());
    }
}
