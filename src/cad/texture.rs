//! Texture images: PNG and JPEG through `image`, SGI by our own reader.

use super::{CadError, Texture, sgi};
use crate::image::{Grid, PictureFile};
use std::path::Path;

/// Decodes by content; `path` is for messages.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<Texture, CadError> {
    if bytes.starts_with(&sgi::MAGIC) {
        return sgi::decode(bytes).map_err(|problem| CadError::malformed(path, "SGI image", problem));
    }
    // As it lies: models' coordinates know nothing of EXIF.
    let decoded = PictureFile::decode(bytes)
        .map_err(|error| CadError::malformed(path, "texture", format!("{error}; give PNG, JPEG or SGI")))?
        .pixels;
    let has_alpha = decoded.color().has_alpha();
    let rgba = decoded.into_rgba8();
    let (width, height) = (rgba.width() as usize, rgba.height() as usize);
    Ok(from_rgba(
        width,
        height,
        rgba.pixels().map(|p| p.0).collect(),
        has_alpha,
    ))
}

/// From `width * height` RGBA bytes, top row first.
pub(super) fn from_rgba(width: usize, height: usize, rgba: Vec<[u8; 4]>, has_alpha: bool) -> Texture {
    Texture {
        image: Grid::from_fn(width, height, |column, row| {
            let [r, g, b, _] = rgba[row * width + column];
            [r, g, b].map(f32::from)
        }),
        alpha: has_alpha.then(|| rgba.iter().map(|p| f32::from(p[3]) / 255.0).collect()),
    }
}
