//! The shape as a binary little-endian PLY that every viewer opens: `float x y z nx ny nz`, `uchar red green blue`, where it is known `float
//! deviation`, and of a mesh the faces: `list uchar uint vertex_indices`.

use super::ReportError;
use crate::geometry::Vector3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{
    Addable, ElementDef, Encoding, Ply, Property, PropertyAccess, PropertyAccessResult, PropertyDef,
    PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;
use std::io::BufReader;
use std::path::Path;

/// What a file says of each vertex.
pub(super) struct Vertices<'a> {
    pub points: &'a [Vector3<f64>],
    pub normals: &'a [Vector3<f64>],
    pub colours: &'a [[u8; 3]],
    /// Standard deviations, in the points' unit; empty where they are not known.
    pub deviations: &'a [f64],
}

/// Writes the vertices, with `comments` in the header (one line each), and the faces of a mesh over them.
pub(super) fn write_shape(
    path: &Path,
    vertices: &Vertices,
    faces: Option<&[[u32; 3]]>,
    comments: &[String],
) -> Result<(), ReportError> {
    let mut vertex = ElementDef::new("vertex".to_owned());
    for (names, scalar) in [
        (&["x", "y", "z", "nx", "ny", "nz"][..], ScalarType::Float),
        (&["red", "green", "blue"], ScalarType::UChar),
        (&[DEVIATION], ScalarType::Float),
    ] {
        let unknown = vertices.deviations.is_empty();
        for name in names.iter().filter(|name| !(unknown && **name == DEVIATION)) {
            let kind = PropertyType::Scalar(scalar.clone());
            vertex.properties.add(PropertyDef::new((*name).to_owned(), kind));
        }
    }
    let mut ply = Ply::<Element>::new();
    ply.header.encoding = Encoding::BinaryLittleEndian;
    ply.header.comments = comments.to_vec();
    ply.header.elements.add(vertex);
    let elements = vertices
        .points
        .iter()
        .zip(vertices.normals)
        .zip(vertices.colours)
        .enumerate()
        .map(|(i, ((point, normal), &colour))| Element {
            position: point.map(|c| c as f32).into(),
            normal: normal.map(|c| c as f32).into(),
            colour,
            deviation: vertices
                .deviations
                .get(i)
                .map_or(0.0, |&deviation| deviation as f32),
            corners: [0; 3],
        })
        .collect();
    ply.payload.insert("vertex".to_owned(), elements);
    if let Some(faces) = faces {
        let mut face = ElementDef::new("face".to_owned());
        let kind = PropertyType::List(ScalarType::UChar, ScalarType::UInt);
        face.properties.add(PropertyDef::new(CORNERS.to_owned(), kind));
        ply.header.elements.add(face);
        let faces = faces.iter().map(|&corners| Element {
            corners,
            ..Element::default()
        });
        ply.payload.insert("face".to_owned(), faces.collect());
    }
    let mut bytes = Vec::new();
    Writer::new()
        .write_ply(&mut bytes, &mut ply)
        .map_err(|error| ReportError::format(path, error))?;
    std::fs::write(path, bytes).map_err(ReportError::io(path))
}

/// The points of a PLY's `vertex` element (N × 3).
pub fn read_shape(path: &Path) -> Result<Vec<Vector3<f64>>, ReportError> {
    let vertices = read_vertices(path)?;
    Ok(vertices
        .iter()
        .map(|vertex| Vector3::from(vertex.position).map(f64::from))
        .collect())
}

/// The points of a PLY's `vertex` element, with normals (of whatever length) and colours, which are 0 where the file has none.
pub(super) fn read_coloured(path: &Path) -> Result<Coloured, ReportError> {
    let vertices = read_vertices(path)?;
    Ok(Coloured {
        points: vertices.iter().map(|vertex| vertex.position).collect(),
        normals: vertices.iter().map(|vertex| vertex.normal).collect(),
        colours: vertices.iter().map(|vertex| vertex.colour).collect(),
    })
}

/// Points as [`write_shape`] writes them.
pub(super) struct Coloured {
    pub points: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colours: Vec<[u8; 3]>,
}

