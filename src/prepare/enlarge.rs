//! Depth found in halved pictures, for the pictures themselves.

use crate::image::{DepthMap, Grid};

/// Depths that differ by a larger share are not of one surface.
const SAME_SURFACE: f32 = 0.03;

/// A coarse depth map at the next finer level, of this size: between four coarse pixels of one surface its inverse is bilinear, elsewhere a pixel
/// has what the coarse one about it has.
fn doubled(coarse: &DepthMap, width: usize, height: usize) -> DepthMap {
    Grid::from_fn(width, height, |column, row| {
        let own = coarse.get(column / 2, row / 2).copied().unwrap_or(0.0);
        // The other coarse pixel beside a fine one, and its share: the centres are a quarter of a coarse pixel apart.
        let beside = |fine: usize| (fine / 2 + fine % 2).checked_sub(usize::from(fine.is_multiple_of(2)));
        let others = [
            (Some(column / 2), Some(row / 2), 9.0 / 16.0),
            (beside(column), Some(row / 2), 3.0 / 16.0),
            (Some(column / 2), beside(row), 3.0 / 16.0),
            (beside(column), beside(row), 1.0 / 16.0),
        ];
        let mut inverse = 0.0;
        for (column, row, share) in others {
            let z = column.zip(row).and_then(|(column, row)| coarse.get(column, row));
            match z {
                Some(&z) if z > 0.0 && (z - own).abs() < SAME_SURFACE * own => inverse += share / z,
                _ => return own,
            }
        }
        1.0 / inverse
    })
}

/// The depth of pictures of `size` from that of their halvings.
pub fn enlarged(depth: &DepthMap, (width, height): (usize, usize), halvings: u32) -> DepthMap {
    (0..halvings).rev().fold(depth.clone(), |coarse, level| {
        let at = |length: usize| length.div_ceil(1 << level);
        doubled(&coarse, at(width), at(height))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pinhole;

    #[test]
    fn a_plane_s_depth_is_doubled_exactly_and_edges_are_kept() {
        let camera = Pinhole {
            fx: 40.0,
            fy: 41.0,
            cx: 15.2,
            cy: 9.7,
        };
        // 1 / z of a plane is linear in the pixel.
        let plane = |camera: &Pinhole, c: usize, r: usize| {
            let (x, y) = (
                (c as f64 + 0.5 - camera.cx) / camera.fx,
                (r as f64 + 0.5 - camera.cy) / camera.fy,
            );
            (1.0 / (0.5 + 0.03 * x - 0.05 * y)) as f32
        };
        let half = camera.scaled(0.5, 0.5);
        let coarse = DepthMap::from_fn(16, 10, |c, r| match c {
            9 => 0.0,
            10.. => 9.0,
            _ => plane(&half, c, r),
        });
        let fine = doubled(&coarse, 31, 20);
        assert_eq!(fine.size(), (31, 20));
        for row in 1..19 {
            for column in 1..17 {
                let expected = plane(&camera, column, row);
                assert!((fine[(column, row)] - expected).abs() < 1e-5, "{column} {row}");
            }
            assert_eq!(fine[(17, row)], coarse[(8, row / 2)]);
            assert_eq!(fine[(18, row)], 0.0);
            assert_eq!(fine[(20, row)], 9.0);
        }
    }
}
