//! The mesh as binary glTF 2.0 (`mesh.glb`): positions, normals, colours and triangles, one material, everything inside.

use super::ReportError;
use crate::geometry::Vector3;
use gltf::Semantic;
use gltf::binary::{Glb, Header};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Asset, Buffer, Index, Material, Mesh, Node, Root, Scene, Value};
use std::path::Path;

/// Of paint that is neither mirror nor chalk; the colours hold what light did.
const ROUGHNESS: f32 = 0.9;

/// Writes vertices with normals and colours (sRGB, as frames show them), and faces, counter-clockwise seen from outside. `frame` says what
/// the coordinates are, in the mesh's name.
pub(super) fn write_mesh(
    path: &Path,
    vertices: &[Vector3<f64>],
    normals: &[Vector3<f64>],
    colours: &[[u8; 3]],
    faces: &[[u32; 3]],
    frame: &str,
) -> Result<(), ReportError> {
    let bytes = to_bytes(vertices, normals, colours, faces, frame)
        .map_err(|error| ReportError::format(path, error))?;
    std::fs::write(path, bytes).map_err(ReportError::io(path))
}

fn to_bytes(
    vertices: &[Vector3<f64>],
    normals: &[Vector3<f64>],
    colours: &[[u8; 3]],
    faces: &[[u32; 3]],
    frame: &str,
) -> Result<Vec<u8>, gltf::Error> {
    let mut parts = Parts::default();
    let single = |vectors: &[Vector3<f64>]| -> Vec<[f32; 3]> {
        let rounded = vectors.iter().map(|v| v.map(|x| x as f32).into());
        rounded.collect()
    };
    let positions = single(vertices);
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for position in &positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    let position = parts.attribute(&positions, |x| x.to_le_bytes(), ComponentType::F32, Type::Vec3);
    let accessor = &mut parts.root.accessors[position.value()];
    (accessor.min, accessor.max) = (Some(Value::from(low.to_vec())), Some(Value::from(high.to_vec())));
    let normal = parts.attribute(
        &single(normals),
        |x| x.to_le_bytes(),
        ComponentType::F32,
        Type::Vec3,
    );
    let colours: Vec<[u16; 4]> = colours.iter().map(|&colour| linear(colour)).collect();
    let colour = parts.attribute(&colours, |x| x.to_le_bytes(), ComponentType::U16, Type::Vec4);
    parts.root.accessors[colour.value()].normalized = true;
    let indices = parts.indices(faces);
    parts.finish(
        [
            (Semantic::Positions, position),
            (Semantic::Normals, normal),
            (Semantic::Colors(0), colour),
        ],
        indices,
        frame,
    )
}

/// sRGB to linear light, of 65535, opaque: what glTF has colours of vertices in.
fn linear(colour: [u8; 3]) -> [u16; 4] {
    let one = |value: u8| {
        let x = f64::from(value) / 255.0;
        let light = if x <= 0.04045 {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055).powf(2.4)
        };
        (light * 65535.0).round() as u16
    };
    let [r, g, b] = colour.map(one);
    [r, g, b, u16::MAX]
}

/// The binary chunk as it grows, and its description.
#[derive(Default)]
struct Parts {
    root: Root,
    bytes: Vec<u8>,
}

impl Parts {
    /// A view of its own for an attribute of the vertices.
    fn attribute<T: Copy, const N: usize, const B: usize>(
        &mut self,
        values: &[[T; N]],
        bytes: impl Fn(T) -> [u8; B],
        component: ComponentType,
        kind: Type,
    ) -> Index<Accessor> {
        let all = values.iter().flatten().flat_map(|&value| bytes(value));
        let stride = Some(Stride(N * B));
        self.accessor(
            all.collect(),
            Target::ArrayBuffer,
            stride,
            values.len(),
            component,
            kind,
        )
    }

    fn indices(&mut self, faces: &[[u32; 3]]) -> Index<Accessor> {
        let all = faces.iter().flatten().flat_map(|v| v.to_le_bytes());
        self.accessor(
            all.collect(),
            Target::ElementArrayBuffer,
            None,
            3 * faces.len(),
            ComponentType::U32,
            Type::Scalar,
        )
    }

