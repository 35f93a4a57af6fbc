//! What the network sees of a frame: the object alone, cut out square and made small.

use crate::image::{Mask, RgbImage};

/// Side of a crop.
pub const SIDE_PX: usize = 48;
/// The channels of a crop: red, green, blue and mask.
pub const CHANNELS: usize = 4;
/// Room around the mask's box, as a share of its longer side, on each side.
const MARGIN: f64 = 0.06;
/// Mean brightness that colours are scaled to.
const BRIGHTNESS: f32 = 0.5;

/// `CHANNELS` planes of `SIDE_PX`² numbers, row-major: colours, 0 off the mask and about 0.5 on average on it; and the share
/// of a cell that is on the mask.
#[derive(Clone, Debug, PartialEq)]
pub struct Crop(pub Vec<f32>);

impl Crop {
    /// None where the mask is empty.
    pub fn of(image: &RgbImage, mask: &Mask) -> Option<Self> {
        let (width, height) = mask.size();
        let (mut low, mut high) = ([usize::MAX; 2], [0usize; 2]);
        for row in 0..height {
            for column in 0..width {
                if mask[(column, row)] {
                    for (k, at) in [column, row].into_iter().enumerate() {
                        low[k] = low[k].min(at);
                        high[k] = high[k].max(at + 1);
                    }
                }
            }
        }
        if high[0] == 0 {
            return None;
        }
        let longer = (high[0] - low[0]).max(high[1] - low[1]) as f64;
        let side = longer * (1.0 + 2.0 * MARGIN);
        let start = [0, 1].map(|k| (low[k] + high[k]) as f64 / 2.0 - side / 2.0);
        let cell = side / SIDE_PX as f64;
        // Samples per cell and axis: about one a pixel.
        let fine = cell.ceil().max(2.0) as usize;
        let mut planes = vec![0.0; CHANNELS * SIDE_PX * SIDE_PX];
        for (index, (r, c)) in (0..SIDE_PX * SIDE_PX).map(|i| (i, (i / SIDE_PX, i % SIDE_PX))) {
            let mut sum = [0.0f32; CHANNELS];
            for i in 0..fine * fine {
                let along = |cell_index: usize, k: usize, part: usize| {
                    start[k] + cell * (cell_index as f64 + (part as f64 + 0.5) / fine as f64)
                };
                let (x, y) = (along(c, 0, i % fine), along(r, 1, i / fine));
                if x < 0.0 || y < 0.0 || x >= width as f64 || y >= height as f64 {
                    continue;
                }
                let at = (x as usize, y as usize);
                if mask[at] {
                    let [red, green, blue] = image[at];
                    for (sum, value) in sum.iter_mut().zip([red, green, blue, 255.0]) {
                        *sum += value / 255.0;
                    }
                }
            }
            for (channel, sum) in sum.into_iter().enumerate() {
                planes[channel * SIDE_PX * SIDE_PX + index] = sum / (fine * fine) as f32;
            }
        }
        let (colours, covered) = planes.split_at_mut((CHANNELS - 1) * SIDE_PX * SIDE_PX);
        let mean = colours.iter().sum::<f32>() / (CHANNELS - 1) as f32 / covered.iter().sum::<f32>();
        if mean > 0.0 {
            colours.iter_mut().for_each(|value| *value *= BRIGHTNESS / mean);
        }
        Some(Self(planes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn box_at(left: usize, top: usize, brightness: f32) -> Crop {
        let inside = |c: usize, r: usize| (left..left + 40).contains(&c) && (top..top + 20).contains(&r);
        let image = Grid::from_fn(200, 150, |c, r| {
            if !inside(c, r) {
                return [9.0, 250.0, 9.0];
            }
            let red = if c < left + 20 { 2.0 } else { 1.0 };
            [red, 1.0, 1.0].map(|value| value * brightness)
        });
        Crop::of(&image, &Grid::from_fn(200, 150, inside)).unwrap()
    }

    #[test]
    fn place_brightness_and_what_is_behind_do_not_matter() {
        let crop = box_at(30, 20, 60.0);
        for other in [box_at(90, 77, 60.0), box_at(30, 20, 100.0)] {
            let off = crop.0.iter().zip(&other.0).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f32::max) < 1e-4);
        }
        let plane = |k: usize| &crop.0[k * SIDE_PX * SIDE_PX..(k + 1) * SIDE_PX * SIDE_PX];
        let covered = plane(3).iter().sum::<f32>() / (SIDE_PX * SIDE_PX) as f32;
        assert!((covered - 0.5 / 1.12f32.powi(2)).abs() < 0.01, "{covered}");
        let middle = SIDE_PX / 2 * SIDE_PX;
        assert_eq!(plane(0)[middle + 12], 2.0 * plane(0)[middle + 36]);
        assert_eq!(plane(1)[middle + 12], plane(1)[middle + 36]);
        assert_eq!(plane(1)[0], 0.0);
    }

    #[test]
    fn a_box_at_the_border_is_cut_like_any_other() {
        let (inner, border) = (box_at(30, 20, 60.0), box_at(0, 0, 60.0));
        assert_eq!(inner, border);
    }

    #[test]
    fn an_empty_mask_shows_nothing() {
        assert_eq!(
            Crop::of(
                &Grid::from_fn(4, 4, |_, _| [0.0; 3]),
                &Grid::from_fn(4, 4, |_, _| false)
            ),
            None
        );
    }
}
