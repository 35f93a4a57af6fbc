//! Masks by networks: the object's box in every frame, a look close up in every second one, what lies between carried by optical
//! flow, and a second opinion wherever frames disagree.

mod opinion;
#[cfg(test)]
mod tests;

use super::boxes::{Detected, Sides, Track, smoothed, tracks};
use super::colours::{self, BACKGROUND, MAYBE_BACKGROUND, MAYBE_OBJECT};
use super::networks::{LIKELY, Likelihood, Networks};
use super::{ObjectBox, cleaned, picture};
use crate::bridge::vision::ffi::{self, Colours, Picture};
use crate::image::{Grid, Mask};
use crate::prepare::cache::{Cache, Key};
use crate::prepare::{Photo, PrepareError};
use opinion::{Counts, Opinion};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// About a box there must be so much more, as a share of its size, for a saliency network to tell what stands out.
pub(super) const MARGIN: f64 = 0.35;
/// The class network sees most in a narrower part.
pub(super) const CLASS_MARGIN: f64 = 0.2;
/// The saliency network looks at every so many frames; at others where it must.
const STEP: usize = 2;
/// Masks that overlap less (intersection over union) do not agree.
const AGREEMENT: f64 = 0.9;
/// A mask whose own box overlaps the detected one less is not the object's.
const FIT: f64 = 0.65;
/// Beyond the detected box by a larger share of its size there is no object, unless the class network knows better.
pub(super) const LOOSE: f64 = 0.1;
/// Differences of a smaller share of the mask are not looked at.
const MIN_PART: f64 = 0.005;
/// Parts narrower than twice this share of the longer side of the picture are no parts.
const PART_RADIUS: f64 = 1.0 / 160.0;
/// The class network says of so many frames which of several tracks is the object's.
const CLASS_LOOKS: usize = 5;
/// An object detected in a smaller share of the frames was not found.
const MIN_DETECTED: f64 = 0.25;

/// What became of every frame.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Followed {
    /// Empty where there is no object.
    pub masks: Vec<Mask>,
    /// Counts and what to know, for people.
    pub words: String,
}

/// Photos, and the networks that look at them.
struct Segmenter<'a> {
    photos: &'a [Photo],
    networks: &'a Networks,
    cache: &'a Cache,
    /// A digest of the photos and the networks.
    key: Key,
}

/// Masks for photos of one object. `object_box` is about it in the middle frame, `key` stands for the photos and `watch` sees each of
/// the steps, twice as many as photos.
///
/// # Errors
/// Networks that do not run, a box without pixels, OpenCV's own, an interruption.
pub fn masks(
    photos: &[Photo],
    networks: &Networks,
    object_box: Option<&ObjectBox>,
    cache: &Cache,
    key: Key,
    watch: &dyn Fn(usize) -> bool,
) -> Result<Followed, PrepareError> {
    let segmenter = Segmenter {
        photos,
        networks,
        cache,
        key: key.and(&networks.key()),
    };
    let step = || match watch(2 * photos.len()) {
        true => Ok(()),
        false => Err(PrepareError::Interrupted),
    };
    let given = object_box
        .map(|given| segmenter.given(given))
        .transpose()?
        .map(|sides| (photos.len() / 2, sides));
    let keys = key_frames(photos.len());
    let detected = segmenter.tracked(given, &step)?;
    let by_class = detected.is_some();
    let boxes = match detected {
        Some(boxes) => Some(boxes),
        None => segmenter.salient(&keys, given, &step)?,
    };
    let Some(boxes) = boxes else {
        return Ok(Followed {
            masks: vec![Grid::filled(1, 1, false); photos.len()],
            words: "nothing stands out".into(),
        });
    };
    let mut looks = BTreeMap::new();
    for &frame in &keys {
        step()?;
        looks.insert(
            frame,
            segmenter.saliency(frame, boxes[frame].widened_in(&photos[frame], MARGIN))?,
        );
    }
    let opinion = Opinion {
        segmenter: &segmenter,
        boxes: &boxes,
        by_class,
    };
    let mut counts = Counts::default();
    let decided = opinion.keys(&keys, &mut looks, &mut counts)?;
    let masks = opinion.between(decided, &mut looks, &mut counts, &step)?;
    let mut words = format!(
        "{}, looked at {} of {}, {} decided anew",
        match (by_class, networks.know_category()) {
            (true, _) => "from networks that know the category",
            (false, true) => "from the saliency network alone, NOTHING OF THE CATEGORY WAS DETECTED",
            (false, false) => "from the saliency network alone",
        },
        looks.len(),
        photos.len(),
        counts.anew
    );
    if by_class {
        let unlike: Vec<&str> = masks
            .iter()
            .enumerate()
            .filter(|(frame, mask)| !fits(mask, &boxes[*frame]))
            .map(|(frame, _)| photos[frame].name.as_str())
            .collect();
        if !unlike.is_empty() {
            words += &format!(", IN DOUBT: unlike what was detected in {}", unlike.join(", "));
        }
    }
    Ok(Followed { masks, words })
}

