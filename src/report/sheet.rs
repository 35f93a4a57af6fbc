//! Contact sheets: frames, each as it is and with its overlay below, cut to where the object is.

use super::lettering;
use crate::sequence::Frame;
use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage as Picture};

const COLUMNS: usize = 4;
const TILE_WIDTH: u32 = 400;
const GAP: u32 = 10;
/// Around the masks' common box, as a share of its larger side.
const MARGIN: f64 = 0.12;
const PAPER: Rgb<u8> = Rgb([24, 24, 28]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);

/// Collects the frames that the sheet shows: at most so many, evenly spread over the sequence, first and last included.
pub(super) struct Sheet {
    chosen: Vec<usize>,
    /// Left, top, right, bottom in pixels; the last two exclusive.
    window: [u32; 4],
    tiles: Vec<Tile>,
}

struct Tile {
    name: String,
    caption: String,
    image: Picture,
    overlay: Picture,
}

impl Sheet {
    pub(super) fn new(frames: &[Frame], max_tiles: usize) -> Self {
        Self {
            chosen: spread(frames.len(), max_tiles),
            window: window(frames),
            tiles: Vec::new(),
        }
    }

    pub(super) fn add(
        &mut self,
        frame: usize,
        name: &str,
        caption: String,
        image: &Picture,
        overlay: &Picture,
    ) {
        if self.chosen.contains(&frame) {
            self.tiles.push(Tile {
                name: name.to_owned(),
                caption,
                image: self.cut(image),
                overlay: self.cut(overlay),
            });
        }
    }

    pub(super) fn draw(&self) -> Picture {
        let columns = self.tiles.len().clamp(1, COLUMNS);
        let caption = lettering::HEIGHT + GAP;
        let heights = self.tiles.chunks(columns).map(|row| {
            let tallest = row.iter().map(|tile| tile.image.height()).max().unwrap_or(0);
            caption + 2 * tallest + 2 * GAP
        });
        let heights: Vec<u32> = heights.collect();
        let width = columns as u32 * (TILE_WIDTH + GAP) + GAP;
        let mut sheet = Picture::from_pixel(width, heights.iter().sum::<u32>() + GAP, PAPER);
        let mut top = GAP;
        for (row, height) in self.tiles.chunks(columns).zip(heights) {
            for (i, tile) in row.iter().enumerate() {
                tile.draw(&mut sheet, GAP + i as u32 * (TILE_WIDTH + GAP), top, caption);
            }
            top += height;
        }
        sheet
    }

    /// The window's part of a picture, at the tile's width.
    fn cut(&self, picture: &Picture) -> Picture {
        let [left, top, right, bottom] = self.window;
        let (right, bottom) = (right.min(picture.width()), bottom.min(picture.height()));
        let part = match (right.checked_sub(left), bottom.checked_sub(top)) {
            (Some(width @ 1..), Some(height @ 1..)) => {
                imageops::crop_imm(picture, left, top, width, height).to_image()
            }
            // A frame smaller than the others, that does not reach the window.
            _ => picture.clone(),
        };
        let height = f64::from(part.height()) * f64::from(TILE_WIDTH) / f64::from(part.width().max(1));
        let height = (height.round() as u32).clamp(1, 4 * TILE_WIDTH);
        imageops::resize(&part, TILE_WIDTH, height, FilterType::CatmullRom)
    }
}

impl Tile {
    fn draw(&self, sheet: &mut Picture, left: u32, top: u32, caption: u32) {
        let right = lettering::width(&self.caption);
        let name = lettering::tail(&self.name, TILE_WIDTH - right - 2 * GAP);
        lettering::write(sheet, (left, top), &name, INK);
        lettering::write(sheet, (left + TILE_WIDTH - right, top), &self.caption, INK);
        let (left, top) = (i64::from(left), top + caption);
        imageops::replace(sheet, &self.image, left, i64::from(top));
        imageops::replace(
            sheet,
            &self.overlay,
            left,
            i64::from(top + self.image.height() + 2),
        );
    }
}

fn spread(frame_count: usize, max_tiles: usize) -> Vec<usize> {
    let shown = frame_count.min(max_tiles);
    let (last, steps) = (frame_count.saturating_sub(1), shown.saturating_sub(1));
    (0..shown)
        .map(|i| (i * last + steps / 2) / steps.max(1))
        .collect()
}

/// The box around all masks, with a margin; everything if no mask holds a pixel.
fn window(frames: &[Frame]) -> [u32; 4] {
    let mut window: Option<[usize; 4]> = None;
    for frame in frames {
        for (i, _) in frame.mask.data().iter().enumerate().filter(|(_, on)| **on) {
            let (column, row) = (i % frame.mask.width(), i / frame.mask.width());
            let [left, top, right, bottom] = window.unwrap_or([column, row, 0, 0]);
            window = Some([
                left.min(column),
                top.min(row),
                right.max(column + 1),
                bottom.max(row + 1),
            ]);
        }
    }
    let Some([left, top, right, bottom]) = window else {
        return [0, 0, u32::MAX, u32::MAX];
    };
    let margin = (MARGIN * (right - left).max(bottom - top) as f64).round() as usize;
    [
        left.saturating_sub(margin),
        top.saturating_sub(margin),
        right + margin,
        bottom + margin,
    ]
    .map(|edge| edge as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Surface;
    use crate::report::fixture::{box_car, solved};

    #[test]
    fn frames_are_spread_evenly() {
        assert!(spread(0, 16).is_empty());
        assert_eq!(spread(1, 16), [0]);
        assert_eq!(spread(3, 16), [0, 1, 2]);
        let chosen = spread(46, 16);
        assert_eq!((chosen.len(), chosen[0], chosen[15]), (16, 0, 45));
        assert!(
            chosen
                .windows(2)
                .all(|pair| (3..=4).contains(&(pair[1] - pair[0])))
        );
    }

    #[test]
    fn the_window_holds_every_mask_with_a_margin() {
        let (sequence, _) = solved(&Surface::from_points(box_car(50)), 2);
        let mut frames = sequence.into_content().frames;
        for (frame, left) in frames.iter_mut().zip([100, 130]) {
            let (width, height) = frame.mask.size();
            frame.mask = crate::image::Grid::from_fn(width, height, |column, row| {
                (left..left + 20).contains(&column) && (4..64).contains(&row)
            });
        }
        // The box is 50 × 60 pixels, the margin 7.
        assert_eq!(window(&frames), [93, 0, 157, 71]);
        assert_eq!(window(&[]), [0, 0, u32::MAX, u32::MAX]);
    }
}
