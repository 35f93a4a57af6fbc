//! Terms against sums by hand, and what goes into them.

use super::*;
use crate::objective::matcher::photometric_points;
use crate::visibility::{Visibility as Seen, visible_points};

/// Eq. 5 by its definition: brute force over all pixels and points.
#[test]
fn the_silhouette_term_is_the_chamfer_distance() {
    the_silhouette_term_is_that_of(0.0, 0.0);
    the_silhouette_term_is_that_of(1.0, 0.0);
    the_silhouette_term_is_that_of(1.0, 7.0);
}

fn the_silhouette_term_is_that_of(tolerance: f64, agreement: f64) {
    let at = estimate(3);
    let sequence = sequence(3);
    let options = ObjectiveOptions {
        silhouette_pixels: 0,
        silhouette_points: 0,
        silhouette_cauchy: 0.0,
        silhouette_tolerance: tolerance,
        silhouette_size: 0.0,
        silhouette_agreement: agreement,
        ..only(|o| o.silhouette_weight = 0.1)
    };
    let mut setting = setting(&Footage::new(&sequence, 1).unwrap(), &options, &at);
    let points = setting.objective.points(&at);
    let mut chamfer = 0.0;
    let mut of_points = vec![0.0; points.len() / 3];
    let mut outside = vec![0.0; points.len() / 3];
    for (l, frame) in sequence.frames.iter().enumerate() {
        let pose = at.camera_from_object[l];
        let projected: Vec<_> = points
            .chunks_exact(3)
            .map(|x| {
                frame
                    .camera
                    .project(&pose.transform(&Vector3::from_column_slice(x)))
                    .unwrap()
            })
            .collect();
        let mut pixels = Vec::new();
        for r in 0..frame.mask.height() {
            for c in 0..frame.mask.width() {
                if frame.mask[(c, r)] {
                    pixels.push(nalgebra::Vector2::new(c as f64 + 0.5, r as f64 + 0.5));
                }
            }
        }
        let nearest = |from: &nalgebra::Vector2<f64>, to: &[nalgebra::Vector2<f64>]| {
            let distance = to.iter().map(|u| (u - from).norm()).fold(f64::INFINITY, f64::min);
            (distance - tolerance).max(0.0).powi(2)
        };
        chamfer += pixels.iter().map(|u| nearest(u, &projected)).sum::<f64>();
        for (j, u) in projected.iter().enumerate() {
            of_points[j] += nearest(u, &pixels);
            // More than three whole pixels, from the middle of the one that shows the point.
            let cell = u.map(|x| x.floor() + 0.5);
            let beyond = pixels.iter().all(|pixel| (pixel - cell).norm() >= 4.0);
            outside[j] += f64::from(beyond) / 3.0;
        }
    }
    // Up to a quarter of the frames may err, from three quarters on they do not; here all see every point.
    let weight = |share: f64| 1.0 + agreement * (2.0 * share - 0.5).clamp(0.0, 1.0);
    chamfer += of_points
        .iter()
        .zip(&outside)
        .map(|(sum, &share)| weight(share) * sum)
        .sum::<f64>();
    assert!(outside.iter().any(|&share| share > 0.25) && outside.contains(&0.0));
    let expected = 0.1 * chamfer / 3.0;
    let value = setting.value().silhouette;
    assert!(
        (value - expected).abs() < 1e-9 * expected,
        "{value} against {expected}"
    );
}

#[test]
fn points_outside_are_weighed_halfway_to_the_step_before() {
    let options = ObjectiveOptions {
        silhouette_size: 0.0,
        silhouette_agreement: 7.0,
        ..only(|o| o.silhouette_weight = 0.1)
    };
    let sequence = sequence(3);
    let footage = Footage::new(&sequence, 1).unwrap();
    let Setting {
        mut objective,
        mut at,
        visibility: before,
    } = setting(&footage, &options, &estimate(3));
    for pose in &mut at.camera_from_object {
        pose.translation.x += 0.1;
    }
    let now = objective.visibility(&at, 0).unwrap();
    let next = objective.next_visibility(&at, 0, &before).unwrap();
    let [before, now, next] =
        [before, now, next].map(|visibility| objective.evaluate(&at, &visibility).unwrap().silhouette);
    assert!((before - now).abs() > 0.01 * now, "{before} {now}");
    assert!((next - f64::midpoint(before, now)).abs() < 1e-9 * now, "{next}");
}

/// Eq. 6 by hand: d' is linear in the column, so its first order is d' itself wherever a point projects.
#[test]
fn the_inverse_depth_term_is_eq_6() {
    the_inverse_depth_term_is_that_of(0.0, 1e-9);
    // Here the depths' own single precision limits the agreement.
    the_inverse_depth_term_is_that_of(0.002, 1e-6);
}

