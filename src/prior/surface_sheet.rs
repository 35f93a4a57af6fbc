//! The contact sheet of a prior of surfaces: the mean from all sides, each style at ±2σ, and free forms drawn at random.

use super::glyphs;
use super::surface::{FreeForm, SurfacePrior};
use crate::cad::render::{Light, LightFrame, Renderer, Viewpoint};
use crate::cad::{Material, Mesh, Triangle, orbit};
use crate::geometry::Pinhole;
use crate::image::{Grid, RgbImage};
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Pixels of a view.
const CELL: (usize, usize) = (300, 200);
/// Pixels a diagonal at the object's centre.
const SCALE: f64 = 285.0;
/// In diagonals: far, so that sizes hardly depend on depth.
const DISTANCE: f64 = 6.0;
const MARGIN: usize = 20;
const BACKGROUND: f32 = 255.0;
const INK: [f32; 3] = [40.0; 3];
const FREE_FORMS: usize = 3;

/// From above the camera's left shoulder, so that no side is dark.
const LIGHT: Light = Light {
    fixed_to: LightFrame::Camera,
    direction: [-0.4, -0.8, -0.7],
    ambient: 0.25,
    diffuse: 0.8,
};

/// Azimuth and elevation in degrees, see [`orbit`].
const FRONT_QUARTER: (f64, f64) = (35.0, 18.0);
const REAR_QUARTER: (f64, f64) = (145.0, 18.0);
const SIDE: (f64, f64) = (-90.0, 0.0);
const FRONT: (f64, f64) = (0.0, 0.0);
const BACK: (f64, f64) = (180.0, 0.0);
/// The front on the left, as from the side.
const TOP: (f64, f64) = (-90.0, 89.9);

/// A row: what is written over it, from which column on, and a picture a cell.
struct Row {
    labels: Vec<(usize, String)>,
    cells: Vec<Cell>,
}

/// A shape, and where it is seen from.
struct Cell {
    style: Vec<f64>,
    form: Vec<f64>,
    view: (f64, f64),
}

/// At most `modes` styles.
pub fn surface_sheet(prior: &SurfacePrior, modes: usize) -> RgbImage {
    let rows = rows(prior, modes.min(prior.style_len()));
    let columns = 6;
    let row_height = CELL.1 + MARGIN;
    let pictures: Vec<Vec<RgbImage>> = rows
        .par_iter()
        .map(|row| row.cells.iter().map(|cell| picture(prior, cell)).collect())
        .collect();
    let mut sheet = Grid::from_fn(columns * CELL.0, row_height * rows.len(), |x, y| {
        let (row, column) = (y / row_height, x / CELL.0);
        let below = (y % row_height).checked_sub(MARGIN);
        match (below, pictures[row].get(column)) {
            (Some(below), Some(picture)) => picture[(x % CELL.0, below)],
            _ => [BACKGROUND; 3],
        }
    });
    for (index, row) in rows.iter().enumerate() {
        for (column, label) in &row.labels {
            for (x, y) in glyphs::dots(label) {
                sheet[(column * CELL.0 + 4 + x, index * row_height + 4 + y)] = INK;
            }
        }
    }
    sheet
}

fn rows(prior: &SurfacePrior, modes: usize) -> Vec<Row> {
    let none = vec![0.0; prior.style_len()];
    let all = [FRONT_QUARTER, REAR_QUARTER, SIDE, FRONT, BACK, TOP];
    let mut rows = vec![Row {
        labels: vec![(0, "MEAN".to_owned())],
        cells: all
            .map(|view| Cell {
                style: none.clone(),
                form: Vec::new(),
                view,
            })
            .into(),
    }];
    for mode in 0..modes {
        let at = |deviation: f64| {
            let mut style = none.clone();
            style[mode] = deviation;
            [FRONT_QUARTER, SIDE, FRONT].map(|view| Cell {
                style: style.clone(),
                form: Vec::new(),
                view,
            })
        };
        rows.push(Row {
            labels: vec![
                (0, format!("MODE {}  -2 SIGMA", mode + 1)),
                (3, format!("MODE {}  +2 SIGMA", mode + 1)),
            ],
            cells: at(-2.0).into_iter().chain(at(2.0)).collect(),
        });
    }
    let mut random = ChaCha8Rng::seed_from_u64(0);
    for sample in 0..FREE_FORMS {
        let form: Vec<f64> = (0..prior.form_len(FreeForm::Symmetric))
            .map(|_| normal(&mut random))
            .collect();
        rows.push(Row {
            labels: vec![(0, format!("FREE FORM {}", sample + 1))],
            cells: all
                .map(|view| Cell {
                    style: none.clone(),
                    form: form.clone(),
                    view,
                })
                .into(),
        });
    }
    rows
}

/// Standard normal (Box–Muller).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

fn picture(prior: &SurfacePrior, cell: &Cell) -> RgbImage {
    let (azimuth, elevation) = cell.view;
    let triangle = |vertices| Triangle {
        vertices,
        texture_coordinates: [[0.0; 2]; 3],
        material: 0,
    };
    let mesh = Mesh {
        vertices: prior.vertices(&cell.style, &cell.form),
        triangles: prior.mesh().faces().into_iter().map(triangle).collect(),
        materials: vec![Material {
            diffuse: [0.75, 0.8, 0.85],
            opacity: 1.0,
            texture: None,
        }],
    };
    let view = Viewpoint {
        camera: Pinhole {
            fx: SCALE * DISTANCE,
            fy: SCALE * DISTANCE,
            cx: CELL.0 as f64 / 2.0,
            cy: CELL.1 as f64 / 2.0,
        },
        camera_from_object: orbit(azimuth, elevation, DISTANCE),
        width: CELL.0,
        height: CELL.1,
    };
    let found = Renderer::new(&mesh, 3).render(&view, &LIGHT);
    Grid::from_fn(CELL.0, CELL.1, |x, y| {
        found.image[(x, y)].map(|value| value + BACKGROUND * (1.0 - found.coverage[(x, y)]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::surface::tests::octahedron;

    #[test]
    fn the_sheet_shows_the_mean_and_a_row_a_style() {
        let sheet = surface_sheet(&octahedron(), 9);
        assert_eq!(
            sheet.size(),
            (6 * CELL.0, (1 + 1 + FREE_FORMS) * (CELL.1 + MARGIN))
        );
        let middle = sheet[(CELL.0 / 2, MARGIN + CELL.1 / 2)];
        assert!(
            middle[0] < 250.0 && sheet[(CELL.0 - 2, MARGIN + 2)] == [BACKGROUND; 3],
            "{middle:?}"
        );
    }
}
