//! The objective against numeric differences of itself and against itself under other options.

mod terms;

use super::*;
use crate::geometry::Rotation3;
use crate::image::Mask;
use crate::solver::{LinearSolver, Minimiser};

/// A sphere of points that four modes stretch and bend.
struct Blob {
    mean: Vec<f64>,
}

impl Blob {
    fn new(count: usize) -> Self {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let mean = (0..count)
            .flat_map(|i| {
                let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
                let (r, angle) = ((1.0 - y * y).sqrt(), golden * i as f64);
                [0.3 * r * angle.cos(), 0.3 * y, 0.3 * r * angle.sin()]
            })
            .collect();
        Self { mean }
    }

    fn mode(x: &[f64], k: usize) -> [f64; 3] {
        match k {
            0 => [0.1 * x[0], 0.0, 0.0],
            1 => [0.0, 0.1 * x[1], 0.02],
            2 => [0.3 * x[1] * x[2], 0.0, 0.1 * x[2]],
            _ => [0.02 * (7.0 * x[1]).sin(), 0.02 * (5.0 * x[2]).cos(), 0.0],
        }
    }
}

impl ShapePrior for Blob {
    fn style_len(&self) -> usize {
        4
    }

    fn point_count(&self) -> usize {
        self.mean.len() / 3
    }

    fn points(&self, style: &[f64], points: &mut [f64]) {
        for (point, x) in points.chunks_exact_mut(3).zip(self.mean.chunks_exact(3)) {
            for i in 0..3 {
                point[i] = x[i] + (0..4).map(|k| style[k] * Self::mode(x, k)[i]).sum::<f64>();
            }
        }
    }

    fn jacobian(&self, _: &[f64], jacobian: &mut [f64]) {
        for (rows, x) in jacobian.chunks_exact_mut(12).zip(self.mean.chunks_exact(3)) {
            for k in 0..4 {
                for (i, value) in Self::mode(x, k).into_iter().enumerate() {
                    rows[4 * i + k] = value;
                }
            }
        }
    }
}

/// Frames with smooth, unrelated images, a disc for a mask and a tilted plane for depth.
fn sequence(frames: usize) -> Sequence {
    let (width, height) = (96, 80);
    let camera = Pinhole {
        fx: 120.0,
        fy: 118.0,
        cx: 47.0,
        cy: 41.0,
    };
    let frames = (0..frames)
        .map(|l| Frame {
            name: format!("{l}"),
            image: RgbImage::from_fn(width, height, |c, r| {
                let (x, y, l) = (c as f32, r as f32, l as f32);
                [
                    128.0 + 90.0 * (0.11 * x + 0.3 * l).sin(),
                    120.0 + 80.0 * (0.07 * x + 0.09 * y + l).cos(),
                    100.0 + 60.0 * (0.13 * y - 0.2 * l).sin(),
                ]
            }),
            mask: Mask::from_fn(width, height, |c, r| {
                (c as f64 - 46.0 - l as f64).hypot(r as f64 - 40.0) < 24.0
            }),
            camera,
            timestamp_s: None,
            camera_from_input: None,
            depth: Some(crate::image::DepthMap::from_fn(width, height, |c, _| {
                2.5 + 0.01 * c as f32
            })),
            depth_deviation: None,
        })
        .collect();
    Sequence {
        name: "synthetic".into(),
        frames,
        motion_deviation: None,
        truth: None,
    }
}

fn estimate(frames: usize) -> Estimate {
    let twist = |omega: [f64; 3], t: [f64; 3]| Pose {
        rotation: Rotation3::from_scaled_axis(Vector3::from(omega)),
        translation: Vector3::from(t),
    };
    Estimate {
        target_from_object: twist([0.2, -0.4, 0.1], [0.02, -0.01, 1.6]),
        motion: (1..frames)
            .map(|l| {
                RelativePose(twist(
                    [0.01, 0.08 * l as f64, -0.02],
                    [0.02 * l as f64, 0.01, 0.03],
                ))
            })
            .collect(),
        style: vec![0.3, -0.7, 0.5, 1.1],
        alpha: 0.7,
    }
}

fn objective<'a>(sequence: &'a Sequence, options: &ObjectiveOptions, at: &Estimate) -> Objective<'a> {
    Objective::new(sequence, Arc::new(Blob::new(600)), options, 1, at).unwrap()
}

