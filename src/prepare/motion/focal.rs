//! What features say of the focal length, how far that can be trusted, and how it goes together with what was known.

use super::StructureFromMotionError;
use super::grow::Reconstruction;
use crate::geometry::Pinhole;

/// Deviation of a focal length's logarithm of which nothing is known: features move it freely.
pub const FREE: f64 = 1.0;
/// Focal lengths of pictures of which nothing is known, in longer sides: COLMAP's first guess, and a standard deviation of the logarithm that has
/// a phone's wide lens and a short tele lens within two of it.
const USUAL: (f64, f64) = (1.2, 0.7);
/// No evidence is taken to be better than this.
const MIN_DEVIATION: f64 = 0.005;
/// The features' cost counts by this factor less: they err together, as where a highlight slides over a whole door.
pub const OVERDISPERSION: f64 = 4.0;
/// A logarithm of a likelihood this far below the greatest does not count.
const NEGLIGIBLE: f64 = 6.0;
/// The profile's focal lengths: their logarithms go on from the best reconstruction's by this.
const STEP: f64 = 0.2;
/// And from where the cost is least by these.
const FINE_STEPS: [f64; 2] = [0.02, 0.06];
/// No focal length of the profile is shorter or longer, in longer sides.
const RANGE: (f64, f64) = (0.3, 12.0);

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
            px: USUAL.0 * longer_side(camera),
            deviation: USUAL.1,
        }
    }

    /// By how many standard deviations of their difference the two differ.
    pub fn apart(self, other: Self) -> f64 {
        (self.px / other.px).ln().abs() / self.deviation.hypot(other.deviation)
    }
}

/// The camera's principal point is taken for the middle of the picture.
fn longer_side(camera: &Pinhole) -> f64 {
    2.0 * camera.cx.max(camera.cy)
}

/// A reconstruction whose focal length was held while everything else was adjusted.
#[derive(Clone)]
struct Sample<'a> {
    /// The focal length's logarithm.
    log_px: f64,
    cost: f64,
    adjusted: Reconstruction<'a>,
}

impl<'a> Sample<'a> {
    fn of(adjusted: Reconstruction<'a>) -> Self {
        Self {
            log_px: adjusted.focal_px().ln(),
            cost: adjusted.cost(),
            adjusted,
        }
    }

    fn at(&self, log_px: f64) -> Result<Self, StructureFromMotionError> {
        let mut other = self.adjusted.clone();
        other.hold_focal(log_px.exp());
        other.bundle()?;
        Ok(Self::of(other))
    }
}

/// The profile likelihood of the focal length: how well the features of a reconstruction fit with each.
pub struct Profile<'a> {
    /// By rising focal length.
    samples: Vec<Sample<'a>>,
}

impl<'a> Profile<'a> {
    /// Walks from the focal length of a reconstruction to both sides, for as far as it is likely, and looks closer about the likeliest. A free
    /// adjustment alone may end where it began, since cameras far away and a long focal length make nearly the same pictures.
    pub fn of(reconstruction: &Reconstruction<'a>) -> Result<Self, StructureFromMotionError> {
        let longer = longer_side(reconstruction.camera());
        let [shortest, longest] = [RANGE.0, RANGE.1].map(|sides| (sides * longer).ln());
        let first =
            Sample::of(reconstruction.clone()).at(reconstruction.focal_px().ln().clamp(shortest, longest))?;
        let walk = |step: f64| -> Result<Vec<Sample>, StructureFromMotionError> {
            let (mut walked, mut least) = (vec![first.clone()], first.cost);
            while let Some(last) = walked.last()
                && (last.cost - least) / OVERDISPERSION < NEGLIGIBLE
                && (shortest..=longest).contains(&(last.log_px + step))
            {
                let next = last.at(last.log_px + step)?;
                least = least.min(next.cost);
                walked.push(next);
            }
            Ok(walked)
        };
        let (shorter, longer) = rayon::join(|| walk(-STEP), || walk(STEP));
        let mut samples: Vec<Sample> = shorter?.into_iter().chain(longer?.into_iter().skip(1)).collect();
        let nearest = samples
            .iter()
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
            .cloned()
            .unwrap_or(first);
        let mut best = nearest.adjusted.clone().with_free_focal();
        best.bundle()?;
        let free = Sample::of(best);
        let best = if free.cost < nearest.cost { free } else { nearest };
        for step in FINE_STEPS.iter().flat_map(|&step| [-step, step]) {
            samples.push(best.at(best.log_px + step)?);
        }
        samples.push(best);
        samples.sort_by(|a, b| a.log_px.total_cmp(&b.log_px));
        Ok(Self { samples })
    }

    /// What features say, and with it what was `known`: mean and deviation of the logarithm.
    pub fn evidence(&self, known: Option<FocalEvidence>) -> FocalEvidence {
        let costs: Vec<(f64, f64)> = self
            .samples
            .iter()
            .map(|sample| (sample.log_px, sample.cost))
            .collect();
        evidence(&costs, known)
    }

