//! The objective against numeric differences of itself and against itself under other options.

mod constant;
mod correspondences;
mod deviations;
mod minimise;
mod terms;

use super::*;
use crate::geometry::{Pinhole, RelativePose, Rotation3, Vector3};
use crate::image::{Mask, RgbImage};
use crate::sequence::{Frame, SequenceContent};
use crate::solver::{Evaluation, LinearSolver, Minimiser};

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
            })
            .into(),
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
    Sequence::new(SequenceContent {
        name: "synthetic".into(),
        frames,
        motion_deviation: None,
        focal_deviation: None,
        truth: None,
    })
    .unwrap()
}

fn estimate(frames: usize) -> Estimate {
    let twist = |omega: [f64; 3], t: [f64; 3]| Pose {
        rotation: Rotation3::from_scaled_axis(Vector3::from(omega)),
        translation: Vector3::from(t),
    };
    let target_from_object = twist([0.2, -0.4, 0.1], [0.02, -0.01, 1.6]);
    let sources = (1..frames).map(|l| {
        let motion = twist([0.01, 0.08 * l as f64, -0.02], [0.02 * l as f64, 0.01, 0.03]);
        RelativePose(motion).compose(&target_from_object)
    });
    Estimate {
        camera_from_object: std::iter::once(target_from_object).chain(sources).collect(),
        style: vec![0.3, -0.7, 0.5, 1.1],
        alpha: 0.7,
        focal_factor: 1.0,
    }
}

/// An objective and what it is evaluated at.
struct Setting<'a> {
    objective: Objective<'a>,
    at: Estimate,
    visibility: Visibility,
}

impl Setting<'_> {
    fn value(&mut self) -> ObjectiveValue {
        self.objective.evaluate(&self.at, &self.visibility).unwrap()
    }

    fn gradient(&mut self) -> Vec<f64> {
        self.objective
            .differentiate(&self.at, &self.visibility)
            .unwrap()
            .0
    }

    /// Central differences of the objective over twists, s, log α and log focal, visibility held.
    fn numeric_gradient(&mut self) -> Vec<f64> {
        // Short: where two pixels are equally near, Eq. 5 has kinks, and a step must not cross one.
        let step = 1e-8;
        let poses = 6 * self.at.frame_count();
        let styles = self.at.style.len();
        (0..poses + styles + 2)
            .map(|i| {
                let mut value = |step: f64| {
                    let mut moved = self.at.clone();
                    if i < poses {
                        let pose = &mut moved.camera_from_object[i / 6];
                        let mut axis = Vector3::zeros();
                        axis[i % 3] = step;
                        if i % 6 < 3 {
                            pose.rotation = Rotation3::from_scaled_axis(axis) * pose.rotation;
                        } else {
                            pose.translation += axis;
                        }
                    } else if i < poses + styles {
                        moved.style[i - poses] += step;
                    } else if i == poses + styles {
                        moved.alpha *= step.exp();
                    } else {
                        moved.focal_factor *= step.exp();
                    }
                    self.objective.evaluate(&moved, &self.visibility).unwrap().total
                };
                (value(step) - value(-step)) / (2.0 * step)
            })
            .collect()
    }
}

fn setting<'a>(footage: &Footage<'a>, options: &ObjectiveOptions, at: &Estimate) -> Setting<'a> {
    setting_with_target(footage, options, at, 0)
}

fn setting_with_target<'a>(
    footage: &Footage<'a>,
    options: &ObjectiveOptions,
    at: &Estimate,
    target: usize,
) -> Setting<'a> {
    let objective = Objective::new(footage, Arc::new(Blob::new(600)), options, target, at, 1).unwrap();
    Setting {
        visibility: objective.visibility(at, 0).unwrap(),
        objective,
        at: at.clone(),
    }
}

fn value(sequence: &Sequence, options: &ObjectiveOptions, at: &Estimate) -> ObjectiveValue {
    setting(&Footage::new(sequence, 1).unwrap(), options, at).value()
}

fn assert_same(analytic: &[f64], numeric: &[f64], accuracy: f64) {
    let scale = numeric.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    assert!(scale > 0.0, "a gradient that is zero proves nothing");
    assert_eq!(analytic.len(), numeric.len());
    for (i, (a, n)) in analytic.iter().zip(numeric).enumerate() {
        assert!(
            (a - n).abs() < accuracy * (scale + n.abs()),
            "entry {i}: analytic {a}, numeric {n}"
        );
    }
}

/// A difference of two sums near 1e4 over a step of 1e-8 carries about 1e-4 of rounding.
const ACCURACY: f64 = 1e-5;

fn assert_gradient(options: &ObjectiveOptions, at: &Estimate) {
    let sequence = sequence(at.frame_count());
    let options = ObjectiveOptions {
        focal_deviation: Some(0.1),
        ..options.clone()
    };
    let mut setting = setting(&Footage::new(&sequence, 1).unwrap(), &options, at);
    assert_same(&setting.gradient(), &setting.numeric_gradient(), ACCURACY);
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
    let vouched = sequence(at.frame_count()).edited(|content| {
        for (l, frame) in content.frames.iter_mut().enumerate() {
            let Pose {
                rotation,
                translation,
            } = at.camera_from_object[l];
            frame.camera_from_input = Some(Pose {
                rotation,
                translation: translation / at.alpha,
            });
        }
        content.motion_deviation = Some(0.01);
    });
    vouched.unwrap()
}

