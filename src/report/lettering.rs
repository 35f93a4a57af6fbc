//! Captions for pictures: capital letters and digits of 5 × 7 dots.

use image::{Rgb, RgbImage as Picture};

/// Dots are squares of this many pixels.
const DOT: u32 = 2;
const WIDTH: u32 = 6 * DOT;
pub(super) const HEIGHT: u32 = 7 * DOT;

/// Rows from the top, the leftmost dot in bit 4.
#[rustfmt::skip]
const GLYPHS: [(char, [u8; 7]); 41] = [
    ('0', [14, 17, 19, 21, 25, 17, 14]), ('1', [4, 12, 4, 4, 4, 4, 14]), ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [31, 2, 4, 2, 1, 17, 14]), ('4', [2, 6, 10, 18, 31, 2, 2]), ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]), ('7', [31, 1, 2, 4, 8, 8, 8]), ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]), ('A', [14, 17, 17, 31, 17, 17, 17]), ('B', [30, 17, 17, 30, 17, 17, 30]),
    ('C', [14, 17, 16, 16, 16, 17, 14]), ('D', [30, 17, 17, 17, 17, 17, 30]), ('E', [31, 16, 16, 30, 16, 16, 31]),
    ('F', [31, 16, 16, 30, 16, 16, 16]), ('G', [14, 17, 16, 23, 17, 17, 15]), ('H', [17, 17, 17, 31, 17, 17, 17]),
    ('I', [14, 4, 4, 4, 4, 4, 14]), ('J', [7, 2, 2, 2, 2, 18, 12]), ('K', [17, 18, 20, 24, 20, 18, 17]),
    ('L', [16, 16, 16, 16, 16, 16, 31]), ('M', [17, 27, 21, 21, 17, 17, 17]), ('N', [17, 25, 21, 19, 17, 17, 17]),
    ('O', [14, 17, 17, 17, 17, 17, 14]), ('P', [30, 17, 17, 30, 16, 16, 16]), ('Q', [14, 17, 17, 17, 21, 18, 13]),
    ('R', [30, 17, 17, 30, 20, 18, 17]), ('S', [15, 16, 16, 14, 1, 1, 30]), ('T', [31, 4, 4, 4, 4, 4, 4]),
    ('U', [17, 17, 17, 17, 17, 17, 14]), ('V', [17, 17, 17, 17, 17, 10, 4]), ('W', [17, 17, 17, 21, 21, 27, 17]),
    ('X', [17, 17, 10, 4, 10, 17, 17]), ('Y', [17, 17, 10, 4, 4, 4, 4]), ('Z', [31, 1, 2, 4, 8, 16, 31]),
    (' ', [0; 7]), ('.', [0, 0, 0, 0, 0, 12, 12]), ('-', [0, 0, 0, 31, 0, 0, 0]), ('_', [0, 0, 0, 0, 0, 0, 31]),
    ('/', [1, 1, 2, 4, 8, 16, 16]),
];

/// How wide `text` is, in pixels.
pub(super) fn width(text: &str) -> u32 {
    text.chars().count() as u32 * WIDTH
}

/// The end of `text` that is at most `room` pixels wide: what tells frames apart stands at the end of their names.
pub(super) fn tail(text: &str, room: u32) -> String {
    let count = text.chars().count();
    text.chars()
        .skip(count.saturating_sub((room / WIDTH) as usize))
        .collect()
}

/// Writes with the top left corner at (`left`, `top`), clipped to the picture; other characters show as `_`.
pub(super) fn write(picture: &mut Picture, (left, top): (u32, u32), text: &str, colour: Rgb<u8>) {
    for (i, letter) in text.chars().enumerate() {
        let letter = letter.to_ascii_uppercase();
        let glyph = |wanted: char| GLYPHS.iter().find(|(known, _)| *known == wanted);
        let Some((_, rows)) = glyph(letter).or_else(|| glyph('_')) else {
            continue;
        };
        for (y, x) in (0..HEIGHT).flat_map(|y| (0..5 * DOT).map(move |x| (y, x))) {
            let lit = rows[(y / DOT) as usize] >> (4 - x / DOT) & 1 == 1;
            if let Some(pixel) = picture.get_pixel_mut_checked(left + i as u32 * WIDTH + x, top + y)
                && lit
            {
                *pixel = colour;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_where_they_are_put() {
        let mut picture = Picture::new(40, 20);
        write(&mut picture, (3, 2), "l.", Rgb([9; 3]));
        // L: the left stroke and the foot, each dot two pixels wide.
        assert_eq!(picture.get_pixel(3, 2).0, [9; 3]);
        assert_eq!(picture.get_pixel(5, 2).0, [0; 3]);
        assert_eq!(picture.get_pixel(12, 15).0, [9; 3]);
        assert_eq!(picture.get_pixel(12, 16).0, [0; 3]);
        assert_eq!(tail("frame_001", 36), "001");
        assert_eq!(width("abc"), 36);
    }
}
