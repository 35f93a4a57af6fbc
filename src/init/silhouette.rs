//! Coarse binary silhouettes, 128 × 128 cells around a mask: quick enough to score thousands of templates.
//!
//! One row is one machine word, so that dilation, erosion and IoU are a few shifts and bit counts.

use super::cloud::Cloud;
use crate::geometry::{Matrix3, Pinhole, Pose, Vector2};
use crate::image::Mask;

const SIDE: usize = 128;
/// Cells that the longer side of the mask's bounding box spans; the rest is margin.
const MASK_CELLS: f64 = 84.0;
/// Half-width of the closing that joins the splats, in sample spacings: gaps up to twice that wide are filled.
const CLOSING_SPACINGS: f64 = 0.8;

/// A part of the image in cells; bit i of row j is cell (i, j).
#[derive(Clone, Debug)]
pub(super) struct Silhouette([u128; SIDE]);

/// One frame's mask as templates are compared with it.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    pub camera: Pinhole,
    /// Image point of the window's top-left corner.
    corner: Vector2<f64>,
    /// Pixels per cell.
    cell_px: f64,
    /// The cells within the image: what lies beyond cannot be seen, so it does not count.
    in_image: Silhouette,
    pub mask: Silhouette,
    /// Lowest and highest corner of the mask's bounding box, pixels.
    pub bounds_px: (Vector2<f64>, Vector2<f64>),
}

impl Observation {
    /// `None` where the mask is empty.
    pub fn new(mask: &Mask, camera: Pinhole) -> Option<Self> {
        let (low, high) = bounds(mask)?;
        let cell_px = (high - low).max() / MASK_CELLS;
        let corner = (low + high) / 2.0 - Vector2::repeat(cell_px * SIDE as f64 / 2.0);
        let inside = |u: f64, v: f64| mask.pixel_at(u, v).map(|pixel| mask[pixel]);
        let cells = |on: &dyn Fn(f64, f64) -> bool| {
            Silhouette::from_fn(|column, row| {
                // Majority of 3 × 3 samples of the cell.
                let samples = (0..9).filter(|k| {
                    let (dx, dy) = ((k % 3) as f64 / 3.0 + 1.0 / 6.0, (k / 3) as f64 / 3.0 + 1.0 / 6.0);
                    on(
                        corner.x + (column as f64 + dx) * cell_px,
                        corner.y + (row as f64 + dy) * cell_px,
                    )
                });
                samples.count() >= 5
            })
        };
        Some(Self {
            camera,
            corner,
            cell_px,
            in_image: cells(&|u, v| inside(u, v).is_some()),
            mask: cells(&|u, v| inside(u, v) == Some(true)),
            bounds_px: (low, high),
        })
    }

    /// The silhouette of a surface sampled at `points` (object frame) every `spacing`: splats, then a closing as
    /// wide as the sampling needs, which fills the gaps without moving the outline.
    pub fn render(&self, points: &Cloud, spacing: f64, camera_from_object: &Pose) -> Silhouette {
        // One word more than the window has takes what lies outside.
        let mut words = [0u64; 2 * SIDE + 1];
        points.project(&self.cells_from_camera(), camera_from_object, |columns, rows| {
            for (&column, &row) in columns.iter().zip(rows) {
                let place = place(column, row);
                words[place / 64] |= 1 << (place % 64);
            }
        });
        let rows =
            std::array::from_fn(|row| u128::from(words[2 * row]) | u128::from(words[2 * row + 1]) << 64);
        let depth = camera_from_object.translation.z.max(f64::MIN_POSITIVE);
        let cells = CLOSING_SPACINGS * spacing * self.camera.fx / depth / self.cell_px;
        let closed = Silhouette(rows).closed((cells.ceil() as u32).clamp(1, SIDE as u32 / 8));
        closed.and(&self.in_image)
    }

    /// The camera matrix whose image points are counted in cells from the window's top-left corner.
    fn cells_from_camera(&self) -> Matrix3<f64> {
        let Pinhole { fx, fy, cx, cy } = self.camera;
        let (cx, cy) = (cx - self.corner.x, cy - self.corner.y);
        Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, self.cell_px) / self.cell_px
    }

    /// Where the silhouette's centroid lies in the image.
    pub fn centroid_px(&self, silhouette: &Silhouette) -> Option<Vector2<f64>> {
        Some(self.corner + silhouette.centroid()? * self.cell_px)
    }
}