#[test]
fn the_style_costs_half_its_square() {
    let at = estimate(2);
    let options = only(|o| o.style_weight = 3.0);
    let found = value(&sequence(2), &options, &at).style;
    let known = 1.5 * at.style.iter().map(|s| s * s).sum::<f64>();
    assert!((found - known).abs() < 1e-9 * known, "{found} {known}");
    assert_gradient(&options, &at);
}

#[test]
fn motion_is_held_to_the_off_the_shelf_poses() {
    let at = estimate(3);
    let sequence = vouched(&at);
    let value = |at: &Estimate, deviation: Option<f64>| {
        let options = only(|o| o.motion_deviation = deviation);
        value(&sequence, &options, at).motion
    };
    assert!(value(&at, None) < 1e-20);
    // Both source frames see the object so far off, with the right motion between them: two of three pairs.
    let mut off = at.clone();
    let first = at.camera_from_object[1].rotation.inverse();
    for pose in &mut off.camera_from_object[1..] {
        pose.translation += pose.rotation * (first * Vector3::new(0.0, 0.02, 0.0));
    }
    let known =
        |deviations: f64| 2.0 / 3.0 * (2.0 / 3.0) * 0.5 * 2500.0 * 36.0 * (deviations / 6.0).powi(2).ln_1p();
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
    turned.camera_from_object[1].rotation *= Rotation3::from_scaled_axis(Vector3::new(0.0, 0.02, 0.0));
    assert!(value(&turned, None) > 1.0);
}

#[test]
fn the_held_motions_gradient_is_that_of_its_value() {
    let mut at = estimate(3);
    let sequence = vouched(&at);
    at.camera_from_object[1].translation.x += 0.03;
    at.camera_from_object[2].rotation *= Rotation3::from_scaled_axis(Vector3::new(0.02, 0.01, -0.03));
    for target in 0..3 {
        let footage = Footage::new(&sequence, 1).unwrap();
        let mut setting = setting_with_target(&footage, &only(|_| ()), &at, target);
        setting.at.alpha *= 1.1;
        assert_same(&setting.gradient(), &setting.numeric_gradient(), ACCURACY);
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
        let sequence = sequence(3).edited(|content| {
            let sources = content.frames.split_off(1);
            content.frames.extend((0..times).flat_map(|_| sources.clone()));
            for (l, frame) in content.frames.iter_mut().enumerate() {
                frame.name = l.to_string();
            }
        });
        let (sequence, mut at) = (sequence.unwrap(), estimate(3));
        let poses = at.camera_from_object.split_off(1);
        at.camera_from_object.extend(poses.repeat(times));
        let options = only(|o| {
            o.photometric_weight = 1.0;
            o.photometric_frames = photometric_frames;
            o.pairs = Pairs::Star;
        });
        super::tests::value(&sequence, &options, &at).photometric
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
        let sequence = sequence(3).edited(|content| {
            for frame in &mut content.frames {
                frame.camera.fx *= times_as_far;
                frame.camera.fy *= times_as_far;
            }
        });
        let (sequence, mut at) = (sequence.unwrap(), estimate(3));
        for (l, pose) in at.camera_from_object.iter_mut().enumerate() {
            pose.translation.z = 1.6 * times_as_far;
            pose.translation.x += 0.02 * l as f64;
        }
        let options = ObjectiveOptions {
            weak_perspective,
            ..weak()
        };
        super::tests::value(&sequence, &options, &at).total
    };
    let (near, far) = (
        value(true, 1.0) / value(false, 1.0),
        value(true, 1e4) / value(false, 1e4),
    );
    assert!((far - 1.0).abs() < 1e-3, "{far}");
    assert!((near - 1.0).abs() > 5e-3, "{near}");
}

/// Pictures of twice the size show the same silhouettes.
#[test]
fn the_resolution_does_not_change_the_silhouettes_cost() {
    let (at, small) = (estimate(3), sequence(3));
    let large = small.clone().edited(|content| {
        for frame in &mut content.frames {
            let (width, height) = frame.mask.size();
            frame.mask = Mask::from_fn(2 * width, 2 * height, |c, r| frame.mask[(c / 2, r / 2)]);
            frame.image = RgbImage::from_fn(2 * width, 2 * height, |c, r| frame.image[(c / 2, r / 2)]).into();
            frame.camera = frame.camera.scaled(2.0, 2.0);
            frame.depth = None;
        }
    });
    let value = |sequence: &Sequence, size: f64| {
        let options = only(|o| {
            o.silhouette_weight = 1.0;
            o.silhouette_size = size;
            o.silhouette_pixels = 0;
            o.silhouette_points = 0;
        });
        super::tests::value(sequence, &options, &at).silhouette
    };
    let large = large.unwrap();
    let of_size = value(&large, 40.0) / value(&small, 40.0);
    assert!((of_size - 1.0).abs() < 0.03, "{of_size}");
    // In pixels as they are, the distances' squares and the pixels' number both grow fourfold, but for the robust loss.
    let of_pixels = value(&large, 0.0) / value(&small, 0.0);
    assert!(of_pixels > 3.0, "{of_pixels}");
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
        let rotation = Rotation3::from_scaled_axis(Vector3::from(omega));
        at.camera_from_object[0].rotation = rotation;
        at.camera_from_object[1].rotation = rotation;
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
