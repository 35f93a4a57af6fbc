//! Boxes about the object: one in every frame, from detections that come and go.

use super::networks::Detection;
use crate::image::Mask;

/// Left, top, right and bottom of a box in pixels of a photo's image; it may reach beyond the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides(pub [f64; 4]);

impl Sides {
    /// About a mask; `None` about nothing.
    pub fn about(mask: &Mask) -> Option<Self> {
        mask.bounds().map(|sides| Self(sides.map(|x| x as f64)))
    }

    fn area(&self) -> f64 {
        let Self([left, top, right, bottom]) = self;
        (right - left).max(0.0) * (bottom - top).max(0.0)
    }

    fn common(&self, other: &Self) -> f64 {
        let (Self(a), Self(b)) = (self, other);
        Self([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]).area()
    }

    /// Intersection over union, 0 to 1.
    pub fn overlap(&self, other: &Self) -> f64 {
        let common = self.common(other);
        let all = self.area() + other.area() - common;
        if all > 0.0 { common / all } else { 0.0 }
    }

    /// With a margin, a share of its width and height on every side, as columns and rows of a picture.
    pub fn widened(&self, margin: f64, width: usize, height: usize) -> [usize; 4] {
        let Self([left, top, right, bottom]) = self;
        let (across, down) = (margin * (right - left), margin * (bottom - top));
        let clamped = |x: f64, most: usize| x.clamp(0.0, most as f64) as usize;
        [
            clamped((left - across).floor(), width),
            clamped((top - down).floor(), height),
            clamped((right + across).ceil(), width),
            clamped((bottom + down).ceil(), height),
        ]
    }
}

/// Detections below this score start and continue nothing.
const MIN_SCORE: f64 = 0.2;
/// Overlap from frame to frame counts so many times a score of 1: an object that stays beats one that is surer in single frames.
const STAYING: f64 = 2.0;
/// Smaller overlaps count nothing, so that no object is left for what it stands on; one that moves fast is still followed.
const MIN_OVERLAP: f64 = 0.5;
/// The maximum number of frames without a detection within a chain.
const GAP: usize = 5;
/// Objects that fill this share of the picture are large enough.
const LARGE: f64 = 0.05;
/// At most so many chains are looked at.
const MAX_TRACKS: usize = 3;
/// A chain of a smaller share of the best one's score is no rival.
const RIVAL: f64 = 0.7;
/// What overlaps a given box by less is another object.
const GIVEN: f64 = 0.3;

/// What the detector said of a frame.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Detected {
    /// Left, top, right, bottom and score of each.
    pub boxes: Vec<([f64; 4], f64)>,
}

impl Detected {
    /// Detections in a picture, and in its mirror image, which is a second opinion: both scores count half.
    pub fn of(plain: &[Detection], mirrored: &[Detection], width: usize) -> Self {
        let width = width as f64;
        let back = |found: &Detection| {
            let Sides([left, top, right, bottom]) = found.sides;
            (Sides([width - right, top, width - left, bottom]), found.score)
        };
        let mirrored: Vec<(Sides, f64)> = mirrored.iter().map(back).collect();
        let boxes = plain
            .iter()
            .filter(|found| found.score >= MIN_SCORE)
            .map(|found| {
                let second = mirrored
                    .iter()
                    .map(|(sides, score)| score * sides.overlap(&found.sides))
                    .fold(0.0, f64::max);
                (found.sides.0, 0.5 * (found.score + second))
            })
            .collect();
        Self { boxes }
    }
}

/// What may be the object through all frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// `None` where it was not detected.
    pub boxes: Vec<Option<Sides>>,
    /// How sure, large and central it is, and how much it overlaps from frame to frame.
    pub score: f64,
}

/// Chains of detections, each of the highest score among what those before it left, best first: the first, and others that come near it. `given` is a
/// box of the object in one frame; there is but one chain then. None where nothing was detected.
pub fn tracks(
    frames: &[Detected],
    (width, height): (usize, usize),
    given: Option<(usize, Sides)>,
) -> Vec<Track> {
    let (width, height) = (width as f64, height as f64);
    let picture = Sides([0.0, 0.0, width, height]);
    let weighted = |sides: &Sides, score: f64| {
        let Sides([left, top, right, bottom]) = sides;
        let inside = sides.common(&picture) / sides.area().max(1e-9);
        let size = (sides.area() / picture.area() / LARGE).sqrt().min(1.0);
        let (x, y) = (
            (left + right) / (2.0 * width) - 0.5,
            (top + bottom) / (2.0 * height) - 0.5,
        );
        score * inside * size * (1.0 - x.hypot(y)).max(0.0)
    };
    let mut nodes: Vec<Vec<(Sides, f64)>> = frames
        .iter()
        .enumerate()
        .map(|(frame, detected)| {
            let all = detected
                .boxes
                .iter()
                .map(|&(sides, score)| (Sides(sides), score))
                .map(|(sides, score)| (sides, weighted(&sides, score)));
            match given {
                Some((at, given)) if at == frame => {
                    let same: Vec<_> = all.filter(|(sides, _)| sides.overlap(&given) >= GIVEN).collect();
                    if same.is_empty() { vec![(given, 1.0)] } else { same }
                }
                _ => all.collect(),
            }
        })
        .collect();
    let mut found: Vec<Track> = Vec::new();
    while found.len() < MAX_TRACKS
        && let Some(track) = best_track(&nodes, given.map(|(at, _)| at))
        && found
            .first()
            .is_none_or(|first| track.score >= RIVAL * first.score)
    {
        for (nodes, taken) in nodes.iter_mut().zip(&track.boxes) {
            nodes.retain(|(sides, _)| Some(*sides) != *taken);
        }
        found.push(track);
        if given.is_some() {
            break;
        }
    }
    found
}