/// At least one, each with a finite position.
fn read_vertices(path: &Path) -> Result<Vec<Element>, ReportError> {
    let file = std::fs::File::open(path).map_err(ReportError::io(path))?;
    let mut ply = Parser::<Element>::new()
        .read_ply(&mut BufReader::new(file))
        .map_err(|error| ReportError::format(path, error))?;
    let vertices = ply.payload.swap_remove("vertex").unwrap_or_default();
    let finite = |vertex: &Element| vertex.position.iter().all(|x| x.is_finite());
    if vertices.is_empty() || !vertices.iter().all(finite) {
        return Err(ReportError::format(
            path,
            "vertex must hold at least one point, all finite",
        ));
    }
    Ok(vertices)
}

const CORNERS: &str = "vertex_indices";
const DEVIATION: &str = "deviation";

/// A vertex, or a face, of which the corners alone count.
#[derive(Default)]
struct Element {
    position: [f32; 3],
    normal: [f32; 3],
    colour: [u8; 3],
    deviation: f32,
    corners: [u32; 3],
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let number = match property {
            Property::Float(value) => value,
            Property::Double(value) => value as f32,
            Property::UChar(value) => f32::from(value),
            _ => return PropertyAccessResult::Ignored,
        };
        match name {
            "x" => self.position[0] = number,
            "y" => self.position[1] = number,
            "z" => self.position[2] = number,
            "nx" => self.normal[0] = number,
            "ny" => self.normal[1] = number,
            "nz" => self.normal[2] = number,
            "red" => self.colour[0] = number as u8,
            "green" => self.colour[1] = number as u8,
            "blue" => self.colour[2] = number as u8,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        Some(match name {
            "x" => self.position[0],
            "y" => self.position[1],
            "z" => self.position[2],
            "nx" => self.normal[0],
            "ny" => self.normal[1],
            "nz" => self.normal[2],
            DEVIATION => self.deviation,
            _ => return None,
        })
    }

    fn get_list_uint(&self, name: &str) -> Option<&[u32]> {
        (name == CORNERS).then_some(&self.corners)
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        Some(match name {
            "red" => self.colour[0],
            "green" => self.colour[1],
            "blue" => self.colour[2],
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_packed_little_endian_and_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.ply");
        let points = [Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.0, 4.0, 8.0)];
        let (normals, colours) = ([Vector3::x(), Vector3::y()], [[255, 1, 2], [3, 4, 5]]);
        write_shape(
            &path,
            &Vertices {
                points: &points,
                normals: &normals,
                colours: &colours,
                deviations: &[],
            },
            None,
            &["frame: object".to_owned()],
        )
        .unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(
            header.starts_with("ply\nformat binary_little_endian 1.0\n"),
            "{header}"
        );
        assert!(header.contains("comment frame: object\n"));
        assert_eq!(bytes.len() - end, 2 * 27);
        assert_eq!(bytes[end..end + 4], 1f32.to_le_bytes());
        assert_eq!(bytes[end + 24..end + 27], [255, 1, 2]);
        assert_eq!(read_shape(&path).unwrap(), points);
        let read = read_coloured(&path).unwrap();
        assert_eq!(read.normals, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(read.colours, colours);
    }

    #[test]
    fn known_deviations_end_the_vertices() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.ply");
        let vertices = Vertices {
            points: &[Vector3::x(), Vector3::y()],
            normals: &[Vector3::x(), Vector3::y()],
            colours: &[[1, 2, 3]; 2],
            deviations: &[0.25, 0.5],
        };
        write_shape(&path, &vertices, None, &[]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let header = String::from_utf8_lossy(&bytes);
        assert!(
            header.contains("property float deviation\nend_header\n"),
            "{header}"
        );
        let end = bytes.len();
        assert_eq!(bytes[end - 31 - 4..end - 31], 0.25f32.to_le_bytes());
        assert_eq!(bytes[end - 4..], 0.5f32.to_le_bytes());
    }

    #[test]
    fn what_is_no_ply_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.ply");
        std::fs::write(&path, "solid nothing").unwrap();
        assert!(read_shape(&path).unwrap_err().to_string().contains("shape.ply"));
    }
}
