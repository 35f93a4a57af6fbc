//! The optimal assignment of one point set to another of the same size (Jonker and Volgenant's shortest
//! augmenting paths on dense costs).

use nalgebra::Vector3;

/// For every row the column it is assigned to, so that the sum of `cost[row * n + column]` is least.
/// Costs must be finite.
pub fn assign(cost: &[f32], n: usize) -> Vec<usize> {
    const FREE: usize = usize::MAX;
    // Start: every column priced at its least cost, and given to that row if the row is still free.
    let mut price = vec![0.0_f64; n];
    let (mut column_of, mut row_of) = (vec![FREE; n], vec![FREE; n]);
    for column in 0..n {
        let mut least = (f32::INFINITY, 0);
        for row in 0..n {
            let c = cost[row * n + column];
            if c < least.0 {
                least = (c, row);
            }
        }
        price[column] = f64::from(least.0);
        if column_of[least.1] == FREE {
            column_of[least.1] = column;
            row_of[column] = least.1;
        }
    }
    let (mut distance, mut from) = (vec![0.0_f64; n], vec![0_usize; n]);
    for start in 0..n {
        if column_of[start] != FREE {
            continue;
        }
        // Dijkstra from `start` over reduced costs to the nearest free column. Columns in `order[..done]` are
        // settled; the rest are open.
        let mut order: Vec<usize> = (0..n).collect();
        for column in 0..n {
            distance[column] = f64::from(cost[start * n + column]) - price[column];
            from[column] = start;
        }
        let mut done = 0;
        let (end, shortest) = loop {
            let mut nearest = done;
            for k in done..n {
                if distance[order[k]] < distance[order[nearest]] {
                    nearest = k;
                }
            }
            order.swap(done, nearest);
            let column = order[done];
            let reached = distance[column];
            if row_of[column] == FREE {
                break (column, reached);
            }
            done += 1;
            let row = row_of[column];
            let offset = f64::from(cost[row * n + column]) - price[column] - reached;
            for &open in &order[done..] {
                let through = f64::from(cost[row * n + open]) - price[open] - offset;
                if through < distance[open] {
                    distance[open] = through;
                    from[open] = row;
                }
            }
        };
        for &column in &order[..done] {
            price[column] += distance[column] - shortest;
        }
        let mut column = end;
        loop {
            let row = from[column];
            row_of[column] = row;
            std::mem::swap(&mut column_of[row], &mut column);
            if row == start {
                break;
            }
        }
    }
    column_of
}

/// For every point of `from` the index of its partner in `to` (as many points), squared distances summed least.
pub fn assign_points(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<usize> {
    let cost: Vec<f32> = from
        .iter()
        .flat_map(|a| to.iter().map(move |b| (a - b).norm_squared() as f32))
        .collect();
    assign(&cost, from.len().min(to.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn least_by_trying_all(cost: &[f32], n: usize, row: usize, used: usize) -> f32 {
        (0..n)
            .filter(|c| used & (1 << c) == 0)
            .map(|c| cost[row * n + c] + least_by_trying_all(cost, n, row + 1, used | (1 << c)))
            .reduce(f32::min)
            .unwrap_or(0.0)
    }

    proptest! {
        #[test]
        fn is_optimal(n in 1..7usize, seed in proptest::collection::vec(0.0..10.0f32, 49)) {
            let cost = &seed[..n * n];
            let columns = assign(cost, n);
            let mut sorted = columns.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, (0..n).collect::<Vec<_>>());
            let total: f32 = columns.iter().enumerate().map(|(r, c)| cost[r * n + c]).sum();
            prop_assert!((total - least_by_trying_all(cost, n, 0, 0)).abs() < 1e-4);
        }
    }

    #[test]
    fn finds_a_permutation_back() {
        let points: Vec<_> = (0..300_u32)
            .map(|i| {
                Vector3::new(
                    f64::from(i * 7919 % 1009),
                    f64::from(i * 104_729 % 997),
                    f64::from(i),
                ) / 1000.0
            })
            .collect();
        let shuffled: Vec<_> = (0..300).map(|i| points[i * 7 % 300]).collect();
        let found = assign_points(&shuffled, &points);
        assert!((0..300).all(|i| found[i] == i * 7 % 300));
    }
}
