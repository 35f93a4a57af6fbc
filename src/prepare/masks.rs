//! Masks without a network: GrabCut from a box, its colours carried from frame to frame.
//!
//! The box is given, or found where something moves before a background that stays.

use super::{Photo, PrepareError};
use crate::bridge::vision::ffi::{self, Colours, Picture};
use crate::image::{Grid, Mask};
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

/// What can be chosen.
#[derive(Clone, Debug, Default)]
pub struct MaskOptions {
    /// Around the object in the middle frame.
    pub object_box: Option<ObjectBox>,
}

/// Where masks come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskSource {
    /// Files.
    Given,
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
            Self::Box => "GrabCut in the given box",
            Self::Motion => "GrabCut where something moves before a still background",
            Self::Middle => "GrabCut about the middle: give --box if the object is elsewhere",
        }
    }
}

/// Labels of GrabCut.
const BACKGROUND: u8 = 0;
const MAYBE_BACKGROUND: u8 = 2;
const MAYBE_OBJECT: u8 = 3;
/// GrabCut works on pictures no longer than this, in pixels.
const WORKING_PX: usize = 480;
/// Grey levels by which a still background may flicker (standard deviation over time).
const FLICKER: f32 = 7.0;
/// Share of the border that must stand still for the background to be still.
const STILL: f64 = 0.7;
const ITERATIONS: usize = 4;

/// A mask for every photo.
///
/// # Errors
/// A frame without object, or OpenCV's own.
pub fn masks(
    photos: &[Photo],
    options: &MaskOptions,
    watch: &dyn Fn() -> bool,
) -> Result<(Vec<Mask>, MaskSource), PrepareError> {
    let pictures: Vec<Picture> = photos
        .iter()
        .map(working)
        .collect::<Result<_, cxx::Exception>>()?;
    let Some((first, photo)) = pictures.first().zip(photos.first()) else {
        return Ok((Vec::new(), MaskSource::Middle));
    };
    let (width, height) = (first.width, first.height);
    let scale = width as f64 / photo.image.width() as f64;
    let moving = moving(&pictures)?;
    let (region, source) = match (&options.object_box, &moving) {
        (Some(given), _) => {
            let inside = |column: usize, row: usize| {
                let of_original = |x: usize| (x as f64 + 0.5) / (scale * photo.scale);
                let (x, y) = (of_original(column), of_original(row));
                x > given.left
                    && x < given.left + given.width
                    && y > given.top
                    && y < given.top + given.height
            };
            (Grid::from_fn(width, height, inside), MaskSource::Box)
        }
        (None, Some(moving)) => (moving.clone(), MaskSource::Motion),
        (None, None) => {
            let inside = |column: usize, row: usize| {
                let (x, y) = (
                    column as f64 / width as f64 - 0.5,
                    row as f64 / height as f64 - 0.5,
                );
                x.abs() < 0.42 && y.abs() < 0.42
            };
            (Grid::from_fn(width, height, inside), MaskSource::Middle)
        }
    };
    if region.share() == 0.0 || region.share() == 1.0 {
        return Err(PrepareError::Option {
            option: "--box",
            problem: "no pixel is inside it, or none outside".into(),
            mend: "give left,top,width,height in pixels, with some background about the object",
        });
    }
    // From the middle, where the box is, both ways.
    let middle = pictures.len() / 2;
    let mut masks: Vec<Option<Mask>> = vec![None; pictures.len()];
    let mut colours = Colours::default();
    let labels: Vec<u8> = region
        .data()
        .iter()
        .map(|&inside| if inside { MAYBE_OBJECT } else { BACKGROUND })
        .collect();
    let still = source == MaskSource::Motion;
    masks[middle] = Some(cut(&pictures[middle], labels, &mut colours, true)?);
    let learned = colours.clone();
    for backwards in [false, true] {
        colours.clone_from(&learned);
        let frames: Vec<usize> = if backwards {
            (0..middle).rev().collect()
        } else {
            (middle + 1..pictures.len()).collect()
        };
        for frame in frames {
            if !watch() {
                return Err(PrepareError::Interrupted);
            }
            let before = if backwards { frame + 1 } else { frame - 1 };
            let labels = match (&masks[before], still) {
                (Some(before), false) => around(before)?,
                _ => region
                    .data()
                    .iter()
                    .map(|&inside| if inside { MAYBE_OBJECT } else { BACKGROUND })
                    .collect(),
            };
            masks[frame] = Some(cut(&pictures[frame], labels, &mut colours, false)?);
        }
    }
    let full = photo.image.size();
    let masks = masks
        .into_iter()
        .zip(photos)
        .map(|(mask, photo)| {
            let empty = || PrepareError::NoObject {
                frame: photo.name.clone(),
            };
            let mask = mask.ok_or_else(empty)?;
            if mask.share() == 0.0 {
                return Err(empty());
            }
            Ok(Grid::from_fn(full.0, full.1, |column, row| {
                let at = |x: usize| ((x as f64 + 0.5) * scale) as usize;
                mask[(at(column).min(width - 1), at(row).min(height - 1))]
            }))
        })
        .collect::<Result<_, PrepareError>>()?;
    Ok((masks, source))
}

