//! COLMAP's dense depth, `stereo/depth_maps/<image>.geometric.bin`: ASCII `width&height&channels&`, then f32 z
//! row-major, ≤ 0 invalid.

use crate::image::{DepthMap, Grid};
use crate::sequence::SequenceError;
use crate::sequence::bytes::Bytes;
use std::path::Path;

pub(in crate::sequence) fn read(file: &Path) -> Result<DepthMap, SequenceError> {
    let data = std::fs::read(file).map_err(|source| SequenceError::read(file, source))?;
    decode(&data, file)
}

pub(super) fn decode(data: &[u8], file: &Path) -> Result<DepthMap, SequenceError> {
    let wrong = |problem: &str| {
        SequenceError::invalid(
            file,
            "header",
            problem,
            "expected `width&height&1&`; run COLMAP's stereo again",
        )
    };
    let mut bytes = Bytes::new(file, data);
    let mut sizes = [0u64; 3];
    for size in &mut sizes {
        let mut digits = String::new();
        loop {
            match bytes.u8("header")? {
                b'&' => break,
                digit if digit.is_ascii_digit() && digits.len() < 10 => digits.push(char::from(digit)),
                _ => return Err(wrong("not a COLMAP depth map")),
            }
        }
        *size = digits.parse().map_err(|_| wrong("not a COLMAP depth map"))?;
    }
    let [width, height, channels] = sizes;
    if channels != 1 || width == 0 || height == 0 {
        return Err(wrong(&format!("says {width} × {height} × {channels}")));
    }
    let z = bytes.f32s(width.saturating_mul(height), "depth")?;
    bytes.end("header")?;
    Grid::from_vec(width as usize, height as usize, z).ok_or_else(|| wrong("size and content differ"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encoded() -> Vec<u8> {
        let mut bytes = b"3&2&1&".to_vec();
        bytes.extend(
            [1.0f32, -1.0, 0.0, 2.5, 3.5, 4.5]
                .iter()
                .flat_map(|z| z.to_le_bytes()),
        );
        bytes
    }

    #[test]
    fn rows_come_first() {
        let depth = decode(&encoded(), Path::new("d.bin")).unwrap();
        assert_eq!(depth.size(), (3, 2));
        assert_eq!((depth[(0, 0)], depth[(1, 0)], depth[(0, 1)]), (1.0, -1.0, 2.5));
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = encoded();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length], Path::new("d.bin")).is_err(), "{length}");
        }
        assert!(decode(&[&bytes[..], &[0]].concat(), Path::new("d.bin")).is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(head in "[0-9&]{0,20}", tail in proptest::collection::vec(any::<u8>(), 0..64)) {
            let _ = decode(&[head.as_bytes(), &tail].concat(), Path::new("d.bin"));
        }
    }
}