/// The best chain of weighted detections, which passes a frame where the object's box was given.
fn best_track(nodes: &[Vec<(Sides, f64)>], given: Option<usize>) -> Option<Track> {
    let mut chains: Vec<Vec<Chain>> = Vec::new();
    for (frame, found) in nodes.iter().enumerate() {
        // A given box is on the chain: none may start after it, nor pass it by.
        let past = given.filter(|at| *at < frame);
        let (first, alone) = past.map_or((0, 0.0), |at| (at, f64::NEG_INFINITY));
        let ends = found
            .iter()
            .map(|(sides, score)| {
                let mut best = Chain {
                    score: alone,
                    before: None,
                };
                for before in frame.saturating_sub(GAP).max(first)..frame {
                    for (i, (other, _)) in nodes[before].iter().enumerate() {
                        let chain = chains[before][i].score + link(sides.overlap(other));
                        if chain > best.score {
                            best = Chain {
                                score: chain,
                                before: Some((before, i)),
                            };
                        }
                    }
                }
                best.score += score;
                best
            })
            .collect();
        chains.push(ends);
    }
    let mut at = (given.unwrap_or(0)..nodes.len())
        .flat_map(|frame| (0..nodes[frame].len()).map(move |i| (frame, i)))
        .max_by(|a, b| chains[a.0][a.1].score.total_cmp(&chains[b.0][b.1].score));
    let score = at.map(|(frame, i)| chains[frame][i].score)?;
    let mut boxes = vec![None; nodes.len()];
    while let Some((frame, i)) = at {
        boxes[frame] = Some(nodes[frame][i].0);
        at = chains[frame][i].before;
    }
    Some(Track { boxes, score })
}

/// What an overlap with the detection before adds to a chain's score.
fn link(overlap: f64) -> f64 {
    if overlap < MIN_OVERLAP {
        0.0
    } else {
        STAYING * overlap
    }
}

/// The best chain that ends with a detection.
struct Chain {
    score: f64,
    /// The frame before and the detection in it.
    before: Option<(usize, usize)>,
}

/// So many frames, itself and the nearest in which something was found, say where the object is in a frame.
const NEARBY: usize = 5;

