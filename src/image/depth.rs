//! Depth maps, and how well they are known, as OpenEXR files of one f32 channel: `Z`, or `deviation`.

use super::files::one_line;
use super::{DepthMap, Grid, ImageError};
use exr::prelude::*;
use std::io::Cursor;
use std::path::Path as FilePath;

/// No lossless EXR compression packs more pixels into a byte; a header that claims more is broken.
const MAX_PIXELS_PER_BYTE: usize = 1024;

/// Reads the channel `Z` of an EXR file; values are returned as they stand.
pub fn read_depth(file: &FilePath) -> std::result::Result<DepthMap, ImageError> {
    read_channel(file, "Z")
}

/// Reads the channel `deviation` of an EXR file; values are returned as they stand.
pub fn read_deviation(file: &FilePath) -> std::result::Result<Grid<f32>, ImageError> {
    read_channel(file, "deviation")
}

/// Writes a depth map as a losslessly compressed EXR with the single f32 channel `Z`.
pub fn write_depth(depth: &DepthMap, file: &FilePath) -> std::result::Result<(), ImageError> {
    write_channel(depth, "Z", file)
}

/// Writes standard deviations of a depth as [`write_depth`] does depths, with the channel `deviation`.
pub fn write_deviation(deviation: &Grid<f32>, file: &FilePath) -> std::result::Result<(), ImageError> {
    write_channel(deviation, "deviation", file)
}

fn read_channel(file: &FilePath, name: &str) -> std::result::Result<Grid<f32>, ImageError> {
    let bytes = std::fs::read(file).map_err(|source| ImageError::read(file, source))?;
    decode(&bytes, name).map_err(|error| ImageError::Depth {
        file: file.to_owned(),
        reason: one_line(&error.to_string()),
    })
}

fn write_channel(grid: &Grid<f32>, name: &str, file: &FilePath) -> std::result::Result<(), ImageError> {
    let channel = AnyChannel::new(name, FlatSamples::F32(grid.data().to_vec()));
    let layer = Layer::new(
        grid.size(),
        LayerAttributes::default(),
        Encoding {
            compression: Compression::ZIP16,
            ..Encoding::FAST_LOSSLESS
        },
        AnyChannels::sort(SmallVec::from_iter([channel])),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(std::io::Error::other)
        .and_then(|()| std::fs::write(file, bytes.into_inner()))
        .map_err(|problem| ImageError::Write {
            file: file.to_owned(),
            problem,
        })
}

fn decode(bytes: &[u8], name: &str) -> exr::error::Result<Grid<f32>> {
    let chunks = exr::block::read(Cursor::new(bytes), false)?;
    for header in chunks.headers() {
        let Vec2(width, height) = header.layer_size;
        if width.saturating_mul(height) > bytes.len().saturating_mul(MAX_PIXELS_PER_BYTE) {
            let claim = format!(
                "its header says {width} × {height} pixels, but the file holds {} bytes",
                bytes.len()
            );
            return Err(Error::Invalid(claim.into()));
        }
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(name)
        .collect_pixels(
            |size, _| Grid::filled(size.width(), size.height(), 0f32),
            |grid: &mut Grid<f32>, at, (value,): (f32,)| grid[(at.x(), at.y())] = value,
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_chunks(chunks)?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> (tempfile::TempDir, DepthMap, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let depth = Grid::from_fn(7, 5, |c, r| c as f32 * 0.3 + r as f32 * 1e-7);
        let file = folder.path().join("depth.exr");
        write_depth(&depth, &file).unwrap();
        let bytes = std::fs::read(&file).unwrap();
        (folder, depth, bytes)
    }

    #[test]
    fn depth_survives_the_disk_bit_for_bit() {
        let (folder, depth, _) = sample();
        assert_eq!(read_depth(&folder.path().join("depth.exr")).unwrap(), depth);
    }

    #[test]
    fn a_depth_is_no_deviation() {
        let (folder, depth, _) = sample();
        assert!(read_deviation(&folder.path().join("depth.exr")).is_err());
        let file = folder.path().join("deviation.exr");
        write_deviation(&depth, &file).unwrap();
        assert_eq!(read_deviation(&file).unwrap(), depth);
    }

    #[test]
    fn the_same_depth_gives_the_same_bytes() {
        assert_eq!(sample().2, sample().2);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let (_folder, _, bytes) = sample();
        for length in 0..bytes.len() {
            assert!(
                decode(&bytes[..length], "Z").is_err(),
                "{length} of {}",
                bytes.len()
            );
        }
    }

    proptest! {
        #[test]
        fn damaged_bytes_never_panic(at in any::<prop::sample::Index>(), value: u8, tail in any::<u32>()) {
            let (_folder, _, mut bytes) = sample();
            let at = at.index(bytes.len());
            bytes[at] = value;
            let _ = decode(&bytes, "Z");
            for (byte, new) in bytes[at..].iter_mut().zip(tail.to_le_bytes()) {
                *byte = new;
            }
            let _ = decode(&bytes, "Z");
        }
    }
}
