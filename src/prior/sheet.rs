//! The contact sheet: the mean shape and each mode at ±2σ, drawn as shaded discs.

use super::surface_sheet::surface_sheet;
use super::{LearnedPrior, ShapePrior, glyphs};
use crate::image::RgbImage;
use nalgebra::{Matrix3, Vector3};

type V3 = Vector3<f64>;

/// The least (width, height) of a view, pixels; tall shapes get a higher one.
const MIN_CELL: (usize, usize) = (300, 190);
/// Pixels a diagonal.
const SCALE: f64 = 290.0;
const MARGIN: usize = 20;
/// Room for what ±2σ add to the mean's height, as a factor.
const ROOM: f64 = 1.25;
/// A disc's radius against the points' spacing: enough to close the surface.
const DISC: f64 = 1.3;
const BACKGROUND: [f32; 3] = [255.0; 3];
const INK: [f32; 3] = [40.0; 3];

/// Azimuth (0 = from the front, positive towards +x) and elevation of a view, degrees.
const THREE_QUARTER: (f64, f64) = (-40.0, 18.0);
const REAR_QUARTER: (f64, f64) = (-140.0, 18.0);
const SIDE: (f64, f64) = (-90.0, 0.0);
const FRONT: (f64, f64) = (0.0, 0.0);

/// A prior of surfaces as [`surface_sheet`] has it; of points, draws the first row: the mean from four sides; then a row a mode: −2σ from three quarters and the side, +2σ
/// likewise. At most `modes` modes.
pub fn contact_sheet(prior: &LearnedPrior, modes: usize) -> RgbImage {
    if let Some(surface) = prior.surface() {
        return surface_sheet(surface, modes);
    }
    let modes = modes.min(prior.style_len());
    let cell = cell(prior);
    let row_height = cell.1 + MARGIN;
    let mut sheet = RgbImage::filled(4 * cell.0, row_height * (modes + 1), BACKGROUND);
    let radius = DISC * prior.sample_spacing(prior.point_count());
    let mut style = vec![0.0; prior.style_len()];
    write(&mut sheet, 4, 4, "MEAN");
    for (column, view) in [THREE_QUARTER, REAR_QUARTER, SIDE, FRONT].into_iter().enumerate() {
        let corner = (column * cell.0, MARGIN);
        draw(&mut sheet, corner, cell, prior, &style, view, radius);
    }
    for mode in 0..modes {
        let top = (mode + 1) * row_height;
        for (half, deviation, sign) in [(0, -2.0, "-"), (1, 2.0, "+")] {
            let left = half * 2 * cell.0;
            write(
                &mut sheet,
                left + 4,
                top + 4,
                &format!("MODE {}  {sign}2 SIGMA", mode + 1),
            );
            style[mode] = deviation;
            for (corner, view) in [(left, THREE_QUARTER), (left + cell.0, SIDE)] {
                draw(
                    &mut sheet,
                    (corner, top + MARGIN),
                    cell,
                    prior,
                    &style,
                    view,
                    radius,
                );
            }
        }
        style[mode] = 0.0;
    }
    sheet
}

fn cell(prior: &LearnedPrior) -> (usize, usize) {
    let heights = prior
        .shape(&vec![0.0; prior.style_len()])
        .into_iter()
        .map(|point| point.y.abs());
    let height = 2.0 * ROOM * SCALE * heights.fold(0.0, f64::max);
    (MIN_CELL.0, MIN_CELL.1.max(height.ceil() as usize))
}

/// Rows: the viewer's right, up, and the direction towards the viewer.
fn viewer_from_object((azimuth, elevation): (f64, f64)) -> Matrix3<f64> {
    let (sin_azimuth, cos_azimuth) = azimuth.to_radians().sin_cos();
    let (sin_elevation, cos_elevation) = elevation.to_radians().sin_cos();
    let towards = V3::new(
        sin_azimuth * cos_elevation,
        sin_elevation,
        -cos_azimuth * cos_elevation,
    );
    let right = V3::y().cross(&towards).normalize();
    let up = towards.cross(&right);
    Matrix3::from_rows(&[right.transpose(), up.transpose(), towards.transpose()])
}

