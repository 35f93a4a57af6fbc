//! Masks by networks: the object's box in every frame, a look close up in every second one, what lies between carried by optical
//! flow, and a second opinion wherever frames disagree.

use super::boxes::{Detected, Sides, smoothed, track};
use super::colours::{self, BACKGROUND, MAYBE_BACKGROUND, MAYBE_OBJECT};
use super::networks::{LIKELY, Likelihood, Networks};
use super::{ObjectBox, cleaned, picture};
use crate::bridge::vision::ffi::{self, Colours, Picture};
use crate::image::{Grid, Mask};
use crate::prepare::cache::{Cache, Key};
use crate::prepare::{Photo, PrepareError};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// About a box there must be so much more, as a share of its size, for a saliency network to tell what stands out.
const MARGIN: f64 = 0.35;
/// The class network sees most in a narrower part.
const CLASS_MARGIN: f64 = 0.2;
/// The saliency network looks at every so many frames; at others where it must.
const STEP: usize = 2;
/// Masks that overlap less (intersection over union) do not agree.
const AGREEMENT: f64 = 0.9;
/// A mask whose own box overlaps the detected one less is not the object's.
const FIT: f64 = 0.65;
/// Beyond the detected box by a larger share of its size there is no object, unless the class network knows better.
const LOOSE: f64 = 0.1;
/// Differences of a smaller share of the mask are not looked at.
const LEAST_PART: f64 = 0.005;
/// Parts narrower than twice this share of the longer side of the picture are no parts.
const PART_RADIUS: f64 = 1.0 / 160.0;
/// An object detected in a smaller share of the frames was not found.
const LEAST_DETECTED: f64 = 0.25;

/// What became of every frame.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Followed {
    /// Empty where there is no object.
    pub masks: Vec<Mask>,
    /// Counts and what to know, for people.
    pub words: String,
}