/// Central differences of the objective over p0, Δp, s and log α, visibility held.
fn numeric_gradient(objective: &mut Objective, at: &Estimate) -> Vec<f64> {
    // Short: where two pixels are equally near, Eq. 5 has kinks, and a step must not cross one.
    let step = 1e-8;
    let twists: Vec<f64> = std::iter::once(at.target_from_object.to_twist())
        .chain(at.motion.iter().map(|m| m.0.to_twist()))
        .flat_map(|twist| twist.iter().copied().collect::<Vec<_>>())
        .collect();
    let log_alpha = (at.alpha / objective.input_unit).ln();
    let variables = [twists, at.style.clone(), vec![log_alpha]].concat();
    let mut value = |variables: &[f64]| {
        let (log_alpha, variables) = variables.split_last().unwrap();
        let motion = 6..variables.len() - at.style.len();
        let problem = objective.problem.pin_mut();
        problem
            .set_variables(
                &variables[..6],
                &variables[motion.clone()],
                &variables[motion.end..],
            )
            .unwrap();
        objective
            .set_alpha(log_alpha.exp() * objective.input_unit)
            .unwrap();
        objective.evaluate().unwrap().total
    };
    (0..variables.len())
        .map(|i| {
            let mut moved = variables.clone();
            moved[i] += step;
            let above = value(&moved);
            moved[i] -= 2.0 * step;
            (above - value(&moved)) / (2.0 * step)
        })
        .collect()
}

fn assert_gradient(options: &ObjectiveOptions, at: &Estimate) {
    let sequence = sequence(at.frame_count());
    let mut objective = objective(&sequence, options, at);
    let analytic = objective.gradient().unwrap();
    let numeric = numeric_gradient(&mut objective, at);
    let scale = numeric.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    assert!(scale > 0.0, "a gradient that is zero proves nothing");
    for (i, (a, n)) in analytic.iter().zip(&numeric).enumerate() {
        // A difference of two sums near 1e4 over a step of 1e-8 carries about 1e-4 of rounding.
        assert!(
            (a - n).abs() < 1e-5 * scale + 1e-5 * n.abs(),
            "entry {i}: analytic {a}, numeric {n}"
        );
    }
}

fn only(change: impl FnOnce(&mut ObjectiveOptions)) -> ObjectiveOptions {
    let mut options = ObjectiveOptions {
        photometric_weight: 0.0,
        silhouette_weight: 0.0,
        inverse_depth_weight: 0.0,
        style_weight: 0.0,
        ..Default::default()
    };
    change(&mut options);
    options
}

#[test]
fn each_terms_gradient_is_that_of_its_value() {
    let at = estimate(3);
    assert_gradient(&only(|o| o.photometric_weight = 1.0), &at);
    assert_gradient(&only(|o| o.silhouette_weight = 0.1), &at);
    assert_gradient(&only(|o| o.inverse_depth_weight = 1000.0), &at);
    assert_gradient(&only(|o| o.style_weight = 2.0), &at);
}

/// A sequence whose off-the-shelf poses are those of `at`, known to 0.01 diagonals.
fn vouched(at: &Estimate) -> Sequence {
    let mut sequence = sequence(at.frame_count());
    for (l, frame) in sequence.frames.iter_mut().enumerate() {
        let Pose {
            rotation,
            translation,
        } = at.camera_from_object(l);
        frame.camera_from_input = Some(Pose {
            rotation,
            translation: translation / at.alpha,
        });
    }
    sequence.motion_deviation = Some(0.01);
    sequence
}

/// Its style is 1.43 long: 0.71 √S.
#[test]
fn styles_beyond_reach_cost_more_and_are_differentiated() {
    let at = estimate(2);
    let sequence = sequence(2);
    let norm = at.style.iter().map(|s| s * s).sum::<f64>().sqrt();
    for (reach, beyond) in [(0.0, 0.0), (1.0, 0.0), (0.5, norm - 1.0)] {
        let options = only(|o| {
            o.style_weight = 2.0;
            o.style_reach = reach;
        });
        let found = objective(&sequence, &options, &at).evaluate().unwrap().style;
        let known = norm * norm + 100.0 * beyond * beyond;
        assert!((found - known).abs() < 1e-9 * known, "{reach}: {found} {known}");
        assert_gradient(&options, &at);
    }
}

