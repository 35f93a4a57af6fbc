//! What the curvature at an estimate says of its errors.

use super::*;
use crate::solver::Deviations;
use nalgebra::DMatrix;

fn deviations(options: &ObjectiveOptions, at: &Estimate) -> Option<Deviations> {
    let sequence = sequence(at.frame_count());
    let mut setting = setting(&Footage::new(&sequence, 1).unwrap(), options, at);
    let visibility = setting.objective.visibility(at, 0).unwrap();
    Deviations::at(&mut setting.objective, &visibility, &Blob::new(600), at, 4).unwrap()
}

/// The covariance of the first `count` variables, the others known, in units of a style's weight of 2.
fn covariance(options: &ObjectiveOptions, at: &Estimate, count: usize) -> DMatrix<f64> {
    let sequence = sequence(at.frame_count());
    let mut setting = setting(&Footage::new(&sequence, 1).unwrap(), options, at);
    let (gradient, matrix) = setting
        .objective
        .differentiate(&setting.at, &setting.visibility)
        .unwrap();
    let whole = DMatrix::from_row_slice(gradient.len(), gradient.len(), &matrix) / 2.0;
    whole
        .view((0, 0), (count, count))
        .into_owned()
        .try_inverse()
        .unwrap()
}

fn held(focal_deviation: f64) -> ObjectiveOptions {
    ObjectiveOptions {
        style_weight: 2.0,
        focal_deviation: Some(focal_deviation),
        ..Default::default()
    }
}

#[test]
fn a_held_focal_length_counts_as_known() {
    let at = estimate(3);
    let variables = 6 * 3 + 4 + 2;
    for (focal_deviation, count) in [(0.0, variables - 1), (0.1, variables)] {
        let options = held(focal_deviation);
        let found = deviations(&options, &at).unwrap();
        let expected = covariance(&options, &at, count);
        let of_shape = &found.shape * found.shape.transpose();
        let of_shape_expected = expected.view((18, 18), (4, 4));
        assert!((of_shape - of_shape_expected).amax() < 1e-9 * of_shape_expected.amax());
        for (l, camera) in found.cameras.iter().enumerate() {
            let squared: f64 = (0..3).map(|i| expected[(6 * l + i, 6 * l + i)]).sum();
            let rotation_deg = squared.sqrt().to_degrees();
            assert!((camera.rotation_deg / rotation_deg - 1.0).abs() < 1e-9);
        }
    }
    let location = |focal_deviation| {
        let found = deviations(&held(focal_deviation), &at).unwrap();
        found.cameras.iter().map(|camera| camera.location).sum::<f64>()
    };
    // A camera whose focal length is open may stand nearer or farther.
    assert!(
        location(0.1) > 1.05 * location(0.0),
        "{} {}",
        location(0.1),
        location(0.0)
    );
}

#[test]
fn what_nothing_holds_has_no_deviation() {
    let at = estimate(2);
    // Poses move no term, or the style has no unit.
    assert!(deviations(&only(|o| o.style_weight = 2.0), &at).is_none());
    assert!(deviations(&only(|o| o.photometric_weight = 1.0), &at).is_none());
}
