//! The contact sheet: up to 16 frames, each as it is and with its overlay below.

use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage as Picture};

const FRAMES: usize = 16;
const COLUMNS: usize = 4;
const TILE_WIDTH: u32 = 400;
const GAP: u32 = 8;
const PAPER: Rgb<u8> = Rgb([24, 24, 28]);

/// Collects the frames that the sheet shows: evenly spread over the sequence, first and last included.
pub(super) struct Sheet {
    chosen: Vec<usize>,
    tiles: Vec<(Picture, Picture)>,
}

impl Sheet {
    pub(super) fn new(frame_count: usize) -> Self {
        let shown = frame_count.min(FRAMES);
        let last = frame_count.saturating_sub(1);
        let chosen = (0..shown)
            .map(|i| (i * last + (shown - 1) / 2) / (shown - 1).max(1))
            .collect();
        Self {
            chosen,
            tiles: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, frame: usize, image: &Picture, overlay: &Picture) {
        if self.chosen.contains(&frame) {
            self.tiles.push((fit(image), fit(overlay)));
        }
    }

    pub(super) fn draw(&self) -> Picture {
        let columns = self.tiles.len().clamp(1, COLUMNS);
        let rows: Vec<_> = self.tiles.chunks(columns).collect();
        let row_height = |row: &[(Picture, Picture)]| {
            let tallest = row.iter().map(|(image, _)| image.height()).max().unwrap_or(0);
            2 * tallest + GAP
        };
        let width = columns as u32 * (TILE_WIDTH + GAP) + GAP;
        let height = rows.iter().map(|row| row_height(row) + 2 * GAP).sum::<u32>() + GAP;
        let mut sheet = Picture::from_pixel(width, height, PAPER);
        let mut top = GAP;
        for row in rows {
            for (i, (image, overlay)) in row.iter().enumerate() {
                let left = i64::from(GAP + i as u32 * (TILE_WIDTH + GAP));
                imageops::replace(&mut sheet, image, left, i64::from(top));
                let below = top + image.height() + GAP / 2;
                imageops::replace(&mut sheet, overlay, left, i64::from(below));
            }
            top += row_height(row) + 2 * GAP;
        }
        sheet
    }
}

fn fit(picture: &Picture) -> Picture {
    let height =
        (f64::from(picture.height()) * f64::from(TILE_WIDTH) / f64::from(picture.width().max(1))).round();
    imageops::resize(
        picture,
        TILE_WIDTH,
        (height as u32).max(1),
        FilterType::CatmullRom,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_evenly() {
        assert_eq!(Sheet::new(1).chosen, [0]);
        assert_eq!(Sheet::new(3).chosen, [0, 1, 2]);
        let chosen = Sheet::new(46).chosen;
        assert_eq!((chosen.len(), chosen[0], chosen[15]), (16, 0, 45));
        assert!(
            chosen
                .windows(2)
                .all(|pair| (3..=4).contains(&(pair[1] - pair[0])))
        );
        assert!(Sheet::new(0).draw().width() > 0);
    }
}