    fn accessor(
        &mut self,
        bytes: Vec<u8>,
        target: Target,
        byte_stride: Option<Stride>,
        count: usize,
        component: ComponentType,
        kind: Type,
    ) -> Index<Accessor> {
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride,
            name: None,
            target: Some(Checked::Valid(target)),
            extensions: None,
            extras: Default::default(),
        });
        self.bytes.extend(bytes);
        // Every component is aligned: all lengths are multiples of 4.
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Checked::Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Checked::Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    /// The file.
    fn finish(
        mut self,
        attributes: [(Semantic, Index<Accessor>); 3],
        indices: Index<Accessor>,
        name: &str,
    ) -> Result<Vec<u8>, gltf::Error> {
        let root = &mut self.root;
        root.asset = Asset {
            generator: Some(format!("spba-ceres {}", env!("CARGO_PKG_VERSION"))),
            ..Asset::default()
        };
        root.push(Buffer {
            byte_length: USize64::from(self.bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let material = root.push(Material {
            pbr_metallic_roughness: PbrMetallicRoughness {
                base_color_factor: PbrBaseColorFactor([1.0; 4]),
                metallic_factor: StrengthFactor(0.0),
                roughness_factor: StrengthFactor(ROUGHNESS),
                ..PbrMetallicRoughness::default()
            },
            ..Material::default()
        });
        let mesh = root.push(Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(name.to_owned()),
            primitives: vec![Primitive {
                attributes: attributes
                    .into_iter()
                    .map(|(semantic, accessor)| (Checked::Valid(semantic), accessor))
                    .collect(),
                extensions: None,
                extras: Default::default(),
                indices: Some(indices),
                material: Some(material),
                mode: Checked::Valid(Mode::Triangles),
                targets: None,
            }],
            weights: None,
        });
        let node = root.push(Node {
            mesh: Some(mesh),
            ..Node::default()
        });
        let scene = root.push(Scene {
            extensions: None,
            extras: Default::default(),
            name: None,
            nodes: vec![node],
        });
        root.scene = Some(scene);
        let json = root.to_vec()?;
        Glb {
            // The writer counts the length itself.
            header: Header {
                magic: *b"glTF",
                version: 2,
                length: 0,
            },
            json: json.into(),
            bin: Some(self.bytes.into()),
        }
        .to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_reads_back() {
        let vertices = [
            Vector3::zeros(),
            Vector3::x(),
            Vector3::y(),
            Vector3::new(0.0, 0.5, -2.0),
        ];
        let normals = [Vector3::z(); 4];
        let colours = [[0, 128, 255], [255, 255, 255], [1, 2, 3], [10, 20, 30]];
        let faces = [[0, 1, 2], [0, 2, 3]];
        let bytes = to_bytes(&vertices, &normals, &colours, &faces, "a frame").unwrap();
        assert_eq!(bytes.len() % 4, 0);
        assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
        // The library validates what it reads.
        let (document, buffers, _) = gltf::import_slice(&bytes).unwrap();
        let mesh = document.meshes().next().unwrap();
        assert_eq!(mesh.name(), Some("a frame"));
        let primitive = mesh.primitives().next().unwrap();
        let bounds = primitive.bounding_box();
        assert_eq!((bounds.min, bounds.max), ([0.0, 0.0, -2.0], [1.0, 1.0, 0.0]));
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()].0));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        assert_eq!(positions[3], [0.0, 0.5, -2.0]);
        assert_eq!(reader.read_normals().unwrap().count(), 4);
        let colours: Vec<_> = reader.read_colors(0).unwrap().into_rgba_u16().collect();
        // 128 of 255 is 21.6 % of the light.
        assert_eq!((colours[0], colours[1]), ([0, 14146, 65535, 65535], [65535; 4]));
        let indices: Vec<_> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, [0, 1, 2, 0, 2, 3]);
    }
}
