//! Gaussian blur. The `image` crate's cuts its kernel off at one pixel for deviations up to 0.8, which blurs less than
//! it says.

use super::{Grid, RgbImage};

/// The kernel ends where it has fallen to 0.03 % of its peak.
const DEVIATIONS: f64 = 4.0;

/// `image` under a Gaussian of standard deviation `deviation_px`, which must be positive; borders repeat.
pub fn blur(image: &RgbImage, deviation_px: f64) -> RgbImage {
    let radius = (DEVIATIONS * deviation_px).ceil() as usize;
    let weights: Vec<f64> = (0..=2 * radius)
        .map(|tap| (-0.5 * ((tap as f64 - radius as f64) / deviation_px).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|weight| (weight / sum) as f32).collect();
    let (width, height) = image.size();
    let narrow = Grid::from_fn(width, height, |column, row| {
        filtered(&weights, column, width, |c| image[(c, row)])
    });
    Grid::from_fn(width, height, |column, row| {
        filtered(&weights, row, height, |r| narrow[(column, r)])
    })
}

fn filtered(weights: &[f32], centre: usize, length: usize, sample: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (tap, weight) in weights.iter().enumerate() {
        let at = (centre + tap).saturating_sub(weights.len() / 2).min(length - 1);
        for (total, value) in sum.iter_mut().zip(sample(at)) {
            *total += weight * value;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_spreads_as_asked_and_keeps_its_place_and_sum() {
        for deviation in [0.5, 0.8, 2.0] {
            let point = Grid::from_fn(41, 31, |c, r| [if (c, r) == (20, 15) { 100.0 } else { 0.0 }; 3]);
            let blurred = blur(&point, deviation);
            let moment = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
                let each = blurred.data().iter().enumerate();
                each.map(|(i, p)| f64::from(p[0]) / 100.0 * f((i % 41) as f64 - 20.0, (i / 41) as f64 - 15.0))
                    .sum()
            };
            assert!((moment(&|_, _| 1.0) - 1.0).abs() < 1e-4);
            assert!(moment(&|x, _| x).abs() < 1e-4 && moment(&|_, y| y).abs() < 1e-4);
            // That of a Gaussian sampled at whole pixels, which where it is narrow is less than the continuous one's.
            let weight = |x: i32| (-f64::from(x * x) / (2.0 * deviation * deviation)).exp();
            let sum = |f: fn(i32) -> f64| (-20..=20).map(|x| f(x) * weight(x)).sum::<f64>();
            let expected = sum(|x| f64::from(x * x)) / sum(|_| 1.0);
            for variance in [moment(&|x, _| x * x), moment(&|_, y| y * y)] {
                assert!(
                    (variance - expected).abs() < 0.01 * expected,
                    "{deviation}: {variance}, not {expected}"
                );
            }
        }
    }

    #[test]
    fn an_even_image_stays_even_up_to_its_border() {
        let even = Grid::filled(7, 5, [40.0, 90.0, 200.0]);
        for (blurred, given) in blur(&even, 3.0).data().iter().zip(even.data()) {
            assert!((0..3).all(|c| (blurred[c] - given[c]).abs() < 1e-3));
        }
    }
}