fn the_inverse_depth_term_is_that_of(slope: f64, accuracy: f64) {
    let at = Estimate {
        alpha: 2.0,
        ..estimate(2)
    };
    let given = |u: f64| 0.4 + slope * u;
    let sequence = sequence(2).edited(|content| {
        for frame in &mut content.frames {
            frame.depth = Some(crate::image::DepthMap::from_fn(96, 80, |c, _| {
                (1.0 / given(c as f64 + 0.5)) as f32
            }));
        }
    });
    let sequence = sequence.unwrap();
    let options = only(|o| (o.inverse_depth_weight, o.inverse_depth_huber) = (1000.0, 10.0));
    let mut setting = setting(&Footage::new(&sequence, 1).unwrap(), &options, &at);
    setting.at.alpha = 3.0;
    let points = setting.objective.points(&at);
    let cover = setting.objective.matcher.cover(&at.style, &points);
    let mut expected = 0.0;
    for (l, frame) in sequence.frames.iter().enumerate() {
        let pose = at.camera_from_object[l];
        let size = frame.image.size();
        for v in visible_points(&points, &frame.camera, &pose, size, Some(&cover)).points {
            let pixel = (v.pixel.0 as usize, v.pixel.1 as usize);
            if frame.mask[pixel] {
                let x = Vector3::from_column_slice(&points[3 * v.point as usize..][..3]);
                let u = frame.camera.project(&pose.transform(&x)).unwrap().x;
                // In units in which α started at 1.
                let residual = (given(u) - 3.0 * v.inverse_depth) / 2.0;
                expected += 1000.0 / 2.0 * 0.5 * residual * residual;
            }
        }
    }
    let value = setting.value().inverse_depth;
    assert!(
        expected > 1.0 && (value - expected).abs() < accuracy * expected,
        "{value} against {expected}"
    );
}

/// Of five points all but the third lie inside both masks; the target sees 0, 1, 2, the source 1, 2, 3, and to the
/// source point 0 is hidden.
#[test]
fn eq_4_takes_points_inside_both_masks_and_hidden_in_neither() {
    let seen = |points: &[u32], unoccluded: [bool; 5]| Seen {
        points: points
            .iter()
            .map(|&point| crate::visibility::VisiblePoint {
                pixel: (point, 0),
                point,
                inverse_depth: 1.0,
            })
            .collect(),
        unoccluded: unoccluded.to_vec(),
        ..Seen::default()
    };
    let target = seen(&[0, 1, 2], [true; 5]);
    let source = seen(&[1, 2, 3], [false, true, true, true, true]);
    let inside = [true, true, false, true, true];
    let taken = |covisible| {
        photometric_points([&target, &source], [&inside, &[true; 5]], covisible).collect::<Vec<_>>()
    };
    assert_eq!(taken(true), [(1, 2), (3, 1)]);
    assert_eq!(taken(false), [(0, 1), (1, 2), (3, 1)]);
}

#[test]
fn a_shape_behind_a_camera_is_an_error() {
    let sequence = sequence(2);
    let footage = Footage::new(&sequence, 1).unwrap();
    let mut setting = setting(&footage, &ObjectiveOptions::default(), &estimate(2));
    setting.at.camera_from_object[0].translation.z = -1.6;
    let error = setting.objective.evaluate(&setting.at, &setting.visibility);
    assert!(error.unwrap_err().to_string().contains("behind a camera"));
    assert!(
        setting
            .objective
            .differentiate(&setting.at, &setting.visibility)
            .is_err()
    );
}

/// The paper's star, and neighbours: each pair's two sums by hand.
#[test]
fn eq_4_is_a_mean_over_pairs() {
    let (sequence, at) = (sequence(4), estimate(4));
    let value = |pairs: Pairs, target: usize| {
        let options = only(|o| {
            o.photometric_weight = 1.0;
            o.photometric_frames = 0;
            o.pairs = pairs;
        });
        setting_with_target(&Footage::new(&sequence, 1).unwrap(), &options, &at, target)
            .value()
            .photometric
    };
    let pair = |a: usize, b: usize| {
        let two = sequence.clone().edited(|content| {
            content.frames = vec![sequence.frames[a].clone(), sequence.frames[b].clone()];
        });
        let two = two.unwrap();
        let mut estimate = at.clone();
        estimate.camera_from_object = vec![at.camera_from_object[a], at.camera_from_object[b]];
        let options = only(|o| {
            o.photometric_weight = 1.0;
            o.pairs = Pairs::Star;
        });
        super::value(&two, &options, &estimate).photometric
    };
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
    };
    close(value(Pairs::Star, 0), pair(0, 1) + pair(0, 2) + pair(0, 3));
    close(value(Pairs::Star, 2), pair(2, 0) + pair(2, 1) + pair(2, 3));
    let five = pair(0, 1) + pair(1, 2) + pair(2, 3) + pair(0, 2) + pair(1, 3);
    close(value(Pairs::Offsets(vec![1, 2, 8]), 0), 3.0 / 5.0 * five);
}
