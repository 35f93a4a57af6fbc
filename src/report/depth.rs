//! Depth maps as OpenEXR: one 32-bit float channel "Z", object units, 0 = unknown.

use super::ReportError;
use crate::image::{DepthMap, Grid};
use exr::prelude::{
    Encoding, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, ReadSpecificChannel, SpecificChannels,
    Vec2, WritableImage, read,
};
use std::path::Path;

pub(super) fn write_depth(path: &Path, depth: &DepthMap) -> Result<(), ReportError> {
    let mut attributes = LayerAttributes::named("");
    attributes.comments =
        Some("z in the camera frame, object units (bounding-box diagonal 1); 0 = unknown".into());
    let channels = SpecificChannels::build()
        .with_channel::<f32>("Z")
        .with_pixel_fn(|at: Vec2<usize>| (depth[(at.x(), at.y())],));
    let layer = Layer::new(depth.size(), attributes, Encoding::SMALL_LOSSLESS, channels);
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_file(path)
        .map_err(|error| ReportError::format(path, error))
}

/// Reads the channel "Z" of an OpenEXR file.
pub fn read_depth(path: &Path) -> Result<DepthMap, ReportError> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Z")
        .collect_pixels(
            |size, _| Grid::filled(size.width(), size.height(), 0f32),
            |depth, at, (z,): (f32,)| depth[(at.x(), at.y())] = z,
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_file(path)
        .map_err(|error| ReportError::format(path, error))?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_survives_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let depth = Grid::from_fn(37, 21, |column, row| {
            if column > row {
                1.0 + column as f32 / 7.0
            } else {
                0.0
            }
        });
        write_depth(&path, &depth).unwrap();
        assert_eq!(read_depth(&path).unwrap(), depth);
    }

    #[test]
    fn a_missing_map_is_named() {
        let error = read_depth(Path::new("nowhere/a.exr")).unwrap_err().to_string();
        assert!(error.contains("a.exr"), "{error}");
    }
}
