//! openMVS's `depth*.dmap`: a 28-byte header, names, ids, the camera, then f32 z row-major (0 = invalid) and, as
//! flagged, normals, confidences and views.

use crate::geometry::{Pinhole, Pose};
use crate::image::{DepthMap, Grid};
use crate::sequence::SequenceError;
use crate::sequence::bytes::Bytes;
use crate::sequence::validate::{check_pinhole, check_pose};
use nalgebra::Vector3;
use std::path::Path;

/// A depth map with its camera, as openMVS holds them: pixel centres are integers.
#[derive(Debug)]
pub(in crate::sequence) struct OpenMvsDepth {
    pub image_name: String,
    /// (width, height) of the image that `camera` belongs to.
    pub image_size: (usize, usize),
    /// May be smaller than the image.
    pub depth: DepthMap,
    pub camera: Pinhole,
    pub camera_from_world: Pose,
}

const DEPTH: u8 = 1;
/// Flag and bytes per pixel of what follows the depth: normal, confidence, views.
const EXTRAS: [(u8, usize); 3] = [(2, 12), (4, 4), (8, 4)];

pub(in crate::sequence) fn read(file: &Path) -> Result<OpenMvsDepth, SequenceError> {
    let data = std::fs::read(file).map_err(|source| SequenceError::read(file, source))?;
    decode(&data, file)
}

pub(super) fn decode(data: &[u8], file: &Path) -> Result<OpenMvsDepth, SequenceError> {
    let again = "run DensifyPointCloud again";
    let mut bytes = Bytes::new(file, data);
    if bytes.take(2, "magic number")? != b"DR" {
        return Err(SequenceError::invalid(
            file,
            "magic number",
            "not an openMVS depth map",
            again,
        ));
    }
    let flags = bytes.u8("flags")?;
    if flags & DEPTH == 0 {
        return Err(SequenceError::invalid(file, "flags", "it holds no depth", again));
    }
    bytes.u8("padding")?;
    let image_size = (
        bytes.u32("image width")? as usize,
        bytes.u32("image height")? as usize,
    );
    let (width, height) = (bytes.u32("depth width")?, bytes.u32("depth height")?);
    bytes.skip(2, 4, "depth range")?;
    let name_length = bytes.u16("image name")?;
    let image_name = bytes.string(u64::from(name_length), "image name")?;
    let ids = bytes.u32("image ids")?;
    bytes.skip(u64::from(ids), 4, "image ids")?;
    let [fx, _, cx, _, fy, cy, _, _, _] = bytes.f64s("K")?;
    let rotation: [f64; 9] = bytes.f64s("R")?;
    let center = Vector3::from(bytes.f64s("C")?);
    let pixels = u64::from(width) * u64::from(height);
    let z = bytes.f32s(pixels, "depth")?;
    for (flag, size) in EXTRAS {
        if flags & flag != 0 {
            bytes.skip(pixels, size, "normal, confidence and views")?;
        }
    }
    bytes.end("size")?;

    let camera = Pinhole { fx, fy, cx, cy };
    if let Some(problem) = check_pinhole(&camera, file, "K").into_iter().next() {
        return Err(problem);
    }
    let [a, b, c, d, e, f, g, h, i] = rotation;
    let turn = check_pose(&[[a, b, c], [d, e, f], [g, h, i]], &center.into(), file, "R, C")?;
    let depth = Grid::from_vec(width as usize, height as usize, z)
        .filter(|depth| !depth.data().is_empty())
        .ok_or_else(|| SequenceError::invalid(file, "depth size", format!("{width} × {height}"), again))?;
    Ok(OpenMvsDepth {
        image_name,
        image_size,
        depth,
        camera,
        // x_cam = R (X − C).
        camera_from_world: Pose {
            rotation: turn.rotation,
            translation: -(turn.rotation * center),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rotation3;
    use crate::sequence::fixture;
    use proptest::prelude::*;

    fn sample() -> Vec<u8> {
        let rotation = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
        let rows = rotation.matrix().transpose();
        let map = fixture::Dmap {
            image: "images/a.png".into(),
            image_size: (6, 4),
            depth_size: (3, 2),
            camera: [40.0, 41.0, 2.5, 1.5],
            rotation: rows.as_slice().try_into().unwrap(),
            center: [1.0, 2.0, 3.0],
            z: vec![1.0, 2.0, 0.0, 4.0, 5.0, 6.0],
        };
        map.encode()
    }

    #[test]
    fn header_camera_and_depth_are_read() {
        let map = decode(&sample(), Path::new("d.dmap")).unwrap();
        assert_eq!(
            (map.image_name.as_str(), map.image_size),
            ("images/a.png", (6, 4))
        );
        assert_eq!(
            map.camera,
            Pinhole {
                fx: 40.0,
                fy: 41.0,
                cx: 2.5,
                cy: 1.5
            }
        );
        assert_eq!(map.depth[(0, 1)], 4.0);
        assert!((map.camera_from_world.center() - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        let expected = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
        assert!((map.camera_from_world.rotation.matrix() - expected.matrix()).norm() < 1e-12);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = sample();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length], Path::new("d.dmap")).is_err(), "{length}");
        }
        assert!(decode(&[&bytes[..], &[0]].concat(), Path::new("d.dmap")).is_err());
    }

    proptest! {
        #[test]
        fn damaged_bytes_never_panic(at in any::<prop::sample::Index>(), word: u64) {
            let mut bytes = sample();
            let at = at.index(bytes.len());
            for (byte, new) in bytes[at..].iter_mut().zip(word.to_le_bytes()) {
                *byte = new;
            }
            let _ = decode(&bytes, Path::new("d.dmap"));
        }
    }
}