#[test]
fn motion_is_held_to_the_off_the_shelf_poses() {
    let at = estimate(3);
    let sequence = vouched(&at);
    let value = |at: &Estimate, deviation: Option<f64>| {
        let options = only(|o| o.motion_deviation = deviation);
        objective(&sequence, &options, at).evaluate().unwrap().motion
    };
    assert!(value(&at, None) < 1e-20);
    // Both source frames see the object so far off, in a third of three frames each.
    let mut off = at.clone();
    for motion in &mut off.motion {
        motion.0.translation += Vector3::new(0.0, 0.02, 0.0);
    }
    let known = |deviations: f64| 2.0 / 3.0 * 0.5 * 2500.0 * 36.0 * (deviations / 6.0).powi(2).ln_1p();
    for (deviation, deviations) in [(None, 2.0), (Some(0.002), 10.0)] {
        let found = value(&off, deviation);
        assert!(
            (found / known(deviations) - 1.0).abs() < 1e-9,
            "{found} {}",
            known(deviations)
        );
    }
    assert_eq!(value(&off, Some(0.0)), 0.0);
    let mut turned = at.clone();
    turned.motion[0].0.rotation *= Rotation3::from_scaled_axis(Vector3::new(0.0, 0.02, 0.0));
    assert!(value(&turned, None) > 1.0);
}

#[test]
fn the_held_motions_gradient_is_that_of_its_value() {
    let mut at = estimate(3);
    let sequence = vouched(&at);
    at.motion[0].0.translation.x += 0.03;
    at.motion[1].0.rotation *= Rotation3::from_scaled_axis(Vector3::new(0.02, 0.01, -0.03));
    at.alpha *= 1.1;
    let mut objective = objective(&sequence, &only(|_| ()), &at);
    let analytic = objective.gradient().unwrap();
    let numeric = numeric_gradient(&mut objective, &at);
    let scale = numeric.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    assert!(scale > 1.0);
    for (a, n) in analytic.iter().zip(&numeric) {
        assert!((a - n).abs() < 1e-5 * scale, "analytic {a}, numeric {n}");
    }
}

#[test]
fn weak_perspective_is_differentiated_too() {
    assert_gradient(&weak(), &estimate(3));
}

/// Every source frame twice, or three times: within the limit they add up, beyond it they do not.
#[test]
fn many_source_frames_weigh_no_more_than_their_limit() {
    let value = |times: usize, photometric_frames: usize| {
        let (mut sequence, mut at) = (sequence(3), estimate(3));
        let sources = sequence.frames[1..].to_vec();
        sequence.frames.truncate(1);
        sequence.frames.extend((0..times).flat_map(|_| sources.clone()));
        at.motion = at.motion.repeat(times);
        let options = only(|o| {
            o.photometric_weight = 1.0;
            o.photometric_frames = photometric_frames;
        });
        objective(&sequence, &options, &at)
            .evaluate()
            .unwrap()
            .photometric
    };
    let once = value(1, 0);
    for (times, limit, expected) in [
        (1, 2, once),
        (2, 4, 2.0 * once),
        (2, 2, once),
        (3, 4, 2.0 * once),
        (3, 0, 3.0 * once),
    ] {
        let found = value(times, limit);
        assert!(
            (found - expected).abs() < 1e-9 * expected,
            "{times} {limit}: {found} {expected}"
        );
    }
}

/// From far away with a long lens both cameras are one.
#[test]
fn weak_perspective_is_perspective_from_afar() {
    let value = |weak_perspective: bool, times_as_far: f64| {
        let mut sequence = sequence(3);
        let mut at = estimate(3);
        at.target_from_object.translation.z *= times_as_far;
        for frame in &mut sequence.frames {
            frame.camera.fx *= times_as_far;
            frame.camera.fy *= times_as_far;
        }
        for motion in &mut at.motion {
            motion.0.translation.z = 0.0;
        }
        let options = ObjectiveOptions {
            weak_perspective,
            ..weak()
        };
        objective(&sequence, &options, &at).evaluate().unwrap().total
    };
    let (near, far) = (
        value(true, 1.0) / value(false, 1.0),
        value(true, 1e4) / value(false, 1e4),
    );
    assert!((far - 1.0).abs() < 1e-3, "{far}");
    assert!((near - 1.0).abs() > 5e-3, "{near}");
}