/// Every second frame, and the last.
fn key_frames(count: usize) -> Vec<usize> {
    let last = count.checked_sub(1).filter(|last| last % STEP != 0);
    (0..count).step_by(STEP).chain(last).collect()
}

fn fits(mask: &Mask, sides: &Sides) -> bool {
    Sides::about(mask).is_some_and(|own| own.overlap(sides) >= FIT)
}

/// Intersection over union; two empty ones agree.
fn agreement(a: &Mask, b: &Mask) -> f64 {
    let pairs = || a.data().iter().zip(b.data());
    let both = pairs().filter(|(a, b)| **a && **b).count();
    let any = pairs().filter(|(a, b)| **a || **b).count();
    if any > 0 { both as f64 / any as f64 } else { 1.0 }
}

pub(super) fn mask_of(likelihood: &Likelihood) -> Result<Mask, cxx::Exception> {
    let (width, height) = likelihood.size();
    let likely = likelihood.data().iter().map(|&x| u8::from(x > LIKELY)).collect();
    cleaned(likely, width, height, 1)
}

fn certain(mask: &Mask) -> Likelihood {
    let (width, height) = mask.size();
    Grid::from_fn(width, height, |column, row| 255 * u8::from(mask[(column, row)]))
}

/// Weighted means of likelihoods of one size.
fn mean(likelihoods: &[(f64, Likelihood)]) -> Option<Likelihood> {
    let (width, height) = likelihoods.first()?.1.size();
    let all: f64 = likelihoods.iter().map(|(weight, _)| weight).sum();
    Some(Grid::from_fn(width, height, |column, row| {
        let sum: f64 = likelihoods
            .iter()
            .map(|(weight, likelihood)| weight * f64::from(likelihood[(column, row)]))
            .sum();
        (sum / all).round() as u8
    }))
}

/// `own`, with each part in which `other` differs decided by how likely it is of the class.
pub(super) fn settled(own: &Mask, other: &Mask, class: &Likelihood) -> Result<Mask, cxx::Exception> {
    let (width, height) = own.size();
    let differ: Vec<u8> = own
        .data()
        .iter()
        .zip(other.data())
        .map(|(own, other)| u8::from(own != other))
        .collect();
    let radius = (PART_RADIUS * width.max(height) as f64).round().max(1.0) as usize;
    let parts = ffi::parts(&differ, width, height, radius)?;
    let count = parts.iter().max().map_or(0, |&most| usize::from(most) + 1);
    let (mut pixels, mut likely) = (vec![0usize; count], vec![0usize; count]);
    for (&part, &class) in parts.iter().zip(class.data()) {
        pixels[usize::from(part)] += 1;
        likely[usize::from(part)] += usize::from(class);
    }
    let inside = own.data().iter().filter(|&&inside| inside).count();
    let least = MIN_PART * inside as f64;
    let mask = own.data().iter().zip(&parts).map(|(&own, &part)| {
        let part = usize::from(part);
        if part == 0 || (pixels[part] as f64) < least {
            u8::from(own)
        } else {
            u8::from(likely[part] > usize::from(LIKELY) * pixels[part])
        }
    });
    cleaned(mask.collect(), width, height, 1)
}

impl Sides {
    fn widened_in(&self, photo: &Photo, margin: f64) -> [usize; 4] {
        self.widened(margin, photo.image.width(), photo.image.height())
    }
}

