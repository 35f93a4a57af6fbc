//! The object in every frame: from files, by networks, or without any by its colours.

mod boxes;
mod by_shape;
mod colours;
mod follow;
mod given;
mod network;
mod networks;
#[cfg(test)]
mod tiny;

pub use by_shape::masks_by_shape;
pub use network::NetworkError;
pub use networks::descriptions;

use super::cache::{Cache, Key};
use super::{Photo, PrepareError};
use crate::bridge::vision::ffi::{self, Picture};
use crate::image::{Grid, Mask};
use networks::Networks;
use std::path::PathBuf;
use std::str::FromStr;

/// A box in pixels of the original pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectBox {
    /// The column of the left edge.
    pub left: f64,
    /// The row of the upper edge.
    pub top: f64,
    /// The box's width.
    pub width: f64,
    /// The box's height.
    pub height: f64,
}

impl FromStr for ObjectBox {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|part| part.trim().parse().ok())
            .collect();
        match numbers[..] {
            [left, top, width, height]
                if text.split(',').count() == 4
                    && numbers.iter().all(|x| x.is_finite())
                    && width > 0.0
                    && height > 0.0 =>
            {
                Ok(Self {
                    left,
                    top,
                    width,
                    height,
                })
            }
            _ => Err("give four numbers: left,top,width,height in pixels"),
        }
    }
}

impl ObjectBox {
    /// This box in pixels of a photo's image, which may be scaled down.
    fn in_image(&self, photo: &Photo) -> Self {
        Self {
            left: self.left * photo.scale,
            top: self.top * photo.scale,
            width: self.width * photo.scale,
            height: self.height * photo.scale,
        }
    }

    fn contains(&self, x: f64, y: f64) -> bool {
        x > self.left && x < self.left + self.width && y > self.top && y < self.top + self.height
    }

    fn error(problem: &str) -> PrepareError {
        PrepareError::Option {
            option: "--box",
            problem: problem.into(),
            mend: "give left,top,width,height in pixels, with some background about the object",
        }
    }
}

/// Where the masks come from.
#[derive(Clone, Debug, Default)]
pub struct MaskOptions {
    /// Folder of masks (white = object), named like the pictures; nothing else counts then.
    pub given: Option<PathBuf>,
    /// Around the object in the middle frame.
    pub object_box: Option<ObjectBox>,
    /// Folder of ONNX networks, each beside a TOML file of the same name that describes it.
    pub networks: Option<PathBuf>,
    /// What the object is, for networks that know classes; anything that stands out, if `None`.
    pub category: Option<String>,
}

/// Masks, and how they were made.
pub struct Found {
    /// The mask of every photo; `None` where there is no object.
    pub masks: Vec<Option<Mask>>,
    /// How the masks were made, in words.
    pub words: String,
}

/// A mask for every photo in which there is an object. `key` stands for the photos.
///
/// # Errors
/// Masks or networks that cannot be read, a box without pixels, or OpenCV's own.
pub fn masks(
    photos: &[Photo],
    options: &MaskOptions,
    cache: &Cache,
    key: Key,
    watch: &dyn Fn(usize) -> bool,
) -> Result<Found, PrepareError> {
    let (masks, words) = if let Some(folder) = &options.given {
        given::given(folder, photos)?
    } else if let Some(folder) = &options.networks {
        let networks = Networks::read(folder, options.category.as_deref())?;
        let found = cache.get_or("masks", key.and(options).and(&networks.key()), || {
            follow::masks(
                photos,
                &networks,
                options.object_box.as_ref(),
                cache,
                key.and(&options.category),
                watch,
            )
        })?;
        (found.masks, found.words)
    } else {
        cache.get_or("masks", key.and(options), || {
            let (masks, source) = colours::masks(photos, options.object_box.as_ref(), watch)?;
            Ok::<_, PrepareError>((masks, source.words().to_owned()))
        })?
    };
    let masks = masks
        .into_iter()
        .map(|mask| (mask.share() > 0.0 && mask.covers_all().is_none()).then_some(mask))
        .collect();
    Ok(Found { masks, words })
}

fn picture(image: &crate::image::RgbImage) -> Picture {
    Picture {
        width: image.width(),
        height: image.height(),
        rgb: image
            .data()
            .iter()
            .flatten()
            .map(|value| value.round().clamp(0.0, 255.0) as u8)
            .collect(),
        seconds: 0.0,
    }
}

/// A mask of bytes (0, 1): the largest part wider than `radius` pixels, its holes closed.
fn cleaned(mut mask: Vec<u8>, width: usize, height: usize, radius: usize) -> Result<Mask, cxx::Exception> {
    ffi::clean(&mut mask, width, height, radius)?;
    Ok(Grid::from_fn(width, height, |column, row| {
        mask[row * width + column] != 0
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_four_numbers() {
        let parsed: ObjectBox = "10, 20.5,30,40".parse().unwrap();
        assert_eq!(
            (parsed.left, parsed.top, parsed.width, parsed.height),
            (10.0, 20.5, 30.0, 40.0)
        );
        for wrong in ["", "1,2,3", "1,2,3,4,5", "1,2,0,4", "1,2,x,4", "nan,1,2,3"] {
            assert!(wrong.parse::<ObjectBox>().is_err(), "{wrong}");
        }
    }
}
