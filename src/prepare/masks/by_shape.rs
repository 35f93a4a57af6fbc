//! Masks that a solved shape does not explain, decided anew: without the floor that depth shows, by what stands out about the
//! silhouette, or by what has its colours.

use super::boxes::Sides;
use super::colours::{BACKGROUND, MAYBE_BACKGROUND, MAYBE_OBJECT, OBJECT, cut, working};
use super::follow::{CLASS_MARGIN, LOOSE, MARGIN, mask_of, settled};
use super::networks::{Likelihood, Networks};
use super::{MaskOptions, cleaned, picture};
use crate::bridge::vision::ffi::{self, Colours, Picture};
use crate::geometry::{Pinhole, Pose, Vector2};
use crate::image::{Grid, Mask, RgbImage};
use crate::init::Estimate;
use crate::prepare::PrepareError;
use crate::report::{Surface, silhouette_iou};
use crate::sequence::{Frame, Sequence};

/// A frame whose IoU of mask and silhouette is so much lower than the median one stands alone. Frames of epfl_10 with good masks are
/// lower by up to 0.085, where the prior has no such bumper.
const LOWER_IOU: f64 = 0.12;
/// Where the median IoU is lower, the masks of all frames are in doubt, and so is the shape: its colours then prove nothing.
const DOUBTFUL_IOU: f64 = 0.85;
/// A mask decided anew must fit the silhouette by so much more IoU.
const GAIN: f64 = 0.05;
/// How far the object may reach beyond the silhouette, or fall short of it, as a share of the root of the silhouette's area.
const REACH: f64 = 0.08;

/// Depth that shows a point so little above the shape's lowest one, in diagonals of the object, shows the floor.
const FLOOR: f64 = 0.015;
/// The share of a shape's points that may lie below the floor.
const BELOW: f64 = 0.002;

/// For each frame, the mask that fits a solved shape clearly better than the one there is; `None` where that stays.
/// `surface` is the shape, in the object frame; `watch` sees each frame and how many there are.
///
/// # Errors
/// Networks that cannot be read or do not run, OpenCV's own, an interruption.
pub fn masks_by_shape(
    sequence: &Sequence,
    surface: &Surface,
    estimate: &Estimate,
    options: &MaskOptions,
    watch: &dyn Fn(usize) -> bool,
) -> Result<Vec<Option<Mask>>, PrepareError> {
    let mut heights: Vec<f64> = surface.points().iter().map(|point| point.y).collect();
    heights.sort_by(f64::total_cmp);
    let lowest = heights
        .get((BELOW * heights.len() as f64) as usize)
        .copied()
        .unwrap_or(0.0);
    let seen: Vec<(Mask, Mask)> = sequence
        .frames
        .iter()
        .zip(&estimate.camera_from_object)
        .map(|(frame, pose)| {
            let camera = estimate.camera(&frame.camera);
            let silhouette = surface.render(&camera, pose, frame.mask.size()).mask();
            let floor = floor(frame, &camera, pose, estimate.alpha, lowest, &silhouette);
            (silhouette, floor)
        })
        .collect();
    let frames: Vec<Explained> = sequence
        .frames
        .iter()
        .zip(&seen)
        .map(|(frame, (silhouette, floor))| Explained {
            image: &frame.image,
            mask: &frame.mask,
            silhouette,
            floor,
        })
        .collect();
    decided_anew(&frames, options, watch)
}

/// Where depth shows a point beside the silhouette at the height of the shape's lowest points, or below.
fn floor(
    frame: &Frame,
    camera: &Pinhole,
    camera_from_object: &Pose,
    alpha: f64,
    lowest: f64,
    silhouette: &Mask,
) -> Mask {
    let (width, height) = frame.mask.size();
    let object_from_camera = camera_from_object.inverse();
    Grid::from_fn(width, height, |column, row| {
        let z = frame.depth.as_ref().map_or(0.0, |depth| depth[(column, row)]);
        if z <= 0.0 || silhouette[(column, row)] {
            return false;
        }
        let pixel = Vector2::new(column as f64 + 0.5, row as f64 + 0.5);
        let point = object_from_camera.transform(&camera.unproject(&pixel, alpha * f64::from(z)));
        point.y < lowest + FLOOR
    })
}

