//! What features say of the focal length, how far that can be trusted, and how it goes together with what was known.

use super::StructureFromMotionError;
use super::grow::Reconstruction;
use crate::geometry::{Pinhole, Vector3};
use rayon::prelude::*;

/// Deviation of a focal length's logarithm of which nothing is known: features move it freely.
pub const FREE: f64 = 1.0;
/// Focal lengths of pictures of which nothing is known, in longer sides: COLMAP's first guess, and a standard deviation of the logarithm that has
/// a phone's wide lens and a short tele lens within two of it.
const USUAL: (f64, f64) = (1.2, 0.5);
/// No evidence is taken to be better than this.
const MIN_DEVIATION: f64 = 0.005;
/// How often features mislead all together, and by how much then (standard deviation of the logarithm): reflections that slide over a whole
/// body pull every part of it the same way, which leaving out parts cannot show.
const MISLED: (f64, f64) = (1.0 / 3.0, 0.2);

/// A focal length and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FocalEvidence {
    pub px: f64,
    /// Standard deviation of its logarithm.
    pub deviation: f64,
}

impl FocalEvidence {
    /// What is likely where nothing is known. The camera's principal point is taken for the middle of the picture.
    pub fn usual(camera: &Pinhole) -> Self {
        Self {
            px: USUAL.0 * 2.0 * camera.cx.max(camera.cy),
            deviation: USUAL.1,
        }
    }

    /// Both together: the mean of the logarithms, weighted by the inverse variances.
    pub fn fused(self, other: Self) -> Self {
        let [own, theirs] = [self, other].map(|evidence| evidence.deviation.powi(-2));
        let log = (own * self.px.ln() + theirs * other.px.ln()) / (own + theirs);
        Self {
            px: log.exp(),
            deviation: (own + theirs).powf(-0.5),
        }
    }

    /// This and what features say, which may be as good as they seem or mislead: the mean and the deviation of the mixture of both cases. Where
    /// features agree with what was known, they are believed; the more they contradict it, the less.
    pub fn fused_with_features(self, features: Self) -> Self {
        let (share, misled) = MISLED;
        let cases = [
            (1.0 - share, features.deviation),
            (share, features.deviation.hypot(misled)),
        ];
        let cases = cases.map(|(share, deviation)| {
            let case = Self {
                deviation,
                ..features
            };
            let likelihood = (-0.5 * self.apart(case).powi(2)).exp() / self.deviation.hypot(deviation);
            (share * likelihood, self.fused(case))
        });
        let total: f64 = cases.iter().map(|(weight, _)| weight).sum();
        let mean = |of: &dyn Fn(&Self) -> f64| {
            cases.iter().map(|(weight, both)| weight * of(both)).sum::<f64>() / total
        };
        let log = mean(&|both| both.px.ln());
        let variance = mean(&|both| both.deviation.powi(2) + (both.px.ln() - log).powi(2));
        Self {
            px: log.exp(),
            deviation: variance.sqrt(),
        }
    }

    /// By how many standard deviations of their difference the two differ.
    pub fn apart(self, other: Self) -> f64 {
        (self.px / other.px).ln().abs() / self.deviation.hypot(other.deviation)
    }
}

/// What the features of a reconstruction say: an adjustment that leaves the focal length to them, and how much it changes when the
/// points of each eighth of the object are left out in turn (the jackknife over groups). Formal variances know nothing of highlights that
/// slide over paint, a whole region of which is wrong together: of three cars whose turn is known, the features are off by 1, 8 and 19 %,
/// by the jackknife ± 2, 14 and 16 %.
pub fn by_features(reconstruction: &Reconstruction) -> Result<FocalEvidence, StructureFromMotionError> {
    let mut all = reconstruction.clone().with_free_focal();
    all.bundle()?;
    let px = all.focal_px();
    let octant = octants(&all.points().copied().collect::<Vec<_>>());
    let logs = (0..8)
        .into_par_iter()
        .map(|left_out| {
            let mut some = all.clone();
            some.keep_points(|point| octant(point) != left_out);
            some.bundle()?;
            Ok((some.focal_px() / px).ln())
        })
        .collect::<Result<Vec<f64>, StructureFromMotionError>>()?;
    Ok(FocalEvidence {
        px,
        deviation: jackknife(&logs).max(MIN_DEVIATION),
    })
}

