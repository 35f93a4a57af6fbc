//! The mesh as binary glTF 2.0 (`mesh.glb`): positions, normals, texture coordinates, where they are known standard deviations
//! (`_DEVIATION`, in the positions' unit), and triangles, one material with the texture, everything inside.

use super::ReportError;
use super::surface::UnwrappedMesh;
use crate::geometry::Vector3;
use gltf::Semantic;
use gltf::binary::{Glb, Header};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::image::MimeType;
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::texture::{Info, MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Asset, Buffer, Image, Index, Material, Mesh, Node, Root, Scene, Texture, Value};
use serde_json::value::to_raw_value;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

/// What viewers call the mesh.
const NAME: &str = "object";
/// Of paint that is neither mirror nor chalk; the texture holds what light did.
const ROUGHNESS: f32 = 0.9;

/// Writes `mesh` with its vertices' deviations (none where they are unknown; those beyond its vertices are not read) and its texture (sRGB, as frames show it, first row at the top). `frame` says what the coordinates are; it becomes the
/// asset's extra of that name. Where the object's size is known, the node scales it to glTF's unit, the metre.
pub(super) fn write_mesh(
    path: &Path,
    (mesh, deviations): (&UnwrappedMesh, &[f64]),
    colours: &image::RgbImage,
    frame: &str,
    metres_per_unit: Option<f64>,
) -> Result<(), ReportError> {
    let mut png = Cursor::new(Vec::new());
    colours
        .write_to(&mut png, image::ImageFormat::Png)
        .map_err(|error| ReportError::format(path, error))?;
    let bytes = to_bytes((mesh, deviations), png.into_inner(), frame, metres_per_unit)
        .map_err(|error| ReportError::format(path, error))?;
    std::fs::write(path, bytes).map_err(ReportError::io(path))
}

fn to_bytes(
    (mesh, deviations): (&UnwrappedMesh, &[f64]),
    png: Vec<u8>,
    frame: &str,
    metres_per_unit: Option<f64>,
) -> Result<Vec<u8>, gltf::Error> {
    let corners = Corners::of(mesh);
    let vectors = |of: &[Vector3<f64>]| -> Vec<[f32; 3]> {
        let each = corners.vertices.iter().map(|&v| of[v as usize]);
        each.map(|vector| vector.map(|x| x as f32).into()).collect()
    };
    let mut parts = Parts::default();
    let positions = vectors(&mesh.vertices);
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for position in &positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    let position = parts.attribute(&positions, Type::Vec3);
    let accessor = &mut parts.root.accessors[position.value()];
    (accessor.min, accessor.max) = (Some(Value::from(low.to_vec())), Some(Value::from(high.to_vec())));
    let normal = parts.attribute(&vectors(&mesh.normals), Type::Vec3);
    let at = parts.attribute(&corners.texture_coordinates, Type::Vec2);
    let mut attributes = vec![
        (Semantic::Positions, position),
        (Semantic::Normals, normal),
        (Semantic::TexCoords(0), at),
    ];
    if deviations.len() >= mesh.vertices.len() {
        let each = corners.vertices.iter().map(|&v| [deviations[v as usize] as f32]);
        let deviation = parts.attribute(&each.collect::<Vec<_>>(), Type::Scalar);
        attributes.push((Semantic::Extras("DEVIATION".to_owned()), deviation));
    }
    let indices = parts.indices(&corners.faces);
    parts.finish(attributes, indices, png, (frame, metres_per_unit))
}

/// Vertices that lie at several places of the texture, once for each.
struct Corners {
    /// The vertices of the mesh.
    vertices: Vec<u32>,
    /// v down, as glTF has it.
    texture_coordinates: Vec<[f32; 2]>,
    faces: Vec<[u32; 3]>,
}

impl Corners {
    fn of(mesh: &UnwrappedMesh) -> Self {
        let mut found = Self {
            vertices: Vec::new(),
            texture_coordinates: Vec::new(),
            faces: Vec::new(),
        };
        let mut known = BTreeMap::new();
        for (face, coordinates) in mesh.faces.iter().zip(&mesh.texture_coordinates) {
            found.faces.push([0, 1, 2].map(|k| {
                let [u, v] = coordinates[k];
                *known
                    .entry((face[k], u.to_bits(), v.to_bits()))
                    .or_insert_with(|| {
                        found.vertices.push(face[k]);
                        found.texture_coordinates.push([u, 1.0 - v]);
                        found.vertices.len() as u32 - 1
                    })
            }));
        }
        found
    }
}

/// The binary chunk as it grows, and its description.
#[derive(Default)]
struct Parts {
    root: Root,
    bytes: Vec<u8>,
}

impl Parts {
    /// A view of its own for an attribute of the vertices.
    fn attribute<const N: usize>(&mut self, values: &[[f32; N]], kind: Type) -> Index<Accessor> {
        let all = values.iter().flatten().flat_map(|value| value.to_le_bytes());
        let view = self.view(all.collect(), Some(Target::ArrayBuffer), Some(Stride(4 * N)));
        self.accessor(view, values.len(), ComponentType::F32, kind)
    }

    fn indices(&mut self, faces: &[[u32; 3]]) -> Index<Accessor> {
        let all = faces.iter().flatten().flat_map(|v| v.to_le_bytes());
        let view = self.view(all.collect(), Some(Target::ElementArrayBuffer), None);
        self.accessor(view, 3 * faces.len(), ComponentType::U32, Type::Scalar)
    }