/// Silhouettes twice as large as `silhouette_size`: every length counts half.
#[test]
fn silhouettes_are_measured_in_pixels_of_their_size() {
    let sequence = sequence(3);
    let area = sequence
        .frames
        .iter()
        .flat_map(|frame| frame.mask.data())
        .filter(|&&inside| inside)
        .count();
    let value = |size: f64, length: f64, weight: f64| {
        let options = only(|o| {
            o.silhouette_weight = weight;
            o.silhouette_size = size;
            o.silhouette_tolerance = length;
            o.silhouette_cauchy = 3.0 * length;
        });
        objective(&sequence, &options, &estimate(3))
            .evaluate()
            .unwrap()
            .silhouette
    };
    let half = (area as f64 / 3.0).sqrt() / 2.0;
    let (relative, direct) = (value(half, 0.5, 1.0), value(0.0, 1.0, 0.25));
    assert!(
        (relative - direct).abs() < 1e-9 * direct && direct > 0.0,
        "{relative} {direct}"
    );
    assert!((value(0.0, 0.5, 1.0) - direct).abs() > 0.1 * direct);
}

fn weak() -> ObjectiveOptions {
    only(|o| {
        o.weak_perspective = true;
        o.photometric_weight = 1.0;
        o.silhouette_weight = 0.1;
    })
}

#[test]
fn the_whole_gradient_is_that_of_the_value() {
    assert_gradient(&ObjectiveOptions::default(), &estimate(4));
}

#[test]
fn the_gradient_holds_at_awkward_rotations() {
    for omega in [
        [0.0, 0.0, 0.0],
        [0.0, std::f64::consts::PI - 1e-7, 0.0],
        [1e-9, 0.0, 0.0],
    ] {
        let mut at = estimate(2);
        at.target_from_object.rotation = Rotation3::from_scaled_axis(Vector3::from(omega));
        at.motion[0].0.rotation = Rotation3::identity();
        assert_gradient(&ObjectiveOptions::default(), &at);
    }
}

#[test]
fn small_huber_widths_are_differentiated_too() {
    let options = ObjectiveOptions {
        photometric_huber: 5.0,
        inverse_depth_huber: 0.01,
        ..Default::default()
    };
    assert_gradient(&options, &estimate(3));
}

/// Eq. 5 by its definition: brute force over all pixels and points.
/// L-BFGS moves in scaled coordinates while it runs, and in no others afterwards.
#[test]
fn l_bfgs_finds_the_minimum_of_levenberg_marquardt_and_leaves_the_gradient_as_it_was() {
    // The smooth terms, which have one minimum.
    let options = only(|o| {
        o.inverse_depth_weight = 1000.0;
        o.inverse_depth_huber = 10.0;
        o.style_weight = 2.0;
    });
    let (sequence, at) = (sequence(3), estimate(3));
    let end = |minimiser: Minimiser| {
        let mut objective = objective(&sequence, &options, &at);
        let call = Call {
            block: Block::Style,
            free_alpha: true,
            minimiser,
            max_iterations: 60,
            tolerance: 1e-9,
        };
        let outcome = objective.minimise(&call, &mut |_| true).unwrap();
        assert!(outcome.evaluations.jacobian < 300, "{:?}", outcome.evaluations);
        let (value, found) = (objective.evaluate().unwrap().total, objective.estimate().unwrap());
        let analytic = objective.gradient().unwrap();
        let mut fresh = self::objective(&sequence, &options, &at);
        fresh.set_estimate(&found).unwrap();
        let largest = analytic.iter().fold(0.0f64, |m, g| m.max(g.abs()));
        for (a, b) in analytic.iter().zip(fresh.gradient().unwrap()) {
            assert!((a - b).abs() < 1e-9 * largest, "{a} {b}");
        }
        value
    };
    let start = objective(&sequence, &options, &at).evaluate().unwrap().total;
    let lm = end(Minimiser::lm(LinearSolver::Auto));
    let lbfgs = end(Minimiser::lbfgs(20));
    assert!(lm < 0.9 * start, "{start} {lm}");
    assert!((lbfgs - lm).abs() < 1e-3 * lm, "{lm} {lbfgs}");
}
