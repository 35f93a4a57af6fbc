//! How bright each frame is against the others, by the points that several see: cameras expose and balance anew from frame to frame.

use super::Surface;
use super::colour::bilinear;
use crate::geometry::Pose;
use crate::sequence::Frame;
use nalgebra::{DMatrix, DVector};

/// Darker and brighter colours are clipped, and say nothing of a factor.
const UNCLIPPED: std::ops::RangeInclusive<f64> = 8.0..=247.0;
/// Below this cosine between normal and line of sight a point shows reflections above all.
const MIN_COSINE: f64 = 0.3;
/// How much a point's brightness differs between frames of one exposure, as the logarithm of a factor: highlights wander.
const SCATTER: f64 = 0.15;
/// How much exposures differ, as the logarithm of a factor.
const USUAL: f64 = 0.3;
/// Points lie close together and differ alike: a frame's count as much as so many that do not.
const INDEPENDENT: f64 = 100.0;
/// Rounds in which points that differ by more than [`SCATTER`] lose weight.
const ROUNDS: usize = 4;

/// What one frame shows of a point: the frame, the weight, and the logarithms of R, G and B.
type Sighting = (usize, f64, [f64; 3]);

/// Per frame the factors on R, G and B by which all frames agree best, about 1 in the mean.
pub(super) fn gains(surface: &Surface, frames: &[Frame], poses: &[Pose]) -> Vec<[f64; 3]> {
    let mut sightings: Vec<Vec<Sighting>> = vec![Vec::new(); surface.points().len()];
    for (l, (frame, pose)) in frames.iter().zip(poses).enumerate() {
        for point in surface.visible(&frame.camera, pose, frame.image.size()) {
            let i = point as usize;
            let in_camera = pose.transform(&surface.points()[i]);
            let cosine = -(pose.rotation * surface.normals()[i]).dot(&in_camera) / in_camera.norm();
            let Some(pixel) = frame.camera.project(&in_camera).filter(|_| cosine > MIN_COSINE) else {
                continue;
            };
            let at = frame.mask.pixel_at(pixel.x, pixel.y);
            let colour = bilinear(&frame.image, pixel.x, pixel.y);
            if at.is_some_and(|at| frame.mask[at]) && colour.iter().all(|part| UNCLIPPED.contains(part)) {
                sightings[i].push((l, cosine, colour.map(f64::ln)));
            }
        }
    }
    sightings.retain(|of_point| of_point.len() > 1);
    let channels = [0, 1, 2].map(|channel| log_gains(&sightings, channel, frames.len()));
    (0..frames.len())
        .map(|l| [0, 1, 2].map(|channel| channels[channel][l].exp()))
        .collect()
}

/// Minimises Σ w (x + γ − μ)² / SCATTER² + Σ γ² / USUAL² over γ, one a frame, and μ, one a point; w is the sighting's, less where it differs.
fn log_gains(sightings: &[Vec<Sighting>], channel: usize, frames: usize) -> DVector<f64> {
    let mut all = vec![0.0; frames];
    for &(l, weight, _) in sightings.iter().flatten() {
        all[l] += weight;
    }
    let share = |l: usize| INDEPENDENT / all[l].max(INDEPENDENT);
    let mut gains: DVector<f64> = DVector::zeros(frames);
    for _ in 0..ROUNDS {
        let mut normal = DMatrix::from_diagonal_element(frames, frames, (SCATTER / USUAL).powi(2));
        let mut right: DVector<f64> = DVector::zeros(frames);
        for of_point in sightings {
            let value = |&(l, _, colour): &Sighting| colour[channel] + gains[l];
            let plain: f64 = of_point.iter().map(|sighting| sighting.1).sum();
            let mean = of_point
                .iter()
                .map(|sighting| sighting.1 * value(sighting))
                .sum::<f64>()
                / plain;
            let weigh = |sighting: &Sighting| {
                let differs = (value(sighting) - mean).abs();
                sighting.1 * share(sighting.0) * (SCATTER / differs.max(SCATTER))
            };
            let weights: Vec<f64> = of_point.iter().map(weigh).collect();
            let total: f64 = weights.iter().sum();
            let seen = || of_point.iter().zip(&weights);
            let mean = seen().map(|((_, _, colour), w)| w * colour[channel]).sum::<f64>() / total;
            for (&(l, _, colour), w) in seen() {
                normal[(l, l)] += w;
                right[l] -= w * (colour[channel] - mean);
                for (&(other, ..), v) in seen() {
                    normal[(l, other)] -= w * v / total;
                }
            }
        }
        if let Some(cholesky) = normal.cholesky() {
            gains = cholesky.solve(&right);
        }
    }
    gains
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{box_car, solved};

    /// Frames darkened by known factors are evened out again, up to a common factor.
    #[test]
    fn frames_of_other_exposure_are_brought_together() {
        let surface = Surface::from_points(box_car(2000));
        let (sequence, solution) = solved(&surface, 4);
        let factors = [
            [1.0, 1.0, 1.0],
            [0.7, 0.75, 0.8],
            [0.9, 0.9, 0.9],
            [0.6, 0.65, 0.7],
        ];
        let frames: Vec<Frame> = sequence
            .frames
            .iter()
            .zip(factors)
            .map(|(frame, factor)| Frame {
                image: crate::image::Grid::from_fn(frame.image.width(), frame.image.height(), |c, r| {
                    std::array::from_fn(|k| frame.image[(c, r)][k] * factor[k] as f32)
                })
                .into(),
                ..frame.clone()
            })
            .collect();
        let plain = gains(&surface, &sequence.frames, &solution.estimate.camera_from_object);
        let evened = gains(&surface, &frames, &solution.estimate.camera_from_object);
        for channel in 0..3 {
            let common = evened[0][channel] / plain[0][channel];
            for (l, factor) in factors.iter().enumerate() {
                let found = evened[l][channel] / plain[l][channel] / common;
                assert!(
                    (found * factor[channel] - 1.0).abs() < 0.03,
                    "frame {l}: {found} for {factor:?}"
                );
            }
        }
    }

    #[test]
    fn a_frame_that_shares_no_point_stays_as_it_is() {
        let surface = Surface::from_points(box_car(500));
        let (sequence, solution) = solved(&surface, 1);
        let alone = gains(&surface, &sequence.frames, &solution.estimate.camera_from_object);
        assert_eq!(alone, [[1.0; 3]]);
    }
}
