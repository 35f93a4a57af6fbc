//! How well the projected shape covers the given silhouette: IoU and density.

use crate::image::{Grid, Mask, NearestPixel};

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

/// The share of the shape's pixels that are more than `beyond_px` pixels away from the mask; 0 for an empty shape, 1 for an empty mask.
pub fn outside_share(shape: &Mask, mask: &Mask, beyond_px: u8) -> f64 {
    let Some(nearest) = NearestPixel::new(mask) else {
        return ratio(area(shape), area(shape));
    };
    let distances = nearest.distances();
    let beyond = Grid::from_fn(mask.width(), mask.height(), |column, row| {
        distances[(column, row)] > beyond_px
    });
    ratio(intersection(shape, &beyond), area(shape))
}

/// The share of the mask's pixels that lie in holes of the shape: not covered, and cut off by it from the image's border.
pub fn hole_share(mask: &Mask, shape: &Mask) -> f64 {
    let (width, height) = shape.size();
    let mut open: Vec<bool> = shape.data().iter().map(|on| !on).collect();
    let on_border = |i: usize| {
        let (column, row) = (i % width, i / width);
        column == 0 || column == width - 1 || row == 0 || row == height - 1
    };
    let mut stack: Vec<usize> = (0..open.len()).filter(|&i| open[i] && on_border(i)).collect();
    stack.iter().for_each(|&i| open[i] = false);
    while let Some(i) = stack.pop() {
        let (column, row) = (i % width, i / width);
        let neighbours = [
            (column > 0).then(|| i - 1),
            (column + 1 < width).then(|| i + 1),
            (row > 0).then(|| i - width),
            (row + 1 < height).then(|| i + width),
        ];
        for neighbour in neighbours.into_iter().flatten() {
            if open[neighbour] {
                open[neighbour] = false;
                stack.push(neighbour);
            }
        }
    }
    let holes = Grid::from_fn(width, height, |column, row| open[row * width + column]);
    ratio(intersection(mask, &holes), area(mask))
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
    fn outside_is_what_lies_beyond_the_margin() {
        let (mask, shape) = (columns(0..4), columns(2..9));
        // The last column inside is 3: columns 6, 7 and 8 are more than two pixels away.
        assert_eq!(outside_share(&shape, &mask, 2), 3.0 / 7.0);
        assert_eq!(outside_share(&shape, &shape, 0), 0.0);
        assert_eq!(outside_share(&shape, &columns(0..0), 2), 1.0);
        assert_eq!(outside_share(&columns(0..0), &mask, 2), 0.0);
    }

    #[test]
    fn holes_are_closed_by_the_shape() {
        let picture = ["#########.", "#..##.###.", "####...#..", "####.####."];
        let shape = Grid::from_fn(10, 4, |column, row| picture[row].as_bytes()[column] == b'#');
        // Two pixels of 40 are enclosed; the others reach the border below.
        assert_eq!(hole_share(&columns(0..10), &shape), 2.0 / 40.0);
        assert_eq!(hole_share(&columns(0..2), &shape), 1.0 / 8.0);
        assert_eq!(hole_share(&columns(0..0), &shape), 0.0);
    }

    #[test]
    fn a_smaller_raster_is_background_beyond_its_edge() {
        let wide = columns(0..10);
        let narrow: Mask = Grid::filled(5, 4, true);
        assert_eq!(silhouette_iou(&wide, &narrow), 0.5);
        assert_eq!(silhouette_iou(&narrow, &wide), 0.5);
    }
}