    /// Numbers are aligned where the picture comes last: all lengths but its are multiples of 4.
    fn view(&mut self, bytes: Vec<u8>, target: Option<Target>, byte_stride: Option<Stride>) -> Index<View> {
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride,
            name: None,
            target: target.map(Checked::Valid),
            extensions: None,
            extras: Default::default(),
        });
        self.bytes.extend(bytes);
        view
    }

    fn accessor(
        &mut self,
        view: Index<View>,
        count: usize,
        component: ComponentType,
        kind: Type,
    ) -> Index<Accessor> {
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

    /// The texture of `png`, between whose texels there are mixtures, and which ends at its edges.
    fn texture(&mut self, png: Vec<u8>) -> Index<Texture> {
        let view = self.view(png, None, None);
        let source = self.root.push(Image {
            buffer_view: Some(view),
            mime_type: Some(MimeType("image/png".to_owned())),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let sampler = self.root.push(Sampler {
            mag_filter: Some(Checked::Valid(MagFilter::Linear)),
            min_filter: Some(Checked::Valid(MinFilter::LinearMipmapLinear)),
            wrap_s: Checked::Valid(WrappingMode::ClampToEdge),
            wrap_t: Checked::Valid(WrappingMode::ClampToEdge),
            ..Sampler::default()
        });
        self.root.push(Texture {
            name: None,
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: Default::default(),
        })
    }

    /// The file.
    fn finish(
        mut self,
        attributes: Vec<(Semantic, Index<Accessor>)>,
        indices: Index<Accessor>,
        png: Vec<u8>,
        (frame, metres_per_unit): (&str, Option<f64>),
    ) -> Result<Vec<u8>, gltf::Error> {
        let texture = self.texture(png);
        let root = &mut self.root;
        root.asset = Asset {
            generator: Some(format!("spba-ceres {}", env!("CARGO_PKG_VERSION"))),
            extras: Some(to_raw_value(&BTreeMap::from([("frame", frame)]))?),
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
                base_color_texture: Some(Info {
                    index: texture,
                    tex_coord: 0,
                    extensions: None,
                    extras: Default::default(),
                }),
                metallic_factor: StrengthFactor(0.0),
                roughness_factor: StrengthFactor(ROUGHNESS),
                ..PbrMetallicRoughness::default()
            },
            ..Material::default()
        });
        let mesh = root.push(Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(NAME.to_owned()),
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
            name: Some(NAME.to_owned()),
            scale: metres_per_unit.map(|metres| [metres as f32; 3]),
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
        let vertices = vec![
            Vector3::zeros(),
            Vector3::x(),
            Vector3::y(),
            Vector3::new(0.0, 0.5, -2.0),
        ];
        // Vertices 0 and 2 lie at two places of the texture.
        let coordinates = vec![
            [[0.0, 0.0], [0.5, 0.0], [0.0, 0.25]],
            [[0.5, 0.5], [1.0, 0.5], [1.0, 1.0]],
        ];
        let mesh = UnwrappedMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]], coordinates);
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("mesh.glb");
        let colours = image::RgbImage::from_fn(3, 5, |x, y| image::Rgb([10 * x as u8, y as u8, 255]));
        let deviations = [0.5, 0.25, 0.125, 0.75];
        write_mesh(&path, (&mesh, &deviations), &colours, "a frame", Some(4.5)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes.len() % 4, 0);
        assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
        // The library validates what it reads.
        let (document, buffers, images) = gltf::import_slice(&bytes).unwrap();
        assert_eq!((images[0].width, images[0].height), (3, 5));
        assert_eq!(images[0].pixels, colours.into_raw());
        let node = document.nodes().next().unwrap();
        assert_eq!(node.transform().decomposed().2, [4.5; 3]);
        let mesh = document.meshes().next().unwrap();
        assert_eq!(mesh.name(), Some("object"));
        let extras = document.as_json().asset.extras.as_ref().unwrap();
        assert_eq!(extras.get(), r#"{"frame":"a frame"}"#);
        let primitive = mesh.primitives().next().unwrap();
        let bounds = primitive.bounding_box();
        assert_eq!((bounds.min, bounds.max), ([0.0, 0.0, -2.0], [1.0, 1.0, 0.0]));
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()].0));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        let at: Vec<_> = reader.read_tex_coords(0).unwrap().into_f32().collect();
        let indices: Vec<_> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(
            (positions.len(), indices.as_slice()),
            (6, &[0, 1, 2, 3, 4, 5][..])
        );
        assert_eq!((positions[5], at[5]), ([0.0, 0.5, -2.0], [1.0, 0.0]));
        let accessor = primitive
            .attributes()
            .find(|(semantic, _)| *semantic == gltf::Semantic::Extras("DEVIATION".into()))
            .unwrap()
            .1;
        let of_corners: Vec<f32> =
            gltf::accessor::Iter::new(accessor, |buffer| Some(&buffers[buffer.index()].0[..]))
                .unwrap()
                .collect();
        assert_eq!(of_corners, [0.5, 0.25, 0.125, 0.5, 0.125, 0.75]);
        assert_eq!(at[2], [0.0, 0.75]);
        assert!(
            primitive
                .material()
                .pbr_metallic_roughness()
                .base_color_texture()
                .is_some()
        );
    }
}
