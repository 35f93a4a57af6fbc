//! Repeatable chance (SplitMix64): the stream of numbers is part of what a scene file means, so it must not change
//! with the version of a library.

/// An independent generator for each (seed, stream, index).
pub(in crate::cad) struct Random {
    state: u64,
}

impl Random {
    pub(in crate::cad) fn new(seed: u64, stream: u64, index: u64) -> Self {
        Self {
            state: hash(hash(hash(seed) ^ stream) ^ index),
        }
    }

    /// A uniform number in \[0, 1).
    pub(in crate::cad) fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        unit(mix(self.state))
    }

    /// Standard normal (Box–Muller).
    pub(in crate::cad) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A smooth random field over the plane in \[0, 1\], with blotches of about one unit.
pub(in crate::cad) fn blotches(key: u64, x: f64, y: f64) -> f64 {
    let corner = |x: i64, y: i64| unit(hash(hash(key ^ hash(x as u64)) ^ y as u64));
    let (left, top) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (smooth(x - left), smooth(y - top));
    let (left, top) = (left as i64, top as i64);
    let row = |y: i64| corner(left, y) * (1.0 - fx) + corner(left + 1, y) * fx;
    row(top) * (1.0 - fy) + row(top + 1) * fy
}

/// Scatters a number over all 64 bits.
pub(in crate::cad) fn hash(value: u64) -> u64 {
    mix(value.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_split_mix_64() {
        // The published first output for seed 0.
        let mut state = Random { state: 0 };
        state.uniform();
        assert_eq!(mix(state.state), 0xe220_a839_7b1d_cdaf);
    }

    #[test]
    fn moments() {
        let mut random = Random::new(1, 2, 3);
        let draws: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let mean = draws.iter().sum::<f64>() / 2e4;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 2e4;
        assert!(
            mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05,
            "{mean} {variance}"
        );
    }
}
