//! Writes small files of every kind into `corpus/<target>/`, where the targets start.

#[path = "../../../tests/all/fixture/mod.rs"]
mod fixture;

use spba_ceres_fuzz::{TEXTURED, zip};
use std::path::Path;

fn main() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let write = |target: &str, name: &str, bytes: &[u8]| fixture::write(&corpus.join(target).join(name), bytes);
    let folder = std::env::temp_dir().join(format!("spba-seeds-{}", std::process::id()));

    fixture::workspace(&folder);
    fixture::stereo(&folder);
    fixture::openmvs(&folder, 6, 0.0);
    fixture::sparse_binary(&folder, 1, &fixture::CAMERA);
    for (target, ending) in [("colmap_text", "txt"), ("colmap_binary", "bin")] {
        for (which, name) in ["cameras", "images", "points3D"].iter().enumerate() {
            let bytes = std::fs::read(folder.join(format!("sparse/{name}.{ending}"))).expect("a seed");
            write(target, name, &[&[which as u8][..], &bytes].concat());
        }
    }
    for (target, file) in [
        ("colmap_depth", "stereo/depth_maps/a.png.geometric.bin"),
        ("openmvs_depth", "depth0000.dmap"),
    ] {
        write(target, "whole", &std::fs::read(folder.join(file)).expect("a seed"));
    }
    for version in 0..=7 {
        let scene = fixture::scene_mvs(version, &["images/a.png"], &fixture::CAMERA, (32, 24));
        write("openmvs_scene", &format!("version-{version}"), &scene);
    }
    std::fs::remove_dir_all(&folder).expect("the seeds' folder");

    write("sequence", "whole", SEQUENCE.as_bytes());
    let depth = folder.with_extension("exr");
    let grid = spba_ceres::image::Grid::from_fn(5, 4, |column, row| (column + row) as f32);
    spba_ceres::image::write_depth(&grid, &depth).expect("a seed");
    write("depth", "exr", &[&[0][..], &std::fs::read(&depth).expect("a seed")].concat());
    std::fs::remove_file(&depth).expect("the seed's file");
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    write("depth", "ply", &[&[1][..], ply.as_bytes(), &[0; 12]].concat());

    write("prior", "whole", &prior());
    write("ac3d", "whole", TEXTURED);
    write("obj", "whole", &[OBJ, b"\0", MTL].concat());
    write("sgi", "verbatim", &sgi(0));
    write("sgi", "coded", &sgi(1));
    write("sweet_home", "parts", &[CATALOGUE, b"\0", OBJ].concat());
    let files = [("PluginFurnitureCatalog.properties", CATALOGUE), ("a.obj", OBJ)];
    write("sweet_home", "zip", &zip(&files));
    write("glb", "whole", &glb());
    for (name, format) in [("png", image::ImageFormat::Png), ("jpeg", image::ImageFormat::Jpeg)] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([(30 * x) as u8, (30 * y) as u8, 90]));
        picture.write_to(&mut bytes, format).expect("a seed");
        write("picture", name, &bytes.into_inner());
    }
    write("picture", "exif", &with_exif());
    write("result", "whole", RESULT.as_bytes());
}

const SEQUENCE: &str = "schema = 1\nmotion_deviation = 0.001\n\
    [[frames]]\nname = \"a\"\nimage = \"images/a.png\"\nmask = \"masks/a.png\"\ntimestamp_s = 0.5\n\
    camera = { fx = 10.0, fy = 10.0, cx = 4.0, cy = 3.0 }\n\
    camera_from_input = { rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation = [0.0, 0.0, 2.0] }\n\
    [[frames]]\nname = \"b\"\nimage = \"images/a.png\"\nmask = \"masks/a.png\"\n\
    camera = { fx = 10.0, fy = 10.0, cx = 4.0, cy = 3.0 }\n";
const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nf -1 -2 -3\n";
const MTL: &[u8] = b"newmtl a\nKd 1 0.5 0\nd 1\n";
const CATALOGUE: &[u8] =
    b"name=Lib\nlicense=CC0\nid#1=Lib#a\ncategory#1=Vehicles\nmodel#1=/a.obj\nwidth#1=10\ndepth#1=40\nheight#1=20\n\
      modelRotation#1=0 -1 0 1 0 0 0 0 1\n";
