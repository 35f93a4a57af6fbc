//! Eq. 11: the scale α of the off-the-shelf reconstruction from inverse depth.

use crate::image::{DepthMap, Mask};
use crate::visibility::Visibility;

/// α = ⟨d', d⟩ / ⟨d, d⟩, the minimiser of ‖d' − α d‖², over the pixels of the mask that see a point of X
/// (d = 1 / z_cam, object units) and whose off-the-shelf depth z' is known (d' = 1 / z').
///
/// `None` where there is no such pixel.
pub fn scale_from_inverse_depth(visibility: &Visibility, mask: &Mask, depth: &DepthMap) -> Option<f64> {
    let (mut cross, mut square) = (0.0, 0.0);
    for point in &visibility.points {
        let (column, row) = (point.pixel.0 as usize, point.pixel.1 as usize);
        let known = mask.get(column, row).copied().unwrap_or(false);
        let z = depth.get(column, row).copied().unwrap_or(0.0);
        if known && z > 0.0 {
            cross += point.inverse_depth / f64::from(z);
            square += point.inverse_depth * point.inverse_depth;
        }
    }
    (square > 0.0 && cross.is_finite()).then_some(cross / square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::VisiblePoint;

    fn seen(column: u32, inverse_depth: f64) -> VisiblePoint {
        VisiblePoint {
            pixel: (column, 0),
            point: column,
            inverse_depth,
        }
    }

    /// x_cam = α x'_cam: where the object is 3 away and the input says 2, α is 1.5, not 1 / 1.5.
    #[test]
    fn alpha_turns_input_units_into_object_units() {
        let visibility = Visibility {
            points: vec![seen(0, 1.0 / 3.0), seen(1, 1.0 / 4.5)],
            ..Visibility::default()
        };
        let depth = DepthMap::from_vec(2, 1, vec![2.0, 3.0]).unwrap();
        let alpha = scale_from_inverse_depth(&visibility, &Mask::filled(2, 1, true), &depth).unwrap();
        assert!((alpha - 1.5).abs() < 1e-12);
    }

    #[test]
    fn it_is_the_least_squares_solution() {
        let visibility = Visibility {
            points: vec![seen(0, 1.0), seen(1, 0.5)],
            ..Visibility::default()
        };
        let depth = DepthMap::from_vec(2, 1, vec![0.5, 1.0]).unwrap();
        // d' = (2, 1), d = (1, 0.5): consistent; then d' = (2, 2): (2 + 1) / 1.25.
        let alpha =
            |depth: &DepthMap| scale_from_inverse_depth(&visibility, &Mask::filled(2, 1, true), depth);
        assert_eq!(alpha(&depth), Some(2.0));
        assert_eq!(alpha(&DepthMap::filled(2, 1, 0.5)), Some(2.4));
    }

    #[test]
    fn unknown_depth_and_background_do_not_count() {
        let visibility = Visibility {
            points: vec![seen(0, 0.5), seen(1, 0.5), seen(2, 0.5)],
            ..Visibility::default()
        };
        let mask = Mask::from_vec(3, 1, vec![true, false, true]).unwrap();
        let depth = DepthMap::from_vec(3, 1, vec![1.0, 7.0, 0.0]).unwrap();
        assert_eq!(scale_from_inverse_depth(&visibility, &mask, &depth), Some(2.0));
        assert_eq!(
            scale_from_inverse_depth(&visibility, &mask, &DepthMap::filled(3, 1, 0.0)),
            None
        );
    }
}