/// A frame, and what a solved shape looks like in it; all of one size.
struct Explained<'a> {
    image: &'a RgbImage,
    mask: &'a Mask,
    silhouette: &'a Mask,
    /// Where depth shows the floor under the object.
    floor: &'a Mask,
}

fn decided_anew(
    frames: &[Explained],
    options: &MaskOptions,
    watch: &dyn Fn(usize) -> bool,
) -> Result<Vec<Option<Mask>>, PrepareError> {
    let ious: Vec<f64> = frames
        .iter()
        .map(|frame| silhouette_iou(frame.silhouette, frame.mask))
        .collect();
    let mut sorted = ious.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let shape_is_good = median >= DOUBTFUL_IOU;
    let least = if shape_is_good { median - LOWER_IOU } else { 1.0 };
    let networks = match &options.networks {
        Some(folder) if ious.iter().any(|&iou| iou < least) => {
            Some(Networks::read(folder, options.category.as_deref())?)
        }
        _ => None,
    };
    frames
        .iter()
        .zip(ious)
        .map(|(frame, iou)| {
            if !watch(frames.len()) {
                return Err(PrepareError::Interrupted);
            }
            if iou >= least || frame.silhouette.share() == 0.0 {
                return Ok(None);
            }
            let mut found = vec![frame.off_the_floor()?];
            if let Some(networks) = &networks {
                found.push(frame.looked_at(networks)?);
            }
            if shape_is_good {
                found.push(frame.coloured()?);
            }
            let fit = |mask: &Mask| silhouette_iou(frame.silhouette, mask);
            Ok(found
                .into_iter()
                .filter(|mask| fit(mask) > iou + GAIN)
                .max_by(|a, b| fit(a).total_cmp(&fit(b))))
        })
        .collect()
}

impl Explained<'_> {
    fn off_the_floor(&self) -> Result<Mask, cxx::Exception> {
        let (width, height) = self.mask.size();
        let off = self.mask.data().iter().zip(self.floor.data());
        let off = off.map(|(&inside, &floor)| u8::from(inside && !floor));
        cleaned(off.collect(), width, height, 1)
    }

    /// What stands out about the silhouette, in its box and off the floor; where that differs from the mask, each part by how likely
    /// it is of the category, if that is known.
    fn looked_at(&self, networks: &Networks) -> Result<Mask, PrepareError> {
        let (width, height) = self.mask.size();
        let Some(sides) = Sides::about(self.silhouette) else {
            return Ok(self.mask.clone());
        };
        let part = |margin: f64| {
            let [left, top, right, bottom] = sides.widened(margin, width, height);
            let part = Grid::from_fn(right - left, bottom - top, |column, row| {
                self.image[(left + column, top + row)]
            });
            (picture(&part), left, top)
        };
        let placed = |found: &Likelihood, left: usize, top: usize| {
            let [near_left, near_top, near_right, near_bottom] = sides.widened(LOOSE, width, height);
            Grid::from_fn(width, height, |column, row| {
                let near =
                    (near_left..near_right).contains(&column) && (near_top..near_bottom).contains(&row);
                if near && !self.floor[(column, row)] {
                    found[(column - left, row - top)]
                } else {
                    0
                }
            })
        };
        let (about, left, top) = part(MARGIN);
        let look = mask_of(&placed(&networks.saliency(&about)?, left, top))?;
        let (about, left, top) = part(CLASS_MARGIN);
        match networks.class(&about)? {
            Some(class) => Ok(settled(self.mask, &look, &placed(&class, left, top))?),
            None => Ok(look),
        }
    }

    /// What has the colours of the silhouette's inside, near its rim.
    fn coloured(&self) -> Result<Mask, PrepareError> {
        let small: Picture = working(picture(self.image))?;
        let (width, height) = (small.width, small.height);
        let at_size = |mask: &Mask, width: usize, height: usize| {
            let (from_width, from_height) = mask.size();
            Grid::from_fn(width, height, |column, row| {
                mask[(
                    (2 * column + 1) * from_width / (2 * width),
                    (2 * row + 1) * from_height / (2 * height),
                )]
            })
        };
        let silhouette = at_size(self.silhouette, width, height);
        let floor = at_size(self.floor, width, height);
        let (inner, outer) = (grown(&silhouette, -REACH)?, grown(&silhouette, REACH)?);
        let labels = (0..width * height)
            .map(
                |i| match (inner.data()[i], silhouette.data()[i], outer.data()[i]) {
                    _ if floor.data()[i] => BACKGROUND,
                    (true, ..) => OBJECT,
                    (_, true, _) => MAYBE_OBJECT,
                    (.., true) => MAYBE_BACKGROUND,
                    _ => BACKGROUND,
                },
            )
            .collect();
        let found = cut(&small, labels, &mut Colours::default(), true)?;
        let (width, height) = self.mask.size();
        Ok(at_size(&found, width, height))
    }
}

