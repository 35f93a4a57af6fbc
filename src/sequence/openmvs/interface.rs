//! openMVS's interface format, `scene.mvs`: `MVSI`, u32 version ≤ 7, u32 reserved; strings and vectors carry their
//! length as u64. Only the image list is kept, but the whole file is walked, so that a truncated one is noticed.

use crate::sequence::SequenceError;
use crate::sequence::bytes::Bytes;
use std::path::Path;

/// What a `scene.mvs` says of its images.
#[derive(Debug, PartialEq)]
pub(super) struct Interface {
    pub version: u32,
    pub images: Vec<InterfaceImage>,
}

#[derive(Debug, PartialEq)]
pub(super) struct InterfaceImage {
    pub name: String,
    /// Whether it has a pose.
    pub calibrated: bool,
}

const NEWEST_VERSION: u32 = 7;
const NO_POSE: u32 = u32::MAX;

pub(super) fn read(file: &Path) -> Result<Interface, SequenceError> {
    let data = std::fs::read(file).map_err(|source| SequenceError::read(file, source))?;
    decode(&data, file)
}

pub(super) fn decode(data: &[u8], file: &Path) -> Result<Interface, SequenceError> {
    let mut bytes = Bytes::new(file, data);
    let export = "export the interface format (MVSI) with InterfaceCOLMAP";
    match bytes.take(4, "magic number")? {
        b"MVSI" => {}
        b"MVS\0" => return Err(SequenceError::OpenMvsArchive(file.to_owned())),
        _ => {
            return Err(SequenceError::invalid(
                file,
                "magic number",
                "not an openMVS file",
                export,
            ));
        }
    }
    let version = bytes.u32("version")?;
    if version > NEWEST_VERSION {
        let problem = format!("{version} is newer than {NEWEST_VERSION}");
        return Err(SequenceError::invalid(
            file,
            "version",
            problem,
            "export with openMVS 2.1 to 2.3",
        ));
    }
    bytes.u32("reserved word")?;
    for _ in 0..vector(&mut bytes, 8, "platforms")? {
        skip_platform(&mut bytes, version)?;
    }
    let mut images = Vec::new();
    for _ in 0..vector(&mut bytes, 8, "images")? {
        images.push(image(&mut bytes, version)?);
    }
    skip_geometry(&mut bytes, version)?;
    bytes.end("scene")?;
    Ok(Interface { version, images })
}

/// The length of a vector whose items have at least `item_bytes`.
fn vector(bytes: &mut Bytes, item_bytes: usize, field: &str) -> Result<usize, SequenceError> {
    let count = bytes.u64(field)?;
    bytes.count(count, item_bytes, field)
}

fn string(bytes: &mut Bytes, field: &str) -> Result<String, SequenceError> {
    let length = bytes.u64(field)?;
    bytes.string(length, field)
}

fn skip_vector(bytes: &mut Bytes, item_bytes: usize, field: &str) -> Result<(), SequenceError> {
    let count = bytes.u64(field)?;
    bytes.skip(count, item_bytes, field)
}

fn skip_platform(bytes: &mut Bytes, version: u32) -> Result<(), SequenceError> {
    string(bytes, "platform name")?;
    for _ in 0..vector(bytes, 8, "cameras")? {
        string(bytes, "camera name")?;
        if version > 3 {
            string(bytes, "camera band")?;
        }
        if version > 0 {
            bytes.skip(2, 4, "camera size")?;
        }
        bytes.skip(9 + 9 + 3, 8, "camera K, R, C")?;
    }
    skip_vector(bytes, (9 + 3) * 8, "platform poses")
}

fn image(bytes: &mut Bytes, version: u32) -> Result<InterfaceImage, SequenceError> {
    let name = string(bytes, "image name")?;
    if version > 4 {
        string(bytes, "image mask")?;
    }
    bytes.skip(2, 4, "image platform and camera")?;
    let pose = bytes.u32("image pose")?;
    if version > 2 {
        bytes.u32("image id")?;
    }
    if version > 6 {
        bytes.skip(3, 4, "image depth range")?;
        skip_vector(bytes, 2 * 4 + 4 * 4, "image view scores")?;
    }
    Ok(InterfaceImage {
        name,
        calibrated: pose != NO_POSE,
    })
}

fn skip_geometry(bytes: &mut Bytes, version: u32) -> Result<(), SequenceError> {
    const POINT: usize = 3 * 4;
    const VIEW: usize = 4 + 4;
    for _ in 0..vector(bytes, POINT + 8, "vertices")? {
        bytes.skip(1, POINT, "vertex")?;
        skip_vector(bytes, VIEW, "vertex views")?;
    }
    skip_vector(bytes, POINT, "vertex normals")?;
    skip_vector(bytes, 3, "vertex colours")?;
    if version > 0 {
        for _ in 0..vector(bytes, 2 * POINT + 8, "lines")? {
            bytes.skip(2, POINT, "line")?;
            skip_vector(bytes, VIEW, "line views")?;
        }
        skip_vector(bytes, POINT, "line normals")?;
        skip_vector(bytes, 3, "line colours")?;
    }
    if version > 1 {
        bytes.skip(16, 8, "transform")?;
    }
    if version > 5 {
        bytes.skip(15, 8, "bounding box")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::fixture;
    use proptest::prelude::*;

    #[test]
    fn every_version_lists_its_images() {
        for version in 0..=7 {
            let bytes = fixture::scene_mvs(
                version,
                &["images/a.png", "images/b.png"],
                &[40.0, 40.0, 16.0, 12.0],
                (32, 24),
            );
            let interface = decode(&bytes, Path::new("scene.mvs")).unwrap();
            assert_eq!(interface.version, version);
            assert_eq!(
                interface.images[1],
                InterfaceImage {
                    name: "images/b.png".into(),
                    calibrated: true
                }
            );
            for length in 0..bytes.len() {
                assert!(
                    decode(&bytes[..length], Path::new("scene.mvs")).is_err(),
                    "version {version}, {length} bytes"
                );
            }
        }
    }

    #[test]
    fn the_archive_is_refused_with_the_export_to_use() {
        let message = decode(b"MVS\0 and more", Path::new("scene.mvs"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("InterfaceCOLMAP"), "{message}");
    }

    proptest! {
        #[test]
        fn damaged_bytes_never_panic(at in any::<prop::sample::Index>(), word: u64) {
            let mut bytes = fixture::scene_mvs(7, &["images/a.png"], &[40.0, 40.0, 16.0, 12.0], (32, 24));
            let at = at.index(bytes.len());
            for (byte, new) in bytes[at..].iter_mut().zip(word.to_le_bytes()) {
                *byte = new;
            }
            let _ = decode(&bytes, Path::new("scene.mvs"));
        }
    }
}