const RESULT: &str = r#"{"schema": 2, "version": "0", "input": "a", "prior": "car", "frames": [{"name": "a",
    "rotation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "translation": [0.0, 0.0, 2.0],
    "center": [0.0, 0.0, -2.0], "silhouette_iou": 0.9, "density": 0.9}], "style": [0.5], "alpha": 1.0, "focal_factor": 1.0,
    "object_from_input": null, "silhouette_iou_mean": 0.9, "density_mean": 0.9, "iterations": 1, "seconds": {"load": 0.1},
    "peak_memory_mb": 10.0, "hypotheses": []}"#;

/// A mean of four points and a mode.
fn prior() -> Vec<u8> {
    let points = [[0.4f32, 0.2, -0.25], [-0.4, 0.2, -0.25], [0.4, -0.2, 0.25], [-0.4, -0.2, 0.25]];
    let mean: Vec<u8> = points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let description = serde_json::json!({
        "schema": 1, "kind": "linear", "category": "car", "frame": spba_ceres::geometry::OBJECT_FRAME, "symmetry": "none",
        "styles": 1, "points": 4, "command": "", "seed": 0, "explained_variance": [], "licences": [], "sources": [],
    });
    let header = serde_json::json!({
        "__metadata__": {"spba_prior": description.to_string()},
        "mean": {"dtype": "F32", "shape": [4, 3], "data_offsets": [0, 48]},
        "basis": {"dtype": "F16", "shape": [1, 4, 3], "data_offsets": [48, 72]},
        "normals": {"dtype": "F16", "shape": [4, 3], "data_offsets": [72, 96]},
    })
    .to_string();
    // In 16 bits 0x3c00 is 1.
    let normals = [0, 0, 0, 0x3c, 0, 0].repeat(4);
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &mean, &[0; 24], &normals].concat()
}

/// An SGI picture of 2 × 2 grey pixels without its magic number.
fn sgi(storage: u8) -> Vec<u8> {
    let mut bytes = vec![storage, 1, 0, 2, 0, 2, 0, 2, 0, 1];
    bytes.resize(510, 0);
    if storage == 0 {
        bytes.extend([1, 2, 3, 4]);
    } else {
        for word in [528u32, 532, 4, 4] {
            bytes.extend(word.to_be_bytes());
        }
        bytes.extend([0x82, 1, 2, 0, 0x02, 9, 0, 0]);
    }
    bytes
}

/// A triangle.
fn glb() -> Vec<u8> {
    let mut data: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    data.extend([0, 1, 2, 0]);
    let mut json = serde_json::json!({
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": data.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 3}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0.5, 0.5]}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "nodes": [{"children": [1], "translation": [10, 0, 0]}, {"mesh": 0, "scale": [2, 3, 1]}],
        "scenes": [{"nodes": [0]}], "scene": 0,
    })
    .to_string();
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let word = |number: usize| (number as u32).to_le_bytes();
    [
        &b"glTF\x02\0\0\0"[..],
        &word(12 + 8 + json.len() + 8 + data.len()),
        &word(json.len()),
        b"JSON",
        json.as_bytes(),
        &word(data.len()),
        b"BIN\0",
        &data,
    ]
    .concat()
}

/// A JPEG with EXIF data.
fn with_exif() -> Vec<u8> {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(8, 8).write_to(&mut jpeg, image::ImageFormat::Jpeg).expect("a seed");
    let jpeg = jpeg.into_inner();
    let fields = [
        (exif::Tag::Orientation, exif::Value::Short(vec![6])),
        (exif::Tag::FocalLengthIn35mmFilm, exif::Value::Short(vec![26])),
        (exif::Tag::Model, exif::Value::Ascii(vec![b"NIKON D70".to_vec()])),
        (exif::Tag::DateTimeOriginal, exif::Value::Ascii(vec![b"2026:11:23 12:00:00".to_vec()])),
    ]
    .map(|(tag, value)| exif::Field {
        tag,
        ifd_num: exif::In::PRIMARY,
        value,
    });
    let mut writer = exif::experimental::Writer::new();
    fields.iter().for_each(|field| writer.push_field(field));
    let mut data = std::io::Cursor::new(Vec::new());
    writer.write(&mut data, false).expect("a seed");
    let segment = [b"Exif\0\0".to_vec(), data.into_inner()].concat();
    let length = (segment.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &segment, &jpeg[2..]].concat()
}
