//! How well the projected shape covers the given silhouette: IoU and density.

use crate::image::Mask;

/// |a ∩ b| / |a ∪ b|; 0 where both are empty. The rasters share their top-left pixel; where one is smaller, its
/// missing pixels are background.
pub fn silhouette_iou(a: &Mask, b: &Mask) -> f64 {
    let both = intersection(a, b);
    ratio(both, area(a) + area(b) - both)
}

/// The share of the mask's pixels that visible projected points cover, each with its footprint (see
/// [`Surface`](super::Surface)): |mask ∩ covered| / |mask|; 0 for an empty mask.
pub fn density(mask: &Mask, covered: &Mask) -> f64 {
    ratio(intersection(mask, covered), area(mask))
}

fn area(mask: &Mask) -> usize {
    mask.data().iter().filter(|&&on| on).count()
}

fn intersection(a: &Mask, b: &Mask) -> usize {
    let (width, height) = (a.width().min(b.width()), a.height().min(b.height()));
    (0..height)
        .flat_map(|row| (0..width).map(move |column| (column, row)))
        .filter(|&pixel| a[pixel] && b[pixel])
        .count()
}

fn ratio(part: usize, whole: usize) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn columns(range: std::ops::Range<usize>) -> Mask {
        Grid::from_fn(10, 4, |column, _| range.contains(&column))
    }

    #[test]
    fn known_overlaps() {
        let (given, covered) = (columns(0..4), columns(1..6));
        assert_eq!(silhouette_iou(&given, &covered), 0.5);
        assert_eq!(density(&given, &covered), 0.75);
        assert_eq!(density(&covered, &given), 0.6);
        assert_eq!(silhouette_iou(&columns(0..0), &columns(0..0)), 0.0);
        assert_eq!(density(&columns(0..0), &covered), 0.0);
    }

    #[test]
    fn a_smaller_raster_is_background_beyond_its_edge() {
        let wide = columns(0..10);
        let narrow: Mask = Grid::filled(5, 4, true);
        assert_eq!(silhouette_iou(&wide, &narrow), 0.5);
        assert_eq!(silhouette_iou(&narrow, &wide), 0.5);
    }
}
