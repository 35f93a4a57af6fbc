//! Priors whose derivative is the same at every style.

use super::*;

/// A [`Blob`] that says that its derivative is the same at every style.
struct Constant {
    blob: Blob,
    jacobian: Vec<f64>,
}

impl ShapePrior for Constant {
    fn style_len(&self) -> usize {
        self.blob.style_len()
    }

    fn point_count(&self) -> usize {
        self.blob.point_count()
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        self.blob.points(style, points);
    }

    fn jacobian(&self, _: &[f64], _: &mut [f64]) {
        panic!("asked for what is constant");
    }

    fn constant_jacobian(&self) -> Option<&[f64]> {
        Some(&self.jacobian)
    }
}

#[test]
fn a_constant_derivative_serves_as_it_is() {
    let (at, points) = (estimate(3), 600);
    let sequence = sequence(3);
    let footage = Footage::new(&sequence, 1).unwrap();
    let mut whole = vec![0.0; 3 * points * at.style.len()];
    Blob::new(points).jacobian(&at.style, &mut whole);
    let objective = |jacobian: &[f64], options: &ObjectiveOptions| {
        let prior = Constant {
            blob: Blob::new(points),
            jacobian: jacobian.to_vec(),
        };
        Objective::new(&footage, Arc::new(prior), options, 0, &at, 1)
    };
    // Of all points and of the first alone.
    for targets in [0, 200] {
        let options = ObjectiveOptions {
            points: 200,
            silhouette_targets: targets,
            ..Default::default()
        };
        let mut expected = setting(&footage, &options, &at);
        let mut found = objective(&whole, &options).unwrap();
        let visibility = found.visibility(&at, 0).unwrap();
        assert_eq!(
            found.differentiate(&at, &visibility).unwrap().0,
            expected.gradient()
        );
    }
    let refused = |jacobian: &[f64]| {
        let error = objective(jacobian, &ObjectiveOptions::default()).err().unwrap();
        error.to_string()
    };
    let told = refused(&whole[1..]);
    assert!(told.contains("three rows a point"), "{told}");
    whole[7] = f64::NAN;
    let told = refused(&whole);
    assert!(told.contains("not all finite"), "{told}");
}
