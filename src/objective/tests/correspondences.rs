//! The residuals for hosts against the objective that the solver minimises.

use super::*;
use crate::geometry::Vector3;

fn huber(squared: f64, width: f64) -> f64 {
    if squared <= width * width {
        squared
    } else {
        2.0 * width * squared.sqrt() - width * width
    }
}

/// Ramps, which interpolation of any order reproduces.
fn colour(u: f64, v: f64) -> Vector3<f64> {
    let (column, row) = (u - 0.5, v - 0.5);
    Vector3::new(2.0 * column, 20.0 + row, column + row)
}

/// Each term, added up residual by residual, at the estimate and after a step with matches found anew.
#[test]
fn the_residuals_one_by_one_add_up_to_the_objective() {
    let ramps = sequence(3).edited(|content| {
        for frame in &mut content.frames {
            frame.image = RgbImage::from_fn(96, 80, |c, r| {
                let rgb = colour(c as f64 + 0.5, r as f64 + 0.5);
                [rgb.x as f32, rgb.y as f32, rgb.z as f32]
            })
            .into();
        }
    });
    let sequence = Arc::new(ramps.unwrap());
    let options = ObjectiveOptions {
        points: 500,
        silhouette_points: 300,
        silhouette_pixels: 200,
        silhouette_targets: 600,
        ..Default::default()
    };
    let start = estimate(3);
    let prior = Arc::new(Blob::new(600));
    let mut found = Correspondences::new(sequence.clone(), prior.clone(), &options, 0, &start, 1).unwrap();
    let footage = Footage::new(&sequence, 1).unwrap();
    let mut setting = setting(&footage, &options, &start);

    let mut moved = start.clone();
    moved.camera_from_object[1].translation.x += 0.03;
    moved.style[0] -= 0.4;
    for at in [start, moved] {
        setting.at = at.clone();
        found.rematch(&at).unwrap();
        let value = setting.value();

        let mut points = vec![0.0; 3 * prior.point_count()];
        prior.points(&at.style, &mut points);
        let in_camera = |point: u32, frame: u32| {
            let x = &points[3 * point as usize..][..3];
            at.camera_from_object[frame as usize].transform(&Vector3::from_column_slice(x))
        };
        let seen = |point: u32, frame: u32| {
            let camera = &sequence.frames[frame as usize].camera;
            let at = camera.project(&in_camera(point, frame)).unwrap();
            [at.x, at.y]
        };
        let close = |what: &str, sum: f64, known: f64| {
            assert!(
                known > 0.0 && (sum - known).abs() < 1e-6 * known,
                "{what}: {sum} {known}"
            );
        };

        let photometric = found.compared().iter().map(|compared| {
            let [a, b] = [compared.frame_a, compared.frame_b].map(|frame| {
                let [u, v] = seen(compared.point, frame);
                colour(u, v)
            });
            compared.weight / 2.0 * huber((a - b).norm_squared(), found.photometric_huber())
        });
        close("photometric", photometric.sum(), value.photometric);

        let (weight, width) = found.inverse_depth();
        let inverse_depth = found.depths().iter().map(|known| {
            let [u, v] = seen(known.point, known.frame);
            let there = known.inverse_depth
                + known.slope[0] * (u - known.pixel[0])
                + known.slope[1] * (v - known.pixel[1]);
            let residual = there - at.alpha / in_camera(known.point, known.frame).z;
            weight / 2.0 * huber(residual * residual, width)
        });
        close("inverse depth", inverse_depth.sum(), value.inverse_depth);

        let (tolerance, cauchy) = (found.silhouette_tolerance(), found.silhouette_cauchy());
        let silhouette_cost = |weight: f64, a: [f64; 2], b: [f64; 2]| {
            let beyond = ((a[0] - b[0]).hypot(a[1] - b[1]) - tolerance).max(0.0);
            weight / 2.0 * cauchy * cauchy * (beyond * beyond / (cauchy * cauchy)).ln_1p()
        };
        let silhouettes = (0u32..).zip(found.silhouettes()).map(|(frame, matches)| {
            let points = (0u32..).zip(&matches.pixel_of_point).zip(&matches.point_weights);
            let of_points =
                points.map(|((j, &pixel), &weight)| silhouette_cost(weight, seen(j, frame), pixel));
            let pixels = matches.pixels.iter().zip(&matches.point_of_pixel);
            let of_pixels =
                pixels.map(|(&pixel, &j)| silhouette_cost(matches.pixel_weight, seen(j, frame), pixel));
            of_points.sum::<f64>() + of_pixels.sum::<f64>()
        });
        close("silhouettes", silhouettes.sum(), value.silhouette);

        let style = found.style_weight() / 2.0 * at.style.iter().map(|s| s * s).sum::<f64>();
        close("style", style, value.style);
        let all = value.photometric + value.inverse_depth + value.silhouette + value.style;
        close("total", all, value.total);
    }
}