impl Silhouette {
    fn from_fn(on: impl Fn(usize, usize) -> bool) -> Self {
        Self(std::array::from_fn(|row| {
            (0..SIDE)
                .filter(|&column| on(column, row))
                .fold(0, |bits, column| bits | 1 << column)
        }))
    }

    /// The number of cells in the silhouette.
    pub fn area(&self) -> u32 {
        self.0.iter().map(|row| row.count_ones()).sum()
    }

    /// Intersection over union; 0 where both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let (mut intersection, mut union) = (0, 0);
        for (a, b) in self.0.iter().zip(&other.0) {
            intersection += (a & b).count_ones();
            union += (a | b).count_ones();
        }
        f64::from(intersection) / f64::from(union.max(1))
    }

    /// In cells from the top-left corner; `None` where it is empty.
    fn centroid(&self) -> Option<Vector2<f64>> {
        let sum_y: u64 = (0u64..)
            .zip(&self.0)
            .map(|(row, bits)| row * u64::from(bits.count_ones()))
            .sum();
        // Bit j of `counts[k]` is bit k of how many cells column j has.
        let mut counts = [0u128; 8];
        for &bits in &self.0 {
            let mut carry = bits;
            for count in &mut counts {
                (*count, carry) = (*count ^ carry, *count & carry);
            }
        }
        let weighted = |bits: u128| {
            let planes = COLUMN_BITS.iter().enumerate();
            planes
                .map(|(bit, plane)| u64::from((bits & plane).count_ones()) << bit)
                .sum::<u64>()
        };
        let sum_x: u64 = counts
            .iter()
            .enumerate()
            .map(|(k, &bits)| weighted(bits) << k)
            .sum();
        let area = f64::from(self.area());
        (area > 0.0).then(|| Vector2::new(sum_x as f64, sum_y as f64) / area + Vector2::repeat(0.5))
    }

    /// Dilation then erosion by a square of half-width `cells`.
    fn closed(&self, cells: u32) -> Self {
        // Erosion is the dilation of the complement, which takes what lies beyond the window for inside.
        self.dilated(cells).complement().dilated(cells).complement()
    }

    /// Each step about doubles what the steps before it reached. It is short enough for every cell to be reached on a way
    /// that does not turn back, so that none leaves the window.
    fn dilated(&self, cells: u32) -> Self {
        let mut rows = self.0;
        let mut reached = 0;
        while reached < cells {
            let step = (cells - reached).min(reached + 1);
            for row in &mut rows {
                *row |= *row << step | *row >> step;
            }
            let narrow = rows;
            let step_rows = step as usize;
            for (row, above) in rows[step_rows..].iter_mut().zip(&narrow) {
                *row |= above;
            }
            for (row, below) in rows.iter_mut().zip(&narrow[step_rows..]) {
                *row |= below;
            }
            reached += step;
        }
        Self(rows)
    }

    fn complement(&self) -> Self {
        Self(self.0.map(|row| !row))
    }

    fn and(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|row| self.0[row] & other.0[row]))
    }
}

/// The number of the cell that holds the point, row by row; SIDE² outside the window and of what is not a number.
fn place(column: f32, row: f32) -> usize {
    // Casts truncate: one is added so that what is just below 0 is not taken for 0.
    let cell = |coordinate: f32| ((coordinate + 1.0) as i32).wrapping_sub(1) as u32;
    let (column, row) = (cell(column), cell(row));
    let inside = (column | row) < SIDE as u32;
    (if inside {
        row * SIDE as u32 + column
    } else {
        (SIDE * SIDE) as u32
    }) as usize
}

/// Entry k has the bits whose column number has bit k.
const COLUMN_BITS: [u128; 7] = {
    let mut planes = [0; 7];
    let mut column = 0;
    while column < SIDE {
        let mut bit = 0;
        while bit < 7 {
            if column >> bit & 1 == 1 {
                planes[bit] |= 1 << column;
            }
            bit += 1;
        }
        column += 1;
    }
    planes
};

