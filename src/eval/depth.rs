//! Depth against true depth: the mean error at a given scale (Sec. 3.2), and the scale that would suit the depth best.

use crate::image::DepthMap;

/// Pixels whose depth an estimate and the truth both know: (z, z_true). Those of several frames can be pooled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthPairs(Vec<(f32, f32)>);

impl DepthPairs {
    /// The pixels that both maps know; maps of different sizes share none.
    pub fn between(depth: &DepthMap, truth: &DepthMap) -> Self {
        if depth.size() != truth.size() {
            return Self::default();
        }
        let pairs = depth.data().iter().copied().zip(truth.data().iter().copied());
        Self(pairs.filter(|&(z, true_z)| z > 0.0 && true_z > 0.0).collect())
    }

    /// Pools another frame's pixels with these.
    pub fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// Mean |`scale` · z − z_true|; `None` without a pixel.
    pub fn error(&self, scale: f64) -> Option<f64> {
        let sum: f64 = self.wide().map(|(z, true_z)| (scale * z - true_z).abs()).sum();
        (!self.0.is_empty()).then(|| sum / self.0.len() as f64)
    }

    /// The one scale for all pixels at which [`DepthPairs::error`] is least; `None` without a pixel.
    ///
    /// |s z − z_true| = z |s − z_true / z|, so that s is the median of z_true / z with weights z: wrong depths, as long as
    /// they hold less than half of the weight, cannot drag it beyond the right ones. Of several such scales it is the
    /// smallest.
    pub fn best_scale(&self) -> Option<f64> {
        let mut ratios: Vec<(f64, f64)> = self.wide().map(|(z, true_z)| (true_z / z, z)).collect();
        ratios.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let half = 0.5 * ratios.iter().map(|(_, weight)| weight).sum::<f64>();
        let mut below = 0.0;
        let median = ratios.iter().find(|(_, weight)| {
            below += weight;
            below >= half
        });
        median.map(|&(ratio, _)| ratio)
    }

    fn wide(&self) -> impl Iterator<Item = (f64, f64)> {
        self.0
            .iter()
            .map(|&(z, true_z)| (f64::from(z), f64::from(true_z)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use proptest::prelude::*;

    fn row<const N: usize>(values: [f32; N]) -> DepthMap {
        Grid::from_vec(N, 1, values.to_vec()).unwrap()
    }

    #[test]
    fn pixels_known_in_both_count() {
        let mut pairs = DepthPairs::between(&row([1.0, 0.0, 3.0, 2.0]), &row([1.0, 2.0, 0.0, 0.5]));
        assert_eq!(pairs.0, [(1.0, 1.0), (2.0, 0.5)]);
        assert_eq!(pairs.error(0.5), Some(0.5));
        pairs.extend(pairs.clone());
        assert_eq!(pairs.error(0.5), Some(0.5));
        let other_size = DepthPairs::between(&row([1.0]), &row([1.0, 2.0]));
        assert_eq!((other_size.error(1.0), other_size.best_scale()), (None, None));
    }

    #[test]
    fn depth_scaled_by_a_constant_has_no_error_at_the_best_scale() {
        let truth = [1.0, 1.25, 1.5, 2.0, 1.125];
        let pairs = DepthPairs::between(&row(truth.map(|z| 4.0 * z)), &row(truth));
        assert!(pairs.error(1.0).unwrap() > 4.0);
        assert_eq!(pairs.best_scale(), Some(0.25));
        assert_eq!(pairs.error(0.25), Some(0.0));
    }

    #[test]
    fn a_few_wrong_depths_do_not_move_the_best_scale() {
        let pairs = DepthPairs::between(
            &row([2.0, 2.5, 3.0, 3.5, 4.0, 0.125, 9.0]),
            &row([1.0, 1.25, 1.5, 1.75, 2.0, 1.5, 1.5]),
        );
        assert_eq!(pairs.best_scale(), Some(0.5));
    }

    proptest! {
        #[test]
        fn no_scale_is_better_than_the_best(pairs in proptest::collection::vec((0.1..4f32, 0.1..4f32), 1..40),
                                            other in 0.01..50f64) {
            let pairs = DepthPairs(pairs);
            let least = pairs.error(pairs.best_scale().unwrap()).unwrap();
            prop_assert!(least <= pairs.error(other).unwrap() + 1e-12);
        }
    }
}
