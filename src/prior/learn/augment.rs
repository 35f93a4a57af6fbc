//! More shapes out of few: mixtures of corresponded shapes, stretched and bent, each put back into the canonical frame.

use crate::cad::body_box;
use nalgebra::Vector3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

type V3 = Vector3<f64>;

/// An axis is stretched by up to so much, either way.
const STRETCH: f64 = 0.06;
/// Waves that bend a shape, their height in diagonals and how many go on a diagonal.
const WAVES: usize = 6;
const WAVE_HEIGHT: f64 = 0.006;
const WAVE_NUMBER: f64 = 2.0;
/// Width of the seam, in diagonals, where one shape's front or top gives way to another's.
const SEAM: f64 = 0.08;

/// `count` shapes like `shapes`, which are corresponded (mirrored pairs, xyz after xyz), of the same layout. Everything done
/// to them is symmetric in x = 0, so that pairs stay pairs. None of no shapes.
pub fn augmented(shapes: &[Vec<f64>], count: usize, seed: u64) -> Vec<Vec<f64>> {
    if shapes.is_empty() {
        return Vec::new();
    }
    (0..count)
        .into_par_iter()
        .map(|k| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(k as u64);
            one(shapes, &mut random)
        })
        .collect()
}

fn one(shapes: &[Vec<f64>], random: &mut ChaCha8Rng) -> Vec<f64> {
    let pick = |random: &mut ChaCha8Rng| &shapes[random.random_range(0..shapes.len())];
    let (first, second) = (pick(random), pick(random));
    let share_of_second = Share::new(random);
    let stretch = V3::from_fn(|_, _| 1.0 + random.random_range(-STRETCH..STRETCH));
    let waves: Vec<Wave> = (0..WAVES).map(|_| Wave::new(random)).collect();
    let points: Vec<V3> = first
        .chunks_exact(3)
        .zip(second.chunks_exact(3))
        .map(|(a, b)| {
            let (a, b) = (V3::from_column_slice(a), V3::from_column_slice(b));
            let mixed = a.lerp(&b, share_of_second.at(&((a + b) / 2.0)));
            let bend: V3 = waves.iter().map(|wave| wave.at(&mixed)).sum();
            (mixed + bend).component_mul(&stretch)
        })
        .collect();
    let (low, high) = body_box(&points).unwrap_or((V3::zeros(), V3::repeat(1.0)));
    let mut centre = (low + high) / 2.0;
    centre.x = 0.0;
    let diagonal = (high - low).norm();
    points
        .iter()
        .flat_map(|point| <[f64; 3]>::from((point - centre) / diagonal))
        .collect()
}

/// How much of the second shape is where: the same everywhere, or all on one side of a plane that x lies in.
enum Share {
    Everywhere(f64),
    Beyond { normal: V3, offset: f64 },
}

impl Share {
    fn new(random: &mut impl Rng) -> Self {
        if random.random() {
            return Self::Everywhere(random.random());
        }
        let angle = random.random_range(0.0..TAU);
        Self::Beyond {
            normal: V3::new(0.0, angle.sin(), angle.cos()),
            offset: random.random_range(-0.2..0.2),
        }
    }

    fn at(&self, point: &V3) -> f64 {
        match self {
            Self::Everywhere(share) => *share,
            Self::Beyond { normal, offset } => {
                let beyond = ((normal.dot(point) - offset) / SEAM).clamp(-1.0, 1.0);
                // Smooth from 0 at −1 to 1 at 1.
                0.5 + beyond * (3.0 - beyond * beyond) / 4.0
            }
        }
    }
}

/// A displacement that varies slowly, mirrored in x = 0.
struct Wave {
    direction: V3,
    by_x: f64,
    in_yz: V3,
    phase: f64,
}

impl Wave {
    fn new(random: &mut impl Rng) -> Self {
        let mut number = || TAU * WAVE_NUMBER * random.random_range(-1.0..1.0);
        let (by_x, in_yz) = (number(), V3::new(0.0, number(), number()));
        Self {
            direction: V3::from_fn(|_, _| WAVE_HEIGHT * random.random_range(-1.0..1.0)),
            by_x,
            in_yz,
            phase: random.random_range(0.0..TAU),
        }
    }

    fn at(&self, point: &V3) -> V3 {
        let along = (self.in_yz.dot(point) + self.phase).cos();
        let (odd, even) = (self.by_x * point.x).sin_cos();
        V3::new(
            self.direction.x * odd,
            self.direction.y * even,
            self.direction.z * even,
        ) * along
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::sample_outside;
    use crate::cad::synthetic::toy_car;
    use crate::geometry::mirror;

    fn toys() -> Vec<Vec<f64>> {
        [0.1, 0.2]
            .map(|height| {
                let half = sample_outside(&toy_car(height, 0.0, 0.4), 3000, 1).half();
                let pairs = half.points.iter().take(500).flat_map(|p| [*p, mirror(p)]);
                pairs.flat_map(<[f64; 3]>::from).collect()
            })
            .into()
    }

    #[test]
    fn what_is_made_is_mirrored_and_in_the_canonical_frame() {
        for shape in augmented(&toys(), 20, 7) {
            let points: Vec<V3> = shape.chunks_exact(3).map(V3::from_column_slice).collect();
            for pair in points.chunks_exact(2) {
                assert!((mirror(&pair[0]) - pair[1]).norm() < 1e-12);
            }
            let (low, high) = body_box(&points).unwrap();
            assert!(((high - low).norm() - 1.0).abs() < 1e-9);
            assert!((high + low).norm() < 1e-9);
        }
    }

    #[test]
    fn a_seed_gives_the_same_shapes_however_many_are_made() {
        let few = augmented(&toys(), 3, 7);
        assert_eq!(augmented(&toys(), 5, 7)[..3], few);
        assert_ne!(augmented(&toys(), 3, 8), few);
        assert_ne!(few[0], few[1]);
        assert!(augmented(&[], 3, 7).is_empty());
    }

    #[test]
    fn a_share_goes_from_none_to_all_across_its_seam() {
        let share = Share::Beyond {
            normal: V3::z(),
            offset: 0.1,
        };
        let at = |z: f64| share.at(&V3::new(0.3, -0.2, z));
        assert_eq!((at(0.1 - SEAM), at(0.1), at(0.1 + SEAM)), (0.0, 0.5, 1.0));
        assert_eq!((at(-1.0), at(1.0)), (0.0, 1.0));
    }
}
