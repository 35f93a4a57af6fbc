//! How looks at single frames become masks on which all agree.

use super::*;

#[derive(Default)]
pub(super) struct Counts {
    /// Masks that were decided anew.
    pub anew: usize,
}

/// How looks at single frames become masks on which all agree.
pub(super) struct Opinion<'a> {
    pub segmenter: &'a Segmenter<'a>,
    pub boxes: &'a [Sides],
    /// Whether the boxes are of the category, so that the class network has a say.
    pub by_class: bool,
}

impl Opinion<'_> {
    /// The masks of the frames that were looked at. Looks that were wrong are replaced by what was decided.
    pub fn keys(
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
                    .map(|j| self.segmenter.carried(&looks[&keys[j]], keys[j], keys[i]))
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
        let [left, top, right, bottom] = sides.widened_in(&self.segmenter.photos[frame], LOOSE);
        let within = Grid::from_fn(width, height, |column, row| {
            own[(column, row)] && (left..right).contains(&column) && (top..bottom).contains(&row)
        });
        if doubted.is_none() && fit && agreement(own, &within) > 1.0 - MIN_PART {
            return Ok(own.clone());
        }
        let Some(class) = self.segmenter.class(frame, sides)? else {
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
        let photo = &self.segmenter.photos[frame];
        let part = sides.widened_in(photo, CLASS_MARGIN);
        let inner = sides.widened_in(photo, LOOSE / 2.0);
        let [left, top, right, bottom] = part;
        let small = colours::working(self.segmenter.part(frame, part)?)?;
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
    pub fn between(
        &self,
        decided: BTreeMap<usize, Mask>,
        looks: &mut BTreeMap<usize, Likelihood>,
        counts: &mut Counts,
        step: &dyn Fn() -> Result<(), PrepareError>,
    ) -> Result<Vec<Mask>, PrepareError> {
        let count = self.segmenter.photos.len();
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
                    Ok::<_, PrepareError>((weight, self.segmenter.carried(look, from, frame)?))
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
                .segmenter
                .saliency(frame, sides.widened_in(&self.segmenter.photos[frame], MARGIN))?;
            let own = mask_of(&look)?;
            looks.insert(frame, look);
            let class = match self.by_class {
                true => self.segmenter.class(frame, sides)?,
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