impl Segmenter<'_> {
    /// Columns and rows from left, top to right, bottom.
    fn part(&self, frame: usize, [left, top, right, bottom]: [usize; 4]) -> Result<Picture, PrepareError> {
        if left >= right || top >= bottom {
            return Err(ObjectBox::error("no pixel is inside it"));
        }
        let image = &self.photos[frame].image;
        Ok(picture(&Grid::from_fn(
            right - left,
            bottom - top,
            |column, row| image[(left + column, top + row)],
        )))
    }

    /// What was found in a part, in the whole picture; nothing is likely beyond.
    fn placed(&self, frame: usize, [left, top, ..]: [usize; 4], found: &Likelihood) -> Likelihood {
        let (width, height) = self.photos[frame].image.size();
        Grid::from_fn(width, height, |column, row| {
            match (column.checked_sub(left), row.checked_sub(top)) {
                (Some(column), Some(row)) => found.get(column, row).copied().unwrap_or(0),
                _ => 0,
            }
        })
    }

    /// How likely each pixel is of what stands out in a part of a frame.
    fn saliency(&self, frame: usize, part: [usize; 4]) -> Result<Likelihood, PrepareError> {
        self.cache.get_or("look", self.key.and(&(frame, part)), || {
            let found = self.networks.saliency(&self.part(frame, part)?)?;
            Ok(self.placed(frame, part, &found))
        })
    }

    /// How likely each pixel is of the class, about a box.
    fn class(&self, frame: usize, sides: &Sides) -> Result<Option<Likelihood>, PrepareError> {
        let part = sides.widened_in(&self.photos[frame], CLASS_MARGIN);
        let found = self.networks.class(&self.part(frame, part)?)?;
        Ok(found.map(|found| self.placed(frame, part, &found)))
    }

    /// What was likely in one frame where it is in another.
    fn carried(&self, likelihood: &Likelihood, from: usize, to: usize) -> Result<Likelihood, PrepareError> {
        let (width, height) = likelihood.size();
        let moved = ffi::carried(
            likelihood.data(),
            &picture(&self.photos[from].image),
            &picture(&self.photos[to].image),
        )?;
        Ok(Grid::from_fn(width, height, |column, row| {
            moved[row * width + column]
        }))
    }

    /// A given box, in the middle frame's pixels.
    fn given(&self, given: &ObjectBox) -> Result<Sides, PrepareError> {
        let photo = &self.photos[self.photos.len() / 2];
        let given = given.in_image(photo);
        let sides = Sides([
            given.left,
            given.top,
            given.left + given.width,
            given.top + given.height,
        ]);
        let [left, top, right, bottom] = sides.widened_in(photo, 0.0);
        match left < right && top < bottom {
            true => Ok(sides),
            false => Err(ObjectBox::error("no pixel is inside it")),
        }
    }

    /// The box of what is detected in most frames; `None` where the category is not known, or hardly ever detected.
    fn tracked(
        &self,
        given: Option<(usize, Sides)>,
        step: &dyn Fn() -> Result<(), PrepareError>,
    ) -> Result<Option<Vec<Sides>>, PrepareError> {
        if !self.networks.know_category() {
            return Ok(None);
        }
        let mut frames = Vec::new();
        for (frame, photo) in self.photos.iter().enumerate() {
            step()?;
            let detected = self.cache.get_or("detected", self.key.and(&frame), || {
                let image = &photo.image;
                let (width, height) = image.size();
                let mirrored = Grid::from_fn(width, height, |column, row| image[(width - 1 - column, row)]);
                Ok::<_, PrepareError>(Detected::of(
                    &self.networks.detections(&picture(image))?,
                    &self.networks.detections(&picture(&mirrored))?,
                    width,
                ))
            })?;
            frames.push(detected);
        }
        let size = self.photos[0].image.size();
        let Some(tracked) = self.likeliest(tracks(&frames, size, given))? else {
            return Ok(None);
        };
        let seen = tracked.boxes.iter().flatten().count() as f64;
        if seen < MIN_DETECTED * frames.len() as f64 {
            return Ok(None);
        }
        Ok(smoothed(&tracked.boxes))
    }

    /// Of several tracks that of the highest score, times how well its boxes are those of what the class network sees in them: about a platform
    /// that a car stands on, it sees the car, and about a part of a car, the car beyond it.
    fn likeliest(&self, tracks: Vec<Track>) -> Result<Option<Track>, PrepareError> {
        if tracks.len() < 2 {
            return Ok(tracks.into_iter().next());
        }
        let mut best: Option<(f64, Track)> = None;
        for track in tracks {
            let known: Vec<(usize, Sides)> = track
                .boxes
                .iter()
                .enumerate()
                .filter_map(|(frame, sides)| Some((frame, (*sides)?)))
                .collect();
            let looks = known.len().min(CLASS_LOOKS);
            let fits = (0..looks)
                .into_par_iter()
                .map(|look| {
                    let (frame, sides) = known[(2 * look + 1) * known.len() / (2 * looks)];
                    let seen = self.class(frame, &sides)?.as_ref().map(mask_of).transpose()?;
                    let seen = seen.as_ref().and_then(Sides::about);
                    Ok(seen.map_or(0.0, |seen| seen.overlap(&sides)))
                })
                .collect::<Result<Vec<f64>, PrepareError>>()?;
            let score = track.score * fits.iter().sum::<f64>() / looks as f64;
            if best.as_ref().is_none_or(|(other, _)| score > *other) {
                best = Some((score, track));
            }
        }
        Ok(best.map(|(_, track)| track))
    }

    /// The box of what stands out in whole pictures or, from a given box, in each part about what was found before.
    fn salient(
        &self,
        keys: &[usize],
        given: Option<(usize, Sides)>,
        step: &dyn Fn() -> Result<(), PrepareError>,
    ) -> Result<Option<Vec<Sides>>, PrepareError> {
        let mut boxes = vec![None; self.photos.len()];
        let whole = |frame: usize| {
            let (width, height) = self.photos[frame].image.size();
            [0, 0, width, height]
        };
        let mut look = |frame: usize, part: [usize; 4]| {
            step()?;
            let sides = Sides::about(&mask_of(&self.saliency(frame, part)?)?);
            boxes[frame] = sides;
            Ok::<_, PrepareError>(sides)
        };
        match given {
            None => {
                for &frame in keys {
                    look(frame, whole(frame))?;
                }
            }
            Some((middle, start)) => {
                let (before, after) = keys.split_at(keys.partition_point(|&frame| frame < middle));
                let ways: [Vec<usize>; 2] = [after.to_vec(), before.iter().rev().copied().collect()];
                for way in ways {
                    let mut about = start;
                    for frame in way {
                        let part = about.widened_in(&self.photos[frame], MARGIN);
                        about = look(frame, part)?.unwrap_or(about);
                    }
                }
            }
        }
        Ok(smoothed(&boxes))
    }
}