fn working(photo: &Photo) -> Result<Picture, cxx::Exception> {
    let (width, height) = photo.image.size();
    let whole = Picture {
        width,
        height,
        rgb: photo
            .image
            .data()
            .iter()
            .flatten()
            .map(|value| value.round().clamp(0.0, 255.0) as u8)
            .collect(),
        seconds: 0.0,
    };
    let longest = width.max(height);
    if longest <= WORKING_PX {
        return Ok(whole);
    }
    let scaled = |side: usize| (side * WORKING_PX / longest).max(1);
    ffi::resized(&whole, scaled(width), scaled(height))
}

/// Where something moves, if the border of the pictures shows that the background does not.
fn moving(pictures: &[Picture]) -> Result<Option<Mask>, PrepareError> {
    let Some(first) = pictures.first().filter(|_| pictures.len() > 2) else {
        return Ok(None);
    };
    let (width, height) = (first.width, first.height);
    let count = pictures.len() as f32;
    let spread = |i: usize| {
        (0..3)
            .map(|channel| {
                let values = pictures
                    .iter()
                    .map(|picture| f32::from(picture.rgb[3 * i + channel]));
                let mean = values.clone().sum::<f32>() / count;
                (values.map(|value| (value - mean).powi(2)).sum::<f32>() / count).sqrt()
            })
            .fold(0.0, f32::max)
    };
    let spreads = Grid::from_fn(width, height, |column, row| spread(row * width + column));
    let rim = (width.min(height) / 20).max(1);
    let at_rim =
        |column: usize, row: usize| column < rim || row < rim || column + rim >= width || row + rim >= height;
    let (mut still, mut all) = (0, 0);
    for row in 0..height {
        for column in (0..width).filter(|&column| at_rim(column, row)) {
            all += 1;
            still += usize::from(spreads[(column, row)] < FLICKER);
        }
    }
    if (still as f64) < STILL * f64::from(all) {
        return Ok(None);
    }
    let mut moves: Vec<u8> = spreads
        .data()
        .iter()
        .map(|&s| u8::from(s > 2.0 * FLICKER))
        .collect();
    // What moves has gaps where it is of one colour.
    let gap = (width.max(height) / 60).max(1) as i32;
    ffi::grow(&mut moves, width, height, gap)?;
    ffi::clean(&mut moves, width, height, 1)?;
    ffi::grow(&mut moves, width, height, -gap)?;
    ffi::clean(&mut moves, width, height, gap as usize)?;
    ffi::grow(&mut moves, width, height, gap)?;
    let moves = Grid::from_fn(width, height, |column, row| moves[row * width + column] != 0);
    Ok((moves.share() > 0.01).then_some(moves))
}

/// Labels for a frame after, or before, one whose mask is known.
fn around(mask: &Mask) -> Result<Vec<u8>, cxx::Exception> {
    let (width, height) = mask.size();
    let near: Vec<u8> = mask.data().iter().map(|&inside| u8::from(inside)).collect();
    let reach = (width.max(height) / 16) as i32;
    let mut wide = near.clone();
    ffi::grow(&mut wide, width, height, reach)?;
    Ok(near
        .iter()
        .zip(wide)
        .map(|pair| match pair {
            (1, _) => MAYBE_OBJECT,
            (_, 1) => MAYBE_BACKGROUND,
            _ => BACKGROUND,
        })
        .collect())
}

fn cut(
    picture: &Picture,
    mut labels: Vec<u8>,
    colours: &mut Colours,
    learn: bool,
) -> Result<Mask, cxx::Exception> {
    let (width, height) = (picture.width, picture.height);
    ffi::grab_cut(picture, &mut labels, colours, learn, ITERATIONS)?;
    let mut mask: Vec<u8> = labels.iter().map(|label| label % 2).collect();
    ffi::clean(&mut mask, width, height, 2)?;
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