/// Photos, and the networks that look at them.
struct Scene<'a> {
    photos: &'a [Photo],
    networks: &'a Networks,
    cache: &'a Cache,
    /// Of the photos and the networks.
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
    let scene = Scene {
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
        .map(|given| scene.given(given))
        .transpose()?
        .map(|sides| (photos.len() / 2, sides));
    let keys = key_frames(photos.len());
    let detected = scene.tracked(given, &step)?;
    let by_class = detected.is_some();
    let boxes = match detected {
        Some(boxes) => Some(boxes),
        None => scene.salient(&keys, given, &step)?,
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
            scene.saliency(frame, boxes[frame].widened_in(&photos[frame], MARGIN))?,
        );
    }
    let opinion = Opinion {
        scene: &scene,
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

fn mask_of(likelihood: &Likelihood) -> Result<Mask, cxx::Exception> {
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
fn settled(own: &Mask, other: &Mask, class: &Likelihood) -> Result<Mask, cxx::Exception> {
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
    let least = LEAST_PART * inside as f64;
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

impl Scene<'_> {
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
        let tracked = track(&frames, size, given);
        let seen = tracked.iter().flatten().count() as f64;
        if seen < LEAST_DETECTED * tracked.len() as f64 {
            return Ok(None);
        }
        Ok(smoothed(&tracked))
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

#[derive(Default)]
struct Counts {
    /// Masks that were decided anew.
    anew: usize,
}

/// How looks at single frames become masks on which all agree.
struct Opinion<'a> {
    scene: &'a Scene<'a>,
    boxes: &'a [Sides],
    /// Whether the boxes are of the category, so that the class network has a say.
    by_class: bool,
}

impl Opinion<'_> {
    /// The masks of the frames that were looked at. Looks that were wrong are replaced by what was decided.
    fn keys(
        &self,
        keys: &[usize],
        looks: &mut BTreeMap<usize, Likelihood>,
        counts: &mut Counts,
    ) -> Result<BTreeMap<usize, Mask>, PrepareError> {
        let own: Vec<Mask> = keys
            .iter()
            .map(|frame| mask_of(&looks[frame]))
            .collect::<Result<_, _>>()?;
        let fit: Vec<bool> = keys
            .iter()
            .zip(&own)
            .map(|(&frame, mask)| !self.by_class || fits(mask, &self.boxes[frame]))
            .collect();
        // What the nearest good looks on both sides would have.
        let expected: Vec<Vec<Likelihood>> = (0..keys.len())
            .into_par_iter()
            .map(|i| {
                let near = |j: &usize| fit[*j] && keys[*j].abs_diff(keys[i]) <= 2 * STEP;
                let before = (0..i).rev().find(|j| near(j));
                let after = (i + 1..keys.len()).find(|j| near(j));
                before
                    .into_iter()
                    .chain(after)
                    .map(|j| self.scene.carried(&looks[&keys[j]], keys[j], keys[i]))
                    .collect()
            })
            .collect::<Result<_, PrepareError>>()?;
        let mut decided = BTreeMap::new();
        for (i, (&frame, own)) in keys.iter().zip(own).enumerate() {
            let mask = self.key(frame, &own, fit[i], &expected[i])?;
            if mask != own {
                counts.anew += 1;
                looks.insert(frame, certain(&mask));
            }
            decided.insert(frame, mask);
        }
        Ok(decided)
    }

    fn key(
        &self,
        frame: usize,
        own: &Mask,
        fit: bool,
        expected: &[Likelihood],
    ) -> Result<Mask, PrepareError> {
        let others: Vec<Mask> = expected.iter().map(mask_of).collect::<Result<_, _>>()?;
        let weighted: Vec<(f64, Likelihood)> = expected.iter().map(|other| (1.0, other.clone())).collect();
        let expected = mean(&weighted).map(|mean| mask_of(&mean)).transpose()?;
        let doubted = expected
            .as_ref()
            .filter(|expected| !fit || agreement(own, expected) < AGREEMENT);
        if !self.by_class {
            // Two frames that agree outvote one.
            let outvoted = matches!(&others[..], [a, b] if agreement(a, b) >= AGREEMENT);
            return Ok(doubted.filter(|_| outvoted).unwrap_or(own).clone());
        }
        let sides = &self.boxes[frame];
        let (width, height) = own.size();
        let [left, top, right, bottom] = sides.widened_in(&self.scene.photos[frame], LOOSE);
        let within = Grid::from_fn(width, height, |column, row| {
            own[(column, row)] && (left..right).contains(&column) && (top..bottom).contains(&row)
        });
        if doubted.is_none() && fit && agreement(own, &within) > 1.0 - LEAST_PART {
            return Ok(own.clone());
        }
        let Some(class) = self.scene.class(frame, sides)? else {
            return Ok(own.clone());
        };
        let mut mask = settled(own, &within, &class)?;
        if let Some(expected) = doubted {
            mask = settled(&mask, expected, &class)?;
        }
        if fits(&mask, sides) {
            return Ok(mask);
        }
        let cut = self.cut(frame, sides, &class)?;
        let fit_of = |mask: &Mask| Sides::about(mask).map_or(0.0, |own| own.overlap(sides));
        let candidates = doubted.into_iter().cloned().chain([cut]);
        Ok(candidates.fold(mask, |best, other| {
            if fit_of(&other) > fit_of(&best) {
                other
            } else {
                best
            }
        }))
    }

    /// GrabCut within a box, from what is likely of the class.
    fn cut(&self, frame: usize, sides: &Sides, class: &Likelihood) -> Result<Mask, PrepareError> {
        let photo = &self.scene.photos[frame];
        let part = sides.widened_in(photo, CLASS_MARGIN);
        let inner = sides.widened_in(photo, LOOSE / 2.0);
        let [left, top, right, bottom] = part;
        let small = colours::working(self.scene.part(frame, part)?)?;
        let place = |column: usize, row: usize| {
            (
                left + (2 * column + 1) * (right - left) / (2 * small.width),
                top + (2 * row + 1) * (bottom - top) / (2 * small.height),
            )
        };
        let labels: Vec<u8> = (0..small.width * small.height)
            .map(|i| {
                let (x, y) = place(i % small.width, i / small.width);
                let inside = (inner[0]..inner[2]).contains(&x) && (inner[1]..inner[3]).contains(&y);
                match (inside, class[(x, y)] > LIKELY) {
                    (true, true) => MAYBE_OBJECT,
                    (true, false) => MAYBE_BACKGROUND,
                    _ => BACKGROUND,
                }
            })
            .collect();
        let (width, height) = photo.image.size();
        // GrabCut learns two mixtures of colours: it needs pixels for both.
        if !labels.contains(&MAYBE_OBJECT) || labels.iter().all(|&label| label == MAYBE_OBJECT) {
            return Ok(Grid::filled(width, height, false));
        }
        let mask = colours::cut(&small, labels, &mut Colours::default(), true)?;
        Ok(Grid::from_fn(width, height, |column, row| {
            (left..right).contains(&column)
                && (top..bottom).contains(&row)
                && mask[(
                    (column - left) * small.width / (right - left),
                    (row - top) * small.height / (bottom - top),
                )]
        }))
    }

    /// All masks: between frames that were looked at, what both would have, or another look where they do not agree.
    fn between(
        &self,
        decided: BTreeMap<usize, Mask>,
        looks: &mut BTreeMap<usize, Likelihood>,
        counts: &mut Counts,
        step: &dyn Fn() -> Result<(), PrepareError>,
    ) -> Result<Vec<Mask>, PrepareError> {
        let count = self.scene.photos.len();
        let carried: BTreeMap<usize, [(f64, Likelihood); 2]> = (0..count)
            .into_par_iter()
            .filter_map(|frame| {
                if decided.contains_key(&frame) {
                    return None;
                }
                let (&before, first) = looks.range(..frame).next_back()?;
                let (&after, second) = looks.range(frame..).next()?;
                let of = |look: &Likelihood, from: usize| {
                    let weight = 1.0 / frame.abs_diff(from) as f64;
                    Ok::<_, PrepareError>((weight, self.scene.carried(look, from, frame)?))
                };
                let pair = || Ok([of(first, before)?, of(second, after)?]);
                Some(pair().map(|pair| (frame, pair)))
            })
            .collect::<Result<_, PrepareError>>()?;
        let mut masks = decided;
        for (frame, pair) in carried {
            step()?;
            let [before, after] = [mask_of(&pair[0].1)?, mask_of(&pair[1].1)?];
            let Some(both) = mean(&pair).map(|mean| mask_of(&mean)).transpose()? else {
                continue;
            };
            if agreement(&before, &after) >= AGREEMENT {
                masks.insert(frame, both);
                continue;
            }
            let sides = &self.boxes[frame];
            let look = self
                .scene
                .saliency(frame, sides.widened_in(&self.scene.photos[frame], MARGIN))?;
            let own = mask_of(&look)?;
            looks.insert(frame, look);
            let class = match self.by_class {
                true => self.scene.class(frame, sides)?,
                false => None,
            };
            let mask = match class {
                Some(class) => settled(&own, &both, &class)?,
                None => own.clone(),
            };
            counts.anew += usize::from(mask != own);
            masks.insert(frame, mask);
        }
        Ok(masks.into_values().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tiny;
    use super::*;

    fn rectangle([left, top, right, bottom]: [usize; 4]) -> Mask {
        Grid::from_fn(192, 128, |column, row| {
            (left..right).contains(&column) && (top..bottom).contains(&row)
        })
    }

    /// A red box that moves to the right before blue; in one frame a yellow post stands below it.
    fn photos(post: Option<usize>) -> (Vec<Photo>, Vec<Mask>) {
        (0..7)
            .map(|frame| {
                let mask = rectangle([60 + 2 * frame, 40, 108 + 2 * frame, 80]);
                let below = rectangle([60 + 2 * frame, 80, 80 + 2 * frame, 104]);
                let image = Grid::from_fn(192, 128, |column, row| {
                    let speckle = 8.0 * (((column + 12 - 2 * frame) / 6 + row / 6) % 2) as f32;
                    match (mask[(column, row)], post == Some(frame) && below[(column, row)]) {
                        (true, _) => [220.0, 40.0 + speckle, 30.0],
                        (_, true) => [200.0, 250.0, 30.0],
                        _ => [20.0, 30.0, 160.0],
                    }
                });
                let photo = Photo {
                    name: frame.to_string(),
                    image,
                    seconds: None,
                    focal_px: None,
                    scale: 1.0,
                };
                (photo, mask)
            })
            .unzip()
    }

    fn followed(photos: &[Photo], category: Option<&str>, object_box: Option<&str>) -> Followed {
        let folder = tempfile::tempdir().unwrap();
        tiny::redness(folder.path());
        let networks = Networks::read(folder.path(), category).unwrap();
        let object_box = object_box.map(|text| text.parse().unwrap());
        masks(
            photos,
            &networks,
            object_box.as_ref(),
            &Cache::none(),
            Key::of("photos"),
            &|steps| steps == 2 * photos.len(),
        )
        .unwrap()
    }

    fn worst(found: &Followed, truth: &[Mask]) -> f64 {
        let agreements = found.masks.iter().zip(truth).map(|(a, b)| agreement(a, b));
        agreements.fold(1.0, f64::min)
    }

    #[test]
    fn an_object_is_followed_and_looked_at_in_every_second_frame() {
        let (photos, truth) = photos(None);
        for (category, object_box, how) in [
            (Some("car"), None, "know the category"),
            (Some("car"), Some("66,40,48,40"), "know the category"),
            (None, None, "saliency network alone"),
            (None, Some("66,40,48,40"), "saliency network alone"),
        ] {
            let found = followed(&photos, category, object_box);
            assert!(worst(&found, &truth) > 0.9, "{}", worst(&found, &truth));
            let words = format!("{how}, looked at 4 of 7, 0 decided anew");
            assert!(found.words.contains(&words), "{}", found.words);
        }
    }

    #[test]
    fn what_stands_out_in_one_frame_alone_is_cut_off() {
        let (photos, truth) = photos(Some(2));
        for category in [Some("car"), None] {
            let found = followed(&photos, category, None);
            assert!(
                worst(&found, &truth) > 0.8,
                "{category:?} {} {}",
                worst(&found, &truth),
                found.words
            );
            assert!(found.words.contains("1 decided anew"), "{}", found.words);
        }
    }

    #[test]
    fn where_nothing_is_there_is_no_mask() {
        let (mut photos, _) = photos(None);
        for photo in &mut photos {
            photo.image = Grid::filled(192, 128, [20.0, 30.0, 160.0]);
        }
        let found = followed(&photos, Some("car"), None);
        assert!(found.masks.iter().all(|mask| mask.share() == 0.0));
        assert_eq!(found.words, "nothing stands out");
    }

    #[test]
    fn a_category_that_is_not_detected_is_said_to_be_missing() {
        let (photos, _) = photos(None);
        let folder = tempfile::tempdir().unwrap();
        tiny::redness(folder.path());
        tiny::network(
            folder.path(),
            "detector",
            &tiny::description("detections", "classes = [\"car\"]"),
            0,
            &[[0.0; 3]; 6],
            &[0.0; 6],
            false,
        );
        let networks = Networks::read(folder.path(), Some("car")).unwrap();
        let found = masks(&photos, &networks, None, &Cache::none(), Key::of(""), &|_| true);
        let words = found.unwrap().words;
        assert!(words.contains("NOTHING OF THE CATEGORY"), "{words}");
    }

    #[test]
    fn an_interruption_ends_it() {
        let (photos, _) = photos(None);
        let folder = tempfile::tempdir().unwrap();
        tiny::redness(folder.path());
        let networks = Networks::read(folder.path(), None).unwrap();
        let found = masks(&photos, &networks, None, &Cache::none(), Key::of(""), &|_| false);
        assert!(matches!(found, Err(PrepareError::Interrupted)));
    }

    #[test]
    fn parts_that_differ_are_decided_by_the_class() {
        let own = rectangle([20, 20, 60, 40]);
        let other = rectangle([30, 20, 70, 40]);
        let class = certain(&rectangle([0, 0, 30, 128]));
        // What is left of the middle stays, what is right of it does not come.
        assert!(agreement(&settled(&own, &other, &class).unwrap(), &own) > 0.98);
        let elsewhere = certain(&rectangle([30, 0, 192, 128]));
        let settled = settled(&own, &other, &elsewhere).unwrap();
        assert!(agreement(&settled, &rectangle([30, 20, 70, 40])) > 0.98);
    }

    #[test]
    fn the_last_frame_is_looked_at_too() {
        assert_eq!(key_frames(5), [0, 2, 4]);
        assert_eq!(key_frames(6), [0, 2, 4, 5]);
        assert_eq!(key_frames(1), [0]);
        assert!(key_frames(0).is_empty());
    }
}
