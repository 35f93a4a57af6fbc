//! SGI images (`.rgb`, `.sgi`), verbatim or run-length coded, 8 bits a channel, as TORCS's liveries are.
//!
//! Big-endian header of 512 bytes: u16 magic 474, u8 storage (1 = RLE), u8 bytes per channel, u16 dimension,
//! u16 width, height, channels. RLE: u32 start\[channels · height\], u32 length\[…\], then rows. Rows go from
//! the bottom up, one plane after another.

use super::{Texture, texture};

pub(super) const MAGIC: [u8; 2] = [0x01, 0xda];
const HEADER: usize = 512;
/// No livery needs more.
const MAX_BYTES: usize = 1 << 28;

/// The image, or what is wrong with it.
pub(super) fn decode(bytes: &[u8]) -> Result<Texture, String> {
    let half = |at: usize| -> Result<usize, String> {
        let pair = bytes.get(at..at + 2).ok_or("truncated header")?;
        Ok(usize::from(pair[0]) << 8 | usize::from(pair[1]))
    };
    let (storage, depth) = (half(2)? >> 8, half(2)? & 255);
    let (width, height) = (half(6)?, half(8)?);
    let channels = if half(4)? < 3 { 1 } else { half(10)? };
    if depth != 1 || storage > 1 || width == 0 || height == 0 || !(1..=4).contains(&channels) {
        return Err(format!(
            "{width} x {height}, {channels} channels of {depth} bytes, storage {storage}: convert it to PNG"
        ));
    }
    // Coded rows may be shared, so a small file could ask for more memory than there is.
    if channels * width * height > MAX_BYTES {
        return Err(format!("{width} x {height} pixels are too many: make it smaller"));
    }
    let mut planes = Vec::with_capacity(channels * height * width);
    for line in 0..channels * height {
        if storage == 0 {
            let start = HEADER + line * width;
            let row = bytes.get(start..start + width).ok_or("truncated pixels")?;
            planes.extend_from_slice(row);
        } else {
            let start = word(bytes, HEADER + 4 * line)?;
            let length = word(bytes, HEADER + 4 * (channels * height + line))?;
            let end = start.checked_add(length).ok_or("a row outside the file")?;
            let coded = bytes.get(start..end).ok_or("a row outside the file")?;
            unpack(coded, width, &mut planes)?;
        }
    }
    let plane = |channel: usize, i: usize| planes[channel * width * height + i];
    let rgba = (0..width * height)
        .map(|i| {
            let (column, row) = (i % width, height - 1 - i / width);
            let i = row * width + column;
            match channels {
                1 => [plane(0, i), plane(0, i), plane(0, i), 255],
                2 => [plane(0, i), plane(0, i), plane(0, i), plane(1, i)],
                3 => [plane(0, i), plane(1, i), plane(2, i), 255],
                _ => [plane(0, i), plane(1, i), plane(2, i), plane(3, i)],
            }
        })
        .collect();
    Ok(texture::from_rgba(width, height, rgba, channels % 2 == 0))
}

fn word(bytes: &[u8], at: usize) -> Result<usize, String> {
    let word = bytes.get(at..at + 4).ok_or("truncated row table")?;
    Ok(word.iter().fold(0, |value, &byte| value << 8 | usize::from(byte)))
}

/// One row: a byte n, its high bit set: n & 127 literal bytes follow; clear: the next byte n times; 0 ends.
fn unpack(coded: &[u8], width: usize, pixels: &mut Vec<u8>) -> Result<(), String> {
    let end = pixels.len() + width;
    let mut rest = coded;
    while let Some((&code, tail)) = rest.split_first() {
        let count = usize::from(code & 127);
        if count == 0 {
            break;
        }
        if code & 128 != 0 {
            let literal = tail.get(..count).ok_or("a run past its row")?;
            pixels.extend_from_slice(literal);
            rest = &tail[count..];
        } else {
            let (&value, tail) = tail.split_first().ok_or("a run past its row")?;
            pixels.extend(std::iter::repeat_n(value, count));
            rest = tail;
        }
    }
    if pixels.len() == end {
        Ok(())
    } else {
        Err(format!("a row of another length than {width}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(storage: u8, width: u8, height: u8, channels: u8) -> Vec<u8> {
        let mut bytes = vec![0u8; HEADER];
        bytes[..12].copy_from_slice(&[0x01, 0xda, storage, 1, 0, 3, 0, width, 0, height, 0, channels]);
        bytes
    }

    #[test]
    fn rows_go_from_the_bottom_up_plane_by_plane() {
        let mut bytes = header(0, 2, 2, 3);
        bytes.extend([1, 2, 3, 4, 11, 12, 13, 14, 21, 22, 23, 24]);
        let texture = decode(&bytes).unwrap();
        assert_eq!(texture.image[(0, 0)], [3.0, 13.0, 23.0]);
        assert_eq!(texture.image[(1, 1)], [2.0, 12.0, 22.0]);
        assert!(texture.alpha.is_none());
    }

    #[test]
    fn runs_and_literals() {
        let mut bytes = header(1, 4, 1, 1);
        bytes.extend(520u32.to_be_bytes());
        bytes.extend(6u32.to_be_bytes());
        bytes.extend([3, 7, 0x81, 9, 0, 0]);
        let texture = decode(&bytes).unwrap();
        let grey: Vec<f32> = texture.image.data().iter().map(|p| p[0]).collect();
        assert_eq!(grey, [7.0, 7.0, 7.0, 9.0]);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let mut bytes = header(1, 4, 1, 1);
        bytes.extend(520u32.to_be_bytes());
        bytes.extend(6u32.to_be_bytes());
        bytes.extend([3, 7, 0x81, 9, 0, 0]);
        for length in 2..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length}");
        }
    }
}