/// Draws X(s) into the `cell` at `corner`, orthographic, z-buffered, lit from the upper left.
fn draw(
    sheet: &mut RgbImage,
    corner: (usize, usize),
    cell: (usize, usize),
    prior: &LearnedPrior,
    style: &[f64],
    view: (f64, f64),
    radius: f64,
) {
    let viewer_from_object = viewer_from_object(view);
    let light = V3::new(-0.4, 0.7, 0.6).normalize();
    let mut nearest = vec![f64::NEG_INFINITY; cell.0 * cell.1];
    let reach = (radius * SCALE).ceil() as i64;
    for (point, normal) in prior.shape(style).iter().zip(prior.normals()) {
        let point = viewer_from_object * point;
        let normal = viewer_from_object * Vector3::from(*normal).cast::<f64>();
        // Discs seen edge-on stretch without end; their neighbours cover for them.
        if normal.z < 0.05 {
            continue;
        }
        let (u, v) = (
            cell.0 as f64 / 2.0 + point.x * SCALE,
            cell.1 as f64 / 2.0 - point.y * SCALE,
        );
        let shade = (70.0 + 170.0 * normal.dot(&light).max(0.0)) as f32;
        for row in v as i64 - reach..=v as i64 + reach {
            for column in u as i64 - reach..=u as i64 + reach {
                let (Ok(column), Ok(row)) = (usize::try_from(column), usize::try_from(row)) else {
                    continue;
                };
                if column >= cell.0 || row >= cell.1 {
                    continue;
                }
                let dx = (column as f64 + 0.5 - u) / SCALE;
                let dy = (v - row as f64 - 0.5) / SCALE;
                let dz = -(normal.x * dx + normal.y * dy) / normal.z;
                let z = point.z + dz;
                let buffer = &mut nearest[row * cell.0 + column];
                if dx * dx + dy * dy + dz * dz <= radius * radius && z > *buffer {
                    *buffer = z;
                    sheet[(corner.0 + column, corner.1 + row)] = [shade * 0.92, shade * 0.96, shade];
                }
            }
        }
    }
}

fn write(sheet: &mut RgbImage, left: usize, top: usize, text: &str) {
    for (column, row) in glyphs::dots(text) {
        sheet[(left + column, top + row)] = INK;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::LinearPrior;

    #[test]
    fn from_the_front_the_viewer_s_right_is_the_car_s_left() {
        let view = viewer_from_object(FRONT);
        assert!((view * V3::x() + V3::x()).norm() < 1e-12);
        assert!((view * -V3::z() - V3::z()).norm() < 1e-12);
        let side = viewer_from_object(SIDE);
        assert!(
            (side * -V3::z() + V3::x()).norm() < 1e-12,
            "the front is on the left"
        );
    }

    #[test]
    fn a_tall_shape_gets_high_cells() {
        let mean = vec![0.0, 0.4, 0.0, 0.0, -0.4, 0.0];
        let prior = LearnedPrior::from(LinearPrior::new(mean, vec![], 0, vec![[0.0, 0.0, -1.0]; 2]).unwrap());
        let (_, height) = cell(&prior);
        assert_eq!(height, (0.8 * ROOM * SCALE) as usize);
    }

    #[test]
    fn a_point_that_faces_the_viewer_hides_the_one_behind() {
        let mean = vec![0.0, 0.0, -0.1, 0.0, 0.0, -0.2];
        let normals = vec![[0.0, 0.0, -1.0], [0.0, -0.6, -0.8]];
        let prior = LearnedPrior::from(LinearPrior::new(mean, vec![], 0, normals).unwrap());
        let sheet = contact_sheet(&prior, 3);
        assert_eq!(sheet.size(), (4 * MIN_CELL.0, MIN_CELL.1 + MARGIN));
        let centre = sheet[(3 * MIN_CELL.0 + MIN_CELL.0 / 2, MARGIN + MIN_CELL.1 / 2)];
        let light = V3::new(-0.4, 0.7, 0.6).normalize();
        let expected = 70.0 + 170.0 * V3::new(0.0, -0.6, 0.8).dot(&light).max(0.0);
        assert!(
            (f64::from(centre[2]) - expected).abs() < 0.1,
            "{centre:?} {expected}"
        );
    }
}