/// Lowest and highest corner of the mask's bounding box in pixels; `None` where the mask is empty.
fn bounds(mask: &Mask) -> Option<(Vector2<f64>, Vector2<f64>)> {
    let width = mask.width();
    let pixels = mask.data().iter().enumerate().filter(|(_, inside)| **inside);
    pixels.fold(None, |bounds, (i, _)| {
        let low = Vector2::new((i % width) as f64, (i / width) as f64);
        let high = low + Vector2::repeat(1.0);
        Some(
            bounds.map_or((low, high), |(a, b): (Vector2<f64>, Vector2<f64>)| {
                (a.inf(&low), b.sup(&high))
            }),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector3;
    use proptest::prelude::*;

    const CAMERA: Pinhole = Pinhole {
        fx: 200.0,
        fy: 200.0,
        cx: 100.0,
        cy: 75.0,
    };

    fn disc(centre: (f64, f64), radius: f64) -> Mask {
        Mask::from_fn(200, 150, |c, r| {
            (c as f64 + 0.5 - centre.0).hypot(r as f64 + 0.5 - centre.1) < radius
        })
    }

    #[test]
    fn a_masks_cells_keep_its_place_and_area() {
        let observation = Observation::new(&disc((120.0, 60.0), 30.0), CAMERA).unwrap();
        let centroid = observation.centroid_px(&observation.mask).unwrap();
        assert!((centroid - Vector2::new(120.0, 60.0)).norm() < 0.1, "{centroid}");
        let area_px = f64::from(observation.mask.area()) * observation.cell_px.powi(2);
        assert!((area_px / (std::f64::consts::PI * 900.0) - 1.0).abs() < 0.01);
    }

    /// A sphere of radius 0.3 at distance 2 projects to a disc of 200 · 0.3 / √(4 − 0.09) px; the rendering
    /// from sparse points neither shrinks it, grows it nor leaves holes.
    #[test]
    fn a_sparse_sphere_renders_as_a_full_disc() {
        let count = 2000;
        let points: Cloud = (0..count)
            .map(|i| {
                let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
                let (angle, r) = (i as f64 * 2.399963229728653, (1.0 - y * y).sqrt());
                Vector3::new(r * angle.cos(), y, r * angle.sin()) * 0.3
            })
            .collect();
        let pose = Pose {
            translation: Vector3::new(0.0, 0.0, 2.0),
            ..Pose::identity()
        };
        let radius = 200.0 * 0.3 / (4.0f64 - 0.09).sqrt();
        let observation = Observation::new(&disc((100.0, 75.0), radius), CAMERA).unwrap();
        let rendered = observation.render(&points, 0.3 * 0.079, &pose);
        let iou = rendered.iou(&observation.mask);
        let ratio = f64::from(rendered.area()) / f64::from(observation.mask.area());
        assert!(
            iou > 0.96 && (ratio - 1.0).abs() < 0.03,
            "IoU {iou}, area ratio {ratio}"
        );
    }

    #[test]
    fn what_lies_beyond_the_image_does_not_count() {
        let observation = Observation::new(&disc((0.0, 75.0), 30.0), CAMERA).unwrap();
        let points: Cloud = (0..2500)
            .map(|i| {
                Vector3::new(
                    f64::from(i % 50) / 50.0 - 1.0,
                    f64::from(i / 50) / 50.0 - 0.5,
                    0.0,
                )
            })
            .collect();
        let pose = Pose {
            translation: Vector3::new(0.0, 0.0, 2.0),
            ..Pose::identity()
        };
        // x < −1 would be left of the image; everything rendered is inside.
        let rendered = observation.render(&points, 0.02, &pose);
        assert_eq!(rendered.and(&observation.in_image).area(), rendered.area());
        assert!(observation.in_image.area() < (SIDE * SIDE) as u32 * 3 / 4);
    }

    #[test]
    fn cells_end_at_the_window() {
        assert_eq!(place(0.0, 0.999), 0);
        assert_eq!(place(127.99, 2.5), 2 * SIDE + 127);
        for beyond in [-0.001, 128.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e30] {
            assert_eq!(place(beyond, 3.0), SIDE * SIDE);
            assert_eq!(place(3.0, beyond), SIDE * SIDE);
        }
    }

    proptest! {
        #[test]
        fn dilation_reaches_the_square_around_each_cell(
            on in proptest::collection::vec((0..SIDE, 0..SIDE), 1..6),
            cells in 1..17u32,
        ) {
            let dots = Silhouette::from_fn(|column, row| on.contains(&(column, row)));
            let expected = Silhouette::from_fn(|column, row| {
                on.iter().any(|dot| dot.0.abs_diff(column).max(dot.1.abs_diff(row)) <= cells as usize)
            });
            prop_assert_eq!(dots.dilated(cells).0, expected.0);
        }
    }

    #[test]
    fn an_empty_mask_is_no_observation() {
        assert!(Observation::new(&Mask::filled(5, 5, false), CAMERA).is_none());
    }
}
