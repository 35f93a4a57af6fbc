//! The object in every frame: from files, from a network, or without one by its colours.

mod colours;
mod network;

pub use network::SegmenterError;

use super::cache::{Cache, Key};
use super::{Photo, PrepareError};
use crate::bridge::vision::ffi::{self, Picture};
use crate::image::{Grid, Mask, mask_of, read_mask};
use network::Segmenter;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A box in pixels of the original pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectBox {
    pub left: f64,
    pub top: f64,
    pub width: f64,
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
    /// In pixels of a photo's image.
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

/// What can be chosen.
#[derive(Clone, Debug, Default)]
pub struct MaskOptions {
    /// Folder of masks (white = object), named like the pictures; nothing else counts then.
    pub given: Option<PathBuf>,
    /// Around the object in the middle frame.
    pub object_box: Option<ObjectBox>,
    /// An ONNX network that finds objects, beside a TOML file of the same name that describes it.
    pub segmenter: Option<PathBuf>,
    /// What the object is, for networks that know classes.
    pub category: Option<String>,
}

/// Where masks come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MaskSource {
    /// Files.
    Given,
    /// A network.
    Network,
    /// GrabCut in the box that was given.
    Box,
    /// GrabCut where something moves before a still background.
    Motion,
    /// GrabCut about the middle of the picture: nothing better was known.
    Middle,
}

impl MaskSource {
    pub fn words(self) -> &'static str {
        match self {
            Self::Given => "from files",
            Self::Network => "from the network",
            Self::Box => "GrabCut in the given box",
            Self::Motion => "GrabCut where something moves before a still background",
            Self::Middle => "GrabCut about the middle: give --box if the object is elsewhere",
        }
    }
}

/// A mask for every photo in which there is an object. `key` stands for the photos.
///
/// # Errors
/// Masks or a network that cannot be read, a box without pixels, or OpenCV's own.
pub fn masks(
    photos: &[Photo],
    options: &MaskOptions,
    cache: &Cache,
    key: Key,
    watch: &dyn Fn(usize) -> bool,
) -> Result<(Vec<Option<Mask>>, MaskSource), PrepareError> {
    if let Some(folder) = &options.given {
        let masks = given(folder, photos)?;
        return Ok((masks.into_iter().map(filled).collect(), MaskSource::Given));
    }
    if let Some(path) = &options.segmenter {
        let segmenter = Segmenter::read(path, options.category.as_deref())?;
        let masks = segmented(photos, segmenter, options, cache, key, watch)?;
        return Ok((masks.into_iter().map(filled).collect(), MaskSource::Network));
    }
    cache.get_or("masks", key.and(options), || {
        let (masks, source) = colours::masks(photos, options.object_box.as_ref(), watch)?;
        Ok((masks.into_iter().map(filled).collect(), source))
    })
}

fn filled(mask: Mask) -> Option<Mask> {
    (mask.share() > 0.0).then_some(mask)
}

/// Around a box or a mask there must be so much more, as a share of its size, for a network to tell what it is.
const MARGIN: f64 = 0.35;

/// So many frames, itself and the nearest in which something was found, say where the object is in a frame.
const NEARBY: usize = 5;