/// Which eighth of the object a point belongs to, as split by the medians of the coordinates.
fn octants(points: &[Vector3<f64>]) -> impl Fn(&Vector3<f64>) -> usize + Sync + use<> {
    let middle = super::super::depth::middle(points);
    move |point| (0..3).map(|k| usize::from(point[k] > middle[k]) << k).sum()
}

/// The standard deviation of an estimate by what it becomes without each of several groups of its data.
fn jackknife(without: &[f64]) -> f64 {
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let squares: f64 = without.iter().map(|value| (value - mean).powi(2)).sum();
    ((count - 1.0) / count * squares).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_counts_by_its_variance() {
        let sharp = FocalEvidence {
            px: 300.0,
            deviation: 0.01,
        };
        let blunt = FocalEvidence {
            px: 330.0,
            deviation: 0.1,
        };
        let both = sharp.fused(blunt);
        let share = 1.0 / 101.0;
        assert!((both.px - 300.0 * 1.1f64.powf(share)).abs() < 1e-9);
        assert!((both.deviation - 0.01 * (100.0f64 / 101.0).sqrt()).abs() < 1e-12);
        assert!((sharp.apart(blunt) - 1.1f64.ln() / 0.0101f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn features_are_believed_unless_they_contradict_what_was_known() {
        let known = FocalEvidence {
            px: 300.0,
            deviation: 0.06,
        };
        let features = |px: f64| FocalEvidence { px, deviation: 0.05 };
        // Alike, both hold as they seem, but for the chance of misleading ones.
        let agreed = known.fused_with_features(features(300.0));
        let both = known.fused(features(300.0));
        assert!((agreed.px - 300.0).abs() < 1e-9);
        assert!(agreed.deviation > both.deviation && agreed.deviation < 1.15 * both.deviation);
        // Five times the deviation of their difference apart, the features are those that mislead.
        let far = features(300.0 * (5.0 * 0.06f64.hypot(0.05)).exp());
        let misleading = FocalEvidence {
            deviation: 0.05f64.hypot(0.2),
            ..far
        };
        let contradicted = known.fused_with_features(far);
        assert!((contradicted.px / known.fused(misleading).px).ln().abs() < 1e-3);
        assert!(known.fused(far).px > 1.1 * contradicted.px);
    }

    #[test]
    fn usual_lenses_decide_where_features_say_little() {
        let camera = Pinhole {
            fx: 1000.0,
            fy: 1000.0,
            cx: 320.0,
            cy: 240.0,
        };
        let usual = FocalEvidence::usual(&camera);
        assert!((usual.px - 768.0).abs() < 1e-9);
        let fused = |deviation| {
            usual.fused_with_features(FocalEvidence {
                px: 1500.0,
                deviation,
            })
        };
        let sharp = fused(0.03);
        assert!(sharp.px > 1400.0 && sharp.deviation > 0.1, "{sharp:?}");
        assert!(fused(0.5).px < 1080.0);
    }

    #[test]
    fn the_jackknife_of_a_mean_is_its_standard_error() {
        let values = [3.0, 5.0, 4.0, 8.0];
        let sum: f64 = values.iter().sum();
        let without = values.map(|value| (sum - value) / 3.0);
        // Variance 14 / 3 of the values, a quarter of it of their mean.
        assert!((jackknife(&without) - (14.0f64 / 3.0 / 4.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn octants_are_told_apart_by_every_coordinate() {
        let corners: Vec<Vector3<f64>> = (0..8)
            .map(|k| Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64))
            .collect();
        let points: Vec<Vector3<f64>> = corners
            .iter()
            .map(|corner| corner * 2.0)
            .chain([Vector3::repeat(1.0)])
            .collect();
        let octant = octants(&points);
        for (k, corner) in corners.iter().enumerate() {
            assert_eq!(octant(&(corner * 2.0)), k);
        }
    }
}
