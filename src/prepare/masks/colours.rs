//! Masks without a network: GrabCut from a box, its colours carried from frame to frame.
//!
//! The box is given, or found where something moves before a background that stays.

use super::{ObjectBox, cleaned, picture};
use crate::bridge::vision::ffi::{self, Colours, Picture};
use crate::image::{Grid, Mask};
use crate::prepare::{Photo, PrepareError};

/// Labels of GrabCut.
pub(super) const BACKGROUND: u8 = 0;
pub(super) const OBJECT: u8 = 1;
pub(super) const MAYBE_BACKGROUND: u8 = 2;
pub(super) const MAYBE_OBJECT: u8 = 3;
/// GrabCut works on pictures no longer than this, in pixels.
const WORKING_PX: usize = 480;
/// Grey levels by which a still background may flicker (standard deviation over time).
const FLICKER: f32 = 7.0;
/// Share of the border that must stand still for the background to be still.
const STILL: f64 = 0.7;
const ITERATIONS: usize = 4;

/// What GrabCut starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The object lies within the given box.
    Box,
    /// Where something moves before a still background.
    Motion,
    /// About the middle of the picture: nothing better was known.
    Middle,
}

impl Source {
    pub fn words(self) -> &'static str {
        match self {
            Self::Box => "GrabCut in the given box",
            Self::Motion => "GrabCut where something moves before a still background",
            Self::Middle => "GrabCut about the middle: give --box if the object is elsewhere",
        }
    }
}

/// A mask for every photo, empty where nothing was found.
///
/// # Errors
/// A box without pixels, or OpenCV's own.
pub fn masks(
    photos: &[Photo],
    object_box: Option<&ObjectBox>,
    watch: &dyn Fn(usize) -> bool,
) -> Result<(Vec<Mask>, Source), PrepareError> {
    let pictures: Vec<Picture> = photos
        .iter()
        .map(|photo| working(picture(&photo.image)))
        .collect::<Result<_, cxx::Exception>>()?;
    let Some((first, photo)) = pictures.first().zip(photos.first()) else {
        return Ok((Vec::new(), Source::Middle));
    };
    let (width, height) = (first.width, first.height);
    let scale = width as f64 / photo.image.width() as f64;
    let moving = moving(&pictures)?;
    let (region, source) = region(photo, (width, height), object_box, moving);
    if region.share() == 0.0 || region.share() == 1.0 {
        return Err(ObjectBox::error("no pixel is inside it, or none outside"));
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
    let still = source == Source::Motion;
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
            if !watch(pictures.len()) {
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
        .flatten()
        .map(|mask| {
            Grid::from_fn(full.0, full.1, |column, row| {
                let at = |x: usize| ((x as f64 + 0.5) * scale) as usize;
                mask[(at(column).min(width - 1), at(row).min(height - 1))]
            })
        })
        .collect();
    Ok((masks, source))
}

/// Where the object may be in the middle picture, at the size at which GrabCut works, and how that is known.
fn region(
    photo: &Photo,
    (width, height): (usize, usize),
    object_box: Option<&ObjectBox>,
    moving: Option<Mask>,
) -> (Mask, Source) {
    let scale = width as f64 / photo.image.width() as f64;
    match (object_box, moving) {
        (Some(given), _) => {
            let given = given.in_image(photo);
            let of_image = |x: usize| (x as f64 + 0.5) / scale;
            let inside = |column: usize, row: usize| given.contains(of_image(column), of_image(row));
            (Grid::from_fn(width, height, inside), Source::Box)
        }
        (None, Some(moving)) => (moving, Source::Motion),
        (None, None) => {
            let inside = |column: usize, row: usize| {
                let (x, y) = (
                    column as f64 / width as f64 - 0.5,
                    row as f64 / height as f64 - 0.5,
                );
                x.abs() < 0.42 && y.abs() < 0.42
            };
            (Grid::from_fn(width, height, inside), Source::Middle)
        }
    }
}

/// At the size at which GrabCut works.
pub(super) fn working(whole: Picture) -> Result<Picture, cxx::Exception> {
    let longest = whole.width.max(whole.height);
    if longest <= WORKING_PX {
        return Ok(whole);
    }
    let scaled = |side: usize| (side * WORKING_PX / longest).max(1);
    ffi::resized(&whole, scaled(whole.width), scaled(whole.height))
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

/// The object by GrabCut from labels, cleaned.
pub(super) fn cut(
    picture: &Picture,
    mut labels: Vec<u8>,
    colours: &mut Colours,
    learn: bool,
) -> Result<Mask, cxx::Exception> {
    let (width, height) = (picture.width, picture.height);
    ffi::grab_cut(picture, &mut labels, colours, learn, ITERATIONS)?;
    cleaned(labels.iter().map(|label| label % 2).collect(), width, height, 2)
}