/// A mask grown by a share of the root of its area, or shrunk by a negative one.
fn grown(mask: &Mask, share: f64) -> Result<Mask, cxx::Exception> {
    let (width, height) = mask.size();
    let mut bytes: Vec<u8> = mask.data().iter().map(|&inside| u8::from(inside)).collect();
    let area = mask.share() * (width * height) as f64;
    ffi::grow(&mut bytes, width, height, (share * area.sqrt()).round() as i32)?;
    Ok(Grid::from_fn(width, height, |column, row| {
        bytes[row * width + column] != 0
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (96, 64);

    fn ellipse(centre: (f64, f64), radii: (f64, f64)) -> Mask {
        Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            let (x, y) = (column as f64 - centre.0, row as f64 - centre.1);
            (x / radii.0).powi(2) + (y / radii.1).powi(2) < 1.0
        })
    }

    /// A red object on grey, each with some texture.
    fn image(object: &Mask) -> RgbImage {
        Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            let texture = ((7 * column + 13 * row) % 11) as f32;
            match object[(column, row)] {
                true => [180.0 + texture, 30.0, 30.0 + texture],
                false => [90.0 + texture, 100.0, 95.0],
            }
        })
    }

    #[test]
    fn a_mask_with_the_floor_in_it_is_decided_anew_and_others_stay() {
        let object = ellipse((48.0, 30.0), (28.0, 16.0));
        // The shape is nearly right; in the second frame the mask has the floor in it.
        let silhouette = ellipse((47.0, 30.0), (27.0, 17.0));
        let leaked = Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            object[(column, row)] || (30..60).contains(&row) && (25..70).contains(&column)
        });
        let (image, floor) = (image(&object), Grid::filled(SIZE.0, SIZE.1, false));
        let frame = |mask| Explained {
            image: &image,
            mask,
            silhouette: &silhouette,
            floor: &floor,
        };
        let found = decided_anew(
            &[frame(&object), frame(&leaked), frame(&object)],
            &MaskOptions::default(),
            &|_| true,
        )
        .unwrap();
        assert!(found[0].is_none() && found[2].is_none());
        let mended = found[1].as_ref().unwrap();
        assert!(silhouette_iou(&leaked, &object) < 0.8);
        assert!(silhouette_iou(mended, &object) > 0.95);
    }

    #[test]
    fn what_depth_shows_as_floor_is_cut_off() {
        // The floor has the object's colours.
        let object = ellipse((48.0, 30.0), (28.0, 16.0));
        let leaked = Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            object[(column, row)] || (44..62).contains(&row) && (20..76).contains(&column)
        });
        let floor = Grid::from_fn(SIZE.0, SIZE.1, |column, row| {
            leaked[(column, row)] && !object[(column, row)]
        });
        let image = image(&leaked);
        let nothing = Grid::filled(SIZE.0, SIZE.1, false);
        let mended = |floor: &Mask| {
            let frame = Explained {
                image: &image,
                mask: &leaked,
                silhouette: &object,
                floor,
            };
            decided_anew(&[frame], &MaskOptions::default(), &|_| true).unwrap()[0]
                .as_ref()
                .map_or(0.0, |mask| silhouette_iou(mask, &object))
        };
        assert!(mended(&floor) > 0.97, "{}", mended(&floor));
        assert!(mended(&nothing) < mended(&floor));
    }

    #[test]
    fn it_can_be_interrupted() {
        let object = ellipse((48.0, 30.0), (28.0, 16.0));
        let (image, floor) = (image(&object), Grid::filled(SIZE.0, SIZE.1, false));
        let frame = Explained {
            image: &image,
            mask: &object,
            silhouette: &object,
            floor: &floor,
        };
        let stopped = decided_anew(&[frame], &MaskOptions::default(), &|_| false);
        assert!(matches!(stopped, Err(PrepareError::Interrupted)));
    }
}
