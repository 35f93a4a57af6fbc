//! Rasters: colour images, masks and depth maps, their files, pyramids and measures.

mod blur;
mod depth;
mod distance;
mod error;
#[cfg(any(feature = "vision", fuzzing))]
pub(crate) mod exif_data;
mod files;
mod grid;
mod mask;
mod mask_file;
mod names;
mod picture;
mod pyramid;
mod remap;

pub use blur::blur;
pub use depth::{read_depth, write_depth};
pub(crate) use depth::{read_deviation, write_deviation};
pub(crate) use distance::NearestPixel;
pub use error::ImageError;
pub use files::{read_rgb, read_rgb_covering, write_mask, write_rgb};
pub use grid::{DepthMap, Grid, Mask, RgbImage};
pub use mask_file::read_mask;
pub use names::mask_of;
pub use picture::Turn;
#[cfg(feature = "vision")]
pub(crate) use pyramid::halve_image;
pub use pyramid::pyramid;
pub(crate) use pyramid::{halve_depth, halve_mask};

pub(crate) use files::{one_line, rgb};
pub(crate) use mask_file::mask_of_pixels;
pub(crate) use names::{Pictures, natural_key};
#[cfg(feature = "vision")]
pub(crate) use picture::colours;
#[cfg(test)]
pub(crate) use picture::exif_jpeg;
pub(crate) use picture::{PictureFile, dimensions};
pub(crate) use remap::PixelMap;

/// Reads a picture's bytes, as it is and as a mask, and what it says of its camera: for the targets in `fuzz/`. Pictures of more than
/// 512 × 512 pixels are left out, as they cost but time.
#[cfg(fuzzing)]
pub fn fuzz(data: &[u8]) {
    if let Some(exif) = exif_data::read(data) {
        let _ = (exif_data::focal_px(&exif, 4000, 3000), exif_data::seconds(&exif));
    }
    let reader = image::ImageReader::new(std::io::Cursor::new(data)).with_guessed_format();
    let size = reader.ok().and_then(|reader| reader.into_dimensions().ok());
    if size.is_some_and(|(width, height)| u64::from(width) * u64::from(height) > 1 << 18) {
        return;
    }
    if let Ok(picture) = PictureFile::decode(data) {
        let upright = picture.upright();
        let _ = rgb(upright.clone());
        let _ = mask_of_pixels(upright, std::path::Path::new("a.png"));
    }
}
