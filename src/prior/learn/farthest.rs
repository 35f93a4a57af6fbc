//! Farthest-point order: an order in which every prefix is an even sample of the whole.

use crate::geometry::mirror;
use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// Indices of `count` points (or of all, if fewer), each the farthest from those before it; the first is the
/// farthest from the origin. Ties go to the lower index.
pub fn farthest_order(points: &[V3], count: usize) -> Vec<usize> {
    order(points, count, |_| f64::INFINITY, V3::metric_distance)
}

/// The same for one half of a mirrored shape: a point brings its mirror image in x = 0 along, so it keeps
/// clear of the images of those before it and of its own.
pub fn farthest_order_mirrored(points: &[V3], count: usize) -> Vec<usize> {
    order(
        points,
        count,
        |p| 2.0 * p.x.abs(),
        |a, b| a.metric_distance(b).min(a.metric_distance(&mirror(b))),
    )
}

fn order(
    points: &[V3],
    count: usize,
    own: impl Fn(&V3) -> f64,
    distance: impl Fn(&V3, &V3) -> f64,
) -> Vec<usize> {
    let mut clearance: Vec<f64> = points.iter().map(own).collect();
    let mut chosen = Vec::with_capacity(count.min(points.len()));
    let mut next = arg_max(points.iter().zip(&clearance).map(|(p, &c)| p.norm().min(c)));
    while let Some(index) = next
        && chosen.len() < count.min(points.len())
    {
        chosen.push(index);
        clearance[index] = f64::NEG_INFINITY;
        let latest = points[index];
        for (point, clearance) in points.iter().zip(&mut clearance) {
            *clearance = clearance.min(distance(point, &latest));
        }
        next = arg_max(clearance.iter().copied());
    }
    chosen
}

fn arg_max(values: impl Iterator<Item = f64>) -> Option<usize> {
    let mut best = None;
    for (index, value) in values.enumerate() {
        if best.is_none_or(|(_, highest)| value > highest) {
            best = Some((index, value));
        }
    }
    best.map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_taken_from_its_ends_inwards() {
        let line: Vec<V3> = (0..=8).map(|i| V3::new(f64::from(i), 0.0, 0.0)).collect();
        assert_eq!(farthest_order(&line, 5), [8, 0, 4, 2, 6]);
        let mut all = farthest_order(&line, 100);
        all.sort_unstable();
        assert_eq!(all, (0..9).collect::<Vec<_>>());
    }

    #[test]
    fn mirrored_points_keep_off_the_plane() {
        let grid: Vec<V3> = (0..400)
            .map(|i| V3::new(f64::from(i % 20) / 20.0, f64::from(i / 20) / 10.0, 0.0))
            .collect();
        let chosen: Vec<V3> = farthest_order_mirrored(&grid, 30)
            .iter()
            .map(|&i| grid[i])
            .collect();
        let both: Vec<V3> = chosen.iter().copied().chain(chosen.iter().map(mirror)).collect();
        let closest = |p: &V3| {
            both.iter()
                .map(|q| p.metric_distance(q))
                .filter(|&d| d > 0.0)
                .fold(9.0, f64::min)
        };
        let (low, high) = chosen
            .iter()
            .map(closest)
            .fold((9.0_f64, 0.0_f64), |(l, h), d| (l.min(d), h.max(d)));
        assert!(
            chosen.iter().all(|p| p.x > 0.0) && high < 2.5 * low,
            "{low} {high}"
        );
    }
}