/// A network sees most where the object fills its picture. With a box: from the middle frame, where it is, both ways, each frame cut
/// out around the mask before. Without one: whole frames first, then each cut out around what was found in it and its neighbours.
fn segmented(
    photos: &[Photo],
    mut segmenter: Segmenter,
    options: &MaskOptions,
    cache: &Cache,
    key: Key,
    watch: &dyn Fn(usize) -> bool,
) -> Result<Vec<Mask>, PrepareError> {
    let key = key.and(options).and(&segmenter.key());
    let passes = if options.object_box.is_some() { 1 } else { 2 };
    let steps = passes * photos.len();
    let mut mask = |frame: usize, around: Option<[f64; 4]>| {
        if !watch(steps) {
            return Err(PrepareError::Interrupted);
        }
        let image = &photos[frame].image;
        let (width, height) = image.size();
        let [left, top, right, bottom] =
            around.map_or([0, 0, width, height], |around| widened(around, width, height));
        if left >= right || top >= bottom {
            return Err(ObjectBox::error("no pixel is inside it"));
        }
        cache.get_or("mask", key.and(&(frame, left, top, right, bottom)), || {
            let part = Grid::from_fn(right - left, bottom - top, |column, row| {
                image[(left + column, top + row)]
            });
            let found = segmenter.mask(&picture(&part))?;
            Ok(Grid::from_fn(width, height, |column, row| {
                column >= left && row >= top && found.get(column - left, row - top) == Some(&true)
            }))
        })
    };
    let Some(object_box) = &options.object_box else {
        let whole: Vec<Option<[usize; 4]>> = (0..photos.len())
            .map(|frame| Ok(mask(frame, None)?.bounds()))
            .collect::<Result<_, PrepareError>>()?;
        let near = |frame: usize| {
            let mut boxes: Vec<(usize, [usize; 4])> = whole
                .iter()
                .enumerate()
                .filter_map(|(other, sides)| Some((other.abs_diff(frame), (*sides)?)))
                .collect();
            boxes.sort();
            boxes.truncate(NEARBY);
            median_box(&boxes.into_iter().map(|(_, sides)| sides).collect::<Vec<_>>())
        };
        return (0..photos.len())
            .map(|frame| match near(frame) {
                Some(around) => mask(frame, Some(around)),
                None => Ok(Grid::filled(1, 1, false)),
            })
            .collect();
    };
    let middle = photos.len() / 2;
    let given = object_box.in_image(&photos[middle]);
    let start = [
        given.left,
        given.top,
        given.left + given.width,
        given.top + given.height,
    ];
    let mut masks: Vec<Option<Mask>> = vec![None; photos.len()];
    for backwards in [true, false] {
        let mut around = start;
        let frames: Vec<usize> = match backwards {
            true => (0..=middle).rev().collect(),
            false => (middle..photos.len()).collect(),
        };
        for frame in frames {
            let found = mask(frame, Some(around))?;
            if let Some(bounds) = found.bounds() {
                around = bounds.map(|x| x as f64);
            }
            masks[frame] = Some(found);
        }
    }
    Ok(masks.into_iter().flatten().collect())
}

/// A box (left, top, right, bottom) and its margin, as columns and rows of the picture.
fn widened([left, top, right, bottom]: [f64; 4], width: usize, height: usize) -> [usize; 4] {
    let (across, down) = (MARGIN * (right - left), MARGIN * (bottom - top));
    let clamped = |x: f64, most: usize| x.clamp(0.0, most as f64) as usize;
    [
        clamped((left - across).floor(), width),
        clamped((top - down).floor(), height),
        clamped((right + across).ceil(), width),
        clamped((bottom + down).ceil(), height),
    ]
}

/// Of each side. `None` of none.
fn median_box(boxes: &[[usize; 4]]) -> Option<[f64; 4]> {
    if boxes.is_empty() {
        return None;
    }
    Some(std::array::from_fn(|side| {
        let mut places: Vec<usize> = boxes.iter().map(|sides| sides[side]).collect();
        places.sort_unstable();
        places[places.len() / 2] as f64
    }))
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

fn given(folder: &Path, photos: &[Photo]) -> Result<Vec<Mask>, PrepareError> {
    let mask = |photo: &Photo| {
        let mask = read_mask(&mask_of(folder, &photo.name)?)?;
        let (width, height) = photo.image.size();
        // Pictures may have been made smaller than their masks.
        let at = |x: usize, to: usize, from: usize| (x * from + from / 2) / to;
        Ok(Grid::from_fn(width, height, |column, row| {
            mask[(at(column, width, mask.width()), at(row, height, mask.height()))]
        }))
    };
    photos.iter().map(mask).collect()
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

    #[test]
    fn one_wrong_box_of_five_does_not_count() {
        let boxes = [
            [10, 20, 50, 60],
            [11, 20, 51, 60],
            [30, 40, 35, 44],
            [12, 21, 52, 61],
            [13, 21, 53, 61],
        ];
        assert_eq!(median_box(&boxes), Some([12.0, 21.0, 51.0, 60.0]));
        assert_eq!(median_box(&[]), None);
    }

    #[test]
    fn a_box_keeps_its_margin_within_the_picture() {
        assert_eq!(widened([40.0, 50.0, 60.0, 70.0], 100, 72), [33, 43, 67, 72]);
        assert_eq!(widened([200.0, 50.0, 210.0, 70.0], 100, 100)[..1], [100]);
    }
}
