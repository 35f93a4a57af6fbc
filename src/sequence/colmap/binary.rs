//! COLMAP's binary model: `cameras.bin`, `images.bin`, `points3D.bin` (little-endian, packed, ids unordered).

use super::camera::{Camera, CameraModel};
use super::model::{Image, Point, pose};
use crate::geometry::Vector3;
use crate::sequence::SequenceError;
use crate::sequence::bytes::Bytes;
use std::collections::BTreeMap;
use std::path::Path;

/// u64 count; each: u32 id, i32 model, u64 width, u64 height, f64 parameters.
pub(super) fn cameras(data: &[u8], file: &Path) -> Result<BTreeMap<u32, Camera>, SequenceError> {
    let mut bytes = Bytes::new(file, data);
    let count = bytes.u64("number of cameras")?;
    let mut cameras = BTreeMap::new();
    for index in 0..bytes.count(count, 24, "cameras")? {
        let field = format!("camera {index} of {count}");
        let id = bytes.u32(&field)?;
        let model = CameraModel::by_id(bytes.i32(&field)?, file)?;
        let size = (bytes.u64(&field)? as usize, bytes.u64(&field)? as usize);
        let mut parameters = Vec::with_capacity(model.parameter_count);
        for _ in 0..model.parameter_count {
            parameters.push(bytes.f64(&field)?);
        }
        cameras.extend(model.camera(size, &parameters).map(|camera| (id, camera)));
    }
    bytes.end("number of cameras")?;
    Ok(cameras)
}

/// u64 count; each: u32 id, f64 quaternion (w first), f64 translation, u32 camera, zero-terminated name, u64 number of
/// observations, each f64 x, f64 y, u64 point.
pub(super) fn images(data: &[u8], file: &Path) -> Result<Vec<Image>, SequenceError> {
    let mut bytes = Bytes::new(file, data);
    let declared = bytes.u64("number of images")?;
    let count = bytes.count(declared, 4 + 7 * 8 + 4 + 1 + 8, "images")?;
    let mut images = Vec::with_capacity(count);
    for index in 0..count {
        let field = format!("image {index} of {count}");
        let id = bytes.u32(&field)?;
        let (quaternion, translation) = (bytes.f64s(&field)?, bytes.f64s(&field)?);
        let camera = bytes.u32(&field)?;
        let name = bytes.zero_terminated(&field)?;
        let observations = bytes.u64(&field)?;
        bytes.skip(observations, 24, &format!("{field}: {observations} observations"))?;
        images.push(Image {
            id,
            name,
            camera,
            camera_from_world: pose(quaternion, translation, file, &field)?,
        });
    }
    bytes.end("number of images")?;
    Ok(images)
}

/// u64 count; each: u64 id, f64 position, u8 colour × 3, f64 error, u64 track length, each u32 image, u32 observation.
pub(super) fn points(data: &[u8], file: &Path) -> Result<Vec<Point>, SequenceError> {
    let mut bytes = Bytes::new(file, data);
    let declared = bytes.u64("number of points")?;
    let count = bytes.count(declared, 8 + 3 * 8 + 3 + 8 + 8, "points")?;
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let field = format!("point {index} of {count}");
        bytes.skip(1, 8, &field)?;
        let position = Vector3::from(bytes.f64s(&field)?);
        bytes.skip(1, 3 + 8, &field)?;
        let declared = bytes.u64(&field)?;
        let length = bytes.count(declared, 8, &format!("{field}: its track"))?;
        let mut images = Vec::with_capacity(length);
        for _ in 0..length {
            images.push(bytes.u32(&field)?);
            bytes.u32(&field)?;
        }
        points.push(Point { position, images });
    }
    bytes.end("number of points")?;
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::fixture;
    use proptest::prelude::*;

    fn file(name: &str) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        fixture::sparse_binary(folder.path(), 1, &fixture::CAMERA);
        std::fs::read(folder.path().join("sparse").join(name)).unwrap()
    }

    fn parses(name: &str, data: &[u8]) -> bool {
        let file = Path::new(name);
        match name {
            "cameras.bin" => cameras(data, file).is_ok(),
            "images.bin" => images(data, file).is_ok(),
            _ => points(data, file).is_ok(),
        }
    }

    #[test]
    fn every_truncation_is_an_error() {
        for name in ["cameras.bin", "images.bin", "points3D.bin"] {
            let data = file(name);
            assert!(parses(name, &data));
            for length in 0..data.len() {
                assert!(!parses(name, &data[..length]), "{name}, {length} bytes");
            }
        }
    }

    proptest! {
        #[test]
        fn damaged_bytes_never_panic(which in 0..3usize, at in any::<prop::sample::Index>(), word: u64) {
            let name = ["cameras.bin", "images.bin", "points3D.bin"][which];
            let mut data = file(name);
            let at = at.index(data.len());
            for (byte, new) in data[at..].iter_mut().zip(word.to_le_bytes()) {
                *byte = new;
            }
            parses(name, &data);
        }
    }
}
