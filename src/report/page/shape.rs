//! The shape, and the input's points, as the page's viewer takes them.

use super::encode::{base64, base64_floats, data_url};
use super::input_points::Points;
use crate::geometry::Vector3;
use crate::report::{ReportError, ply};
use crate::surface::Neighbours;
use serde::Serialize;
use std::path::Path;

/// A point's disc reaches to its neighbour of this rank: so the discs close the surface between points that are spread unevenly.
const NEIGHBOUR: u32 = 3;
/// No disc is larger than so many times the median one, so that lone points stay points.
const LARGEST: f32 = 2.0;

/// The shape that was found, object frame.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(super) enum Shape {
    Mesh {
        /// `mesh.glb`, base64.
        glb: String,
        /// Where the texture comes from (`mesh_origin.png`), as a `data:` address.
        origin: Option<String>,
    },
    Points {
        count: usize,
        /// x, y, z as f32, base64.
        positions: String,
        /// Unit normals in 127ths as i8, base64.
        normals: String,
        /// Red, green, blue as u8, base64.
        colours: String,
        /// The radius of the disc around each point, as f32, base64.
        radii: String,
    },
}

/// Depth of the input, back in space: object frame.
#[derive(Serialize)]
pub(super) struct InputPoints {
    count: usize,
    positions: String,
    colours: String,
}

impl Shape {
    /// Of `mesh.glb`, or where there is none of `shape.ply`.
    pub fn read(folder: &Path) -> Result<Self, ReportError> {
        let bytes_of = |name: &str| {
            let path = folder.join(name);
            match std::fs::read(&path) {
                Ok(bytes) => Ok(Some(bytes)),
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
                Err(error) => Err(ReportError::io(&path)(error)),
            }
        };
        if let Some(glb) = bytes_of("mesh.glb")? {
            return Ok(Self::Mesh {
                glb: base64(&glb),
                origin: bytes_of("mesh_origin.png")?.map(|png| data_url("image/png", &png)),
            });
        }
        let shape = ply::read_coloured(&folder.join("shape.ply"))?;
        let normals: Vec<u8> = shape
            .normals
            .iter()
            .flatten()
            .map(|part| (127.0 * part).round() as i8 as u8)
            .collect();
        Ok(Self::Points {
            count: shape.points.len(),
            positions: base64_floats(&shape.points),
            normals: base64(&normals),
            colours: base64(shape.colours.as_flattened()),
            radii: base64_floats(&radii(&shape.points)),
        })
    }
}

fn radii(points: &[[f32; 3]]) -> Vec<[f32; 1]> {
    let points: Vec<_> = points
        .iter()
        .map(|&point| Vector3::from(point).map(f64::from))
        .collect();
    let tree = Neighbours::new(&points);
    let radii: Vec<f32> = points
        .iter()
        .map(|point| {
            let nearest = tree.nearest(point, NEIGHBOUR + 1);
            nearest.last().map_or(0.0, |&(_, distance)| distance as f32)
        })
        .collect();
    let mut sorted = radii.clone();
    sorted.sort_by(f32::total_cmp);
    let largest = LARGEST * sorted[sorted.len() / 2];
    radii.into_iter().map(|radius| [radius.min(largest)]).collect()
}

impl From<Points> for InputPoints {
    fn from(points: Points) -> Self {
        Self {
            count: points.positions.len(),
            positions: base64_floats(&points.positions),
            colours: base64(points.colours.as_flattened()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_reach_to_their_neighbours_and_lone_points_stay_small() {
        let mut points: Vec<[f32; 3]> = (0..100)
            .map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0])
            .collect();
        points.push([500.0, 0.0, 0.0]);
        let radii = radii(&points);
        assert_eq!(radii[55], [1.0]);
        assert_eq!(radii[100], [2.0]);
    }
}