    /// The reconstruction with the focal length nearest to one.
    pub fn near(&self, px: f64) -> Option<&Reconstruction<'a>> {
        let apart = |sample: &&Sample| (sample.log_px - px.ln()).abs();
        let nearest = self.samples.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        Some(&nearest.adjusted)
    }
}

/// Mean and deviation of the logarithm of a focal length, whose cost is known at some (by rising logarithms).
fn evidence(costs: &[(f64, f64)], known: Option<FocalEvidence>) -> FocalEvidence {
    const POINTS: usize = 64;
    let (best, least) = costs
        .iter()
        .copied()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0.0, 0.0));
    // A square is what costs are nearly, and its root is a straight line.
    let root = |(log_px, cost): (f64, f64)| (cost - least).sqrt().copysign(log_px - best);
    let of_known = |log_px: f64| {
        known.map_or(0.0, |known| {
            0.5 * ((log_px - known.px.ln()) / known.deviation).powi(2)
        })
    };
    let mut points = Vec::new();
    for pair in costs.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        for k in 0..POINTS {
            let share = (k as f64 + 0.5) / POINTS as f64;
            let log_px = a.0 + share * (b.0 - a.0);
            let cost = (root(a) + share * (root(b) - root(a))).powi(2);
            points.push((
                log_px,
                cost / OVERDISPERSION + of_known(log_px),
                (b.0 - a.0) / POINTS as f64,
            ));
        }
    }
    let likeliest = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
    let weighted = |of: &dyn Fn(f64) -> f64| -> f64 {
        points
            .iter()
            .map(|&(log_px, cost, width)| width * (likeliest - cost).exp() * of(log_px))
            .sum()
    };
    let total = weighted(&|_| 1.0);
    if total <= 0.0 {
        return FocalEvidence {
            px: best.exp(),
            deviation: MIN_DEVIATION,
        };
    }
    let mean = weighted(&|log_px| log_px) / total;
    let variance = weighted(&|log_px| (log_px - mean).powi(2)) / total;
    FocalEvidence {
        px: mean.exp(),
        deviation: variance.sqrt().max(MIN_DEVIATION),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The costs of features that say 300 px, at focal lengths apart by 0.15.
    fn costs(deviation: f64) -> Vec<(f64, f64)> {
        (-20..=20)
            .map(|k| {
                let log = 0.15 * f64::from(k);
                (
                    300f64.ln() + log,
                    17.0 + OVERDISPERSION * 0.5 * (log / deviation).powi(2),
                )
            })
            .collect()
    }

    #[test]
    fn a_profile_that_is_a_square_says_its_middle_and_its_deviation() {
        let alone = evidence(&costs(0.2), None);
        assert!((alone.px / 300.0).ln().abs() < 1e-9, "{alone:?}");
        assert!((alone.deviation / 0.2 - 1.0).abs() < 0.01, "{alone:?}");
    }

    #[test]
    fn evidence_counts_by_its_variance() {
        let known = FocalEvidence {
            px: 330.0,
            deviation: 0.1,
        };
        let both = evidence(&costs(0.2), Some(known));
        assert!(
            (both.px - 330.0 * (300.0f64 / 330.0).powf(0.2)).abs() < 0.5,
            "{both:?}"
        );
        assert!(
            (both.deviation / 0.2 * 5.0f64.sqrt() - 1.0).abs() < 0.02,
            "{both:?}"
        );
        assert!((known.apart(evidence(&costs(0.2), None)) - 1.1f64.ln() / 0.05f64.sqrt()).abs() < 1e-2);
    }

    /// As of cameras far away: shorter focal lengths do not fit, longer ones hardly less well.
    #[test]
    fn where_longer_lenses_fit_as_well_usual_ones_decide() {
        let costs: Vec<(f64, f64)> = (-8..=20)
            .map(|k| {
                let log = 0.15 * f64::from(k);
                (
                    1200f64.ln() + log,
                    if k < 0 {
                        50.0 * OVERDISPERSION * log.powi(2)
                    } else {
                        0.75 * OVERDISPERSION * log
                    },
                )
            })
            .collect();
        let alone = evidence(&costs, None);
        assert!(alone.px > 2000.0 && alone.deviation > 0.5, "{alone:?}");
        let usual = FocalEvidence {
            px: 720.0,
            deviation: 0.5,
        };
        let both = evidence(&costs, Some(usual));
        assert!((1000.0..1500.0).contains(&both.px), "{both:?}");
    }

    #[test]
    fn lenses_of_which_nothing_is_known_are_usual() {
        let camera = Pinhole {
            fx: 1000.0,
            fy: 1000.0,
            cx: 320.0,
            cy: 240.0,
        };
        assert!((FocalEvidence::usual(&camera).px - 768.0).abs() < 1e-9);
    }
}