/// The median of each side over the nearest boxes: wrong ones do not count, gaps are filled. `None` where there is no box at all.
pub fn smoothed(boxes: &[Option<Sides>]) -> Option<Vec<Sides>> {
    let known: Vec<(usize, Sides)> = boxes
        .iter()
        .enumerate()
        .filter_map(|(frame, sides)| Some((frame, (*sides)?)))
        .collect();
    if known.is_empty() {
        return None;
    }
    let of_frame = |frame: usize| {
        let mut near = known.clone();
        near.sort_by_key(|(other, _)| (other.abs_diff(frame), *other));
        near.truncate(NEARBY);
        Sides(std::array::from_fn(|side| {
            let mut places: Vec<f64> = near.iter().map(|(_, sides)| sides.0[side]).collect();
            places.sort_by(f64::total_cmp);
            places[places.len() / 2]
        }))
    };
    Some((0..boxes.len()).map(of_frame).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_keeps_its_margin_within_the_picture() {
        let sides = Sides([40.0, 50.0, 60.0, 70.0]);
        assert_eq!(sides.widened(0.35, 100, 72), [33, 43, 67, 72]);
        assert_eq!(
            Sides([200.0, 50.0, 210.0, 70.0]).widened(0.35, 100, 100)[..1],
            [100]
        );
    }

    #[test]
    fn one_wrong_box_of_five_does_not_count_and_gaps_are_filled() {
        let boxes = [
            Some(Sides([10.0, 20.0, 50.0, 60.0])),
            Some(Sides([11.0, 20.0, 51.0, 60.0])),
            None,
            Some(Sides([30.0, 40.0, 35.0, 44.0])),
            Some(Sides([12.0, 21.0, 52.0, 61.0])),
            Some(Sides([13.0, 21.0, 53.0, 61.0])),
        ];
        let smooth = smoothed(&boxes).unwrap();
        assert_eq!(smooth[2], Sides([12.0, 21.0, 51.0, 60.0]));
        assert_eq!(smoothed(&[None, None]), None);
    }

    /// A small sure box that jumps, a large one that stays, and one frame without it.
    fn scene() -> Vec<Detected> {
        (0..7)
            .map(|frame| {
                let x = frame as f64;
                let jumping = ([5.0 + 15.0 * x, 5.0, 25.0 + 15.0 * x, 15.0], 0.9);
                let staying = ([30.0 + x, 30.0, 70.0 + x, 60.0], 0.5);
                Detected {
                    boxes: if frame == 3 {
                        vec![jumping]
                    } else {
                        vec![jumping, staying]
                    },
                }
            })
            .collect()
    }

    #[test]
    fn the_object_that_stays_is_followed_past_a_gap() {
        let tracked = tracks(&scene(), (120, 90), None);
        // The one that jumps is no rival.
        assert_eq!(tracked.len(), 1);
        for (frame, sides) in tracked[0].boxes.iter().enumerate() {
            let left = 30.0 + frame as f64;
            assert_eq!(
                *sides,
                (frame != 3).then_some(Sides([left, 30.0, left + 40.0, 60.0]))
            );
        }
        assert_eq!(
            tracks(&[Detected::default(), Detected::default()], (120, 90), None),
            []
        );
    }

    #[test]
    fn what_comes_near_the_best_is_a_rival() {
        let mut scene = scene();
        for (frame, detected) in scene.iter_mut().enumerate() {
            // About what stays, larger and never moving.
            detected.boxes.push(([10.0, 20.0, 110.0, 70.0], 0.4));
            let x = frame as f64;
            detected
                .boxes
                .push(([80.0 - 9.0 * x, 60.0, 100.0 - 9.0 * x, 80.0], 0.2));
        }
        let found = tracks(&scene, (120, 90), None);
        assert_eq!(found.len(), 2);
        assert!(found[0].score >= found[1].score);
        assert_eq!(found[0].boxes[3], Some(Sides([10.0, 20.0, 110.0, 70.0])));
        assert_eq!(found[1].boxes[2], Some(Sides([32.0, 30.0, 72.0, 60.0])));
    }

    /// Detected on the platform, an object is surer in the first half, the platform in the second.
    #[test]
    fn a_chain_does_not_leave_the_object_for_what_it_stands_on() {
        let frames: Vec<Detected> = (0..10)
            .map(|frame| {
                let x = f64::from(frame);
                let sure = |first: bool| if (frame < 5) == first { 0.6 } else { 0.4 };
                Detected {
                    boxes: vec![
                        ([30.0 + x, 30.0, 80.0 + x, 60.0], sure(true)),
                        ([5.0, 20.0, 115.0, 75.0], sure(false)),
                    ],
                }
            })
            .collect();
        for frames in [frames.clone(), frames.into_iter().rev().collect()] {
            for track in tracks(&frames, (120, 90), None) {
                let widths: Vec<f64> = track.boxes.iter().flatten().map(|Sides(s)| s[2] - s[0]).collect();
                assert_eq!(widths.len(), 10);
                assert!(widths.iter().all(|width| *width == widths[0]), "{widths:?}");
            }
        }
    }

    #[test]
    fn an_object_that_moves_by_its_width_is_followed() {
        let frames: Vec<Detected> = (0..4)
            .map(|frame| {
                let x = 30.0 * f64::from(frame);
                Detected {
                    boxes: vec![([x, 30.0, x + 30.0, 60.0], 0.9)],
                }
            })
            .collect();
        let found = tracks(&frames, (120, 90), None);
        assert_eq!(found[0].boxes.iter().flatten().count(), 4);
    }

    #[test]
    fn a_given_box_says_which_object_it_is() {
        let mut scene = scene();
        for (frame, detected) in scene.iter_mut().enumerate() {
            let x = frame as f64;
            detected.boxes.push(([80.0, 60.0 + x, 110.0, 80.0 + x], 0.3));
        }
        let given = Sides([80.0, 62.0, 112.0, 84.0]);
        let tracked = tracks(&scene, (120, 90), Some((3, given)));
        assert_eq!(tracked.len(), 1);
        let tracked = &tracked[0].boxes;
        assert_eq!(tracked[0], Some(Sides([80.0, 60.0, 110.0, 80.0])));
        assert_eq!(tracked[6], Some(Sides([80.0, 66.0, 110.0, 86.0])));
        // One that was not detected is believed all the same.
        let unseen = Sides([1.0, 70.0, 20.0, 89.0]);
        let tracked = tracks(&scene, (120, 90), Some((3, unseen)));
        assert_eq!(tracked[0].boxes[3], Some(unseen));
    }

    #[test]
    fn the_mirror_image_halves_what_is_seen_once() {
        let found = |left: f64, score| Detection {
            sides: Sides([left, 10.0, left + 20.0, 20.0]),
            score,
        };
        let both = Detected::of(&[found(10.0, 0.8), found(60.0, 0.6)], &[found(70.0, 0.8)], 100);
        assert_eq!(both.boxes[0].1, 0.8);
        assert_eq!(both.boxes[1].1, 0.3);
    }
}
