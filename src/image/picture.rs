//! PNG and JPEG files as a viewer shows them: whole, turned upright, and what is transparent on white.

use super::{ImageError, one_line};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, Rgb, RgbImage as Pixels};
use std::io::Cursor;
use std::path::Path;

/// No picture may take more memory than this once decoded: 2³⁰ bytes are 350 million pixels of 8-bit colour.
const MAX_BYTES: u64 = 1 << 30;
/// A byte of a JPEG holds no more pixels than this: each block of 64 takes a bit for its mean at least, and twice as many are allowed.
const JPEG_PIXELS_PER_BYTE: u64 = 1024;

/// A picture with its pixels as they lie in the file.
pub(crate) struct PictureFile {
    pub pixels: DynamicImage,
    pub turn: Turn,
}

/// How a viewer turns and mirrors a picture before it is shown (EXIF's orientation).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Turn(Orientation);

impl Default for Turn {
    fn default() -> Self {
        Self(Orientation::NoTransforms)
    }
}

impl Turn {
    /// Whether the picture is upright as it is.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    /// Whether width and height change places.
    pub fn swaps_sides(self) -> bool {
        matches!(
            self.0,
            Orientation::Rotate90
                | Orientation::Rotate270
                | Orientation::Rotate90FlipH
                | Orientation::Rotate270FlipH
        )
    }

    pub(crate) fn apply(self, mut pixels: DynamicImage) -> DynamicImage {
        pixels.apply_orientation(self.0);
        pixels
    }
}

impl PictureFile {
    /// Reads a PNG or JPEG, told by content, not by name.
    pub fn read(file: &Path) -> Result<Self, ImageError> {
        let bytes = std::fs::read(file).map_err(|error| ImageError::read(file, error))?;
        Self::decode(&bytes).map_err(|reason| ImageError::Decode {
            file: file.to_owned(),
            reason,
        })
    }

    /// The picture in `bytes`, or what is wrong with it.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let reader = image::ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| one_line(&error.to_string()))?;
        // Decoders fill up what a cut-off JPEG lacks with grey.
        let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
        if is_jpeg && is_cut_off(bytes) {
            return Err("the file ends before its picture does".into());
        }
        let told = |error: image::ImageError| one_line(&error.to_string());
        let mut decoder = reader.into_decoder().map_err(told)?;
        let (width, height) = decoder.dimensions();
        if decoder.total_bytes() > MAX_BYTES {
            return Err(format!("{width} × {height} pixels are too many"));
        }
        if is_jpeg && u64::from(width) * u64::from(height) > JPEG_PIXELS_PER_BYTE * bytes.len() as u64 {
            return Err(format!("{} bytes hold no {width} × {height} pixels", bytes.len()));
        }
        let turn = Turn(decoder.orientation().map_err(told)?);
        let pixels = DynamicImage::from_decoder(decoder).map_err(told)?;
        Ok(Self { pixels, turn })
    }

    /// The picture as a viewer shows it: turned and mirrored.
    pub fn upright(self) -> DynamicImage {
        self.turn.apply(self.pixels)
    }
}

/// Width and height of the picture in a file, as it is shown, without decoding it.
pub(crate) fn dimensions(file: &Path) -> Option<(usize, usize)> {
    let mut decoder = image::ImageReader::open(file)
        .ok()?
        .with_guessed_format()
        .ok()?
        .into_decoder()
        .ok()?;
    let (width, height) = decoder.dimensions();
    let swapped = Turn(decoder.orientation().ok()?).swaps_sides();
    let (width, height) = if swapped { (height, width) } else { (width, height) };
    Some((width as usize, height as usize))
}

/// 8-bit colours; what is transparent is shown on white.
pub(crate) fn colours(pixels: DynamicImage) -> Pixels {
    if !pixels.color().has_alpha() {
        return pixels.into_rgb8();
    }
    let pixels = pixels.into_rgba8();
    Pixels::from_fn(pixels.width(), pixels.height(), |x, y| {
        let [colour @ .., alpha] = pixels.get_pixel(x, y).0;
        let alpha = u16::from(alpha);
        // Rounded; a full alpha leaves the colour as it is.
        Rgb(colour.map(|c| ((u16::from(c) * alpha + 255 * (255 - alpha) + 127) / 255) as u8))
    })
}

/// Whether a JPEG ends before its end-of-image marker.
fn is_cut_off(bytes: &[u8]) -> bool {
    const END_OF_IMAGE: u8 = 0xd9;
    let mut at = 2;
    loop {
        // The next marker: 0xff and what is neither a stuffed zero, filling, nor a restart within a scan.
        let rest = bytes.get(at..).unwrap_or_default();
        let marker = rest
            .windows(2)
            .position(|pair| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0x01 | 0xd0..=0xd8 | 0xff));
        let Some(marker) = marker else { return true };
        at += marker + 2;
        if bytes[at - 1] == END_OF_IMAGE {
            return false;
        }
        let Some(&[high, low]) = bytes.get(at..at + 2) else {
            return true;
        };
        at += usize::from(u16::from_be_bytes([high, low])).max(2);
    }
}

/// A JPEG whose left half is bright, with these EXIF data.
#[cfg(test)]
pub(crate) fn exif_jpeg((width, height): (u32, u32), fields: &[(exif::Tag, exif::Value)]) -> Vec<u8> {
    let mut jpeg = Vec::new();
    let lying = Pixels::from_fn(
        width,
        height,
        |x, _| Rgb([if x < width / 2 { 250 } else { 5 }; 3]),
    );
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95)
        .encode_image(&lying)
        .unwrap();
    let fields: Vec<exif::Field> = fields
        .iter()
        .map(|(tag, value)| exif::Field {
            tag: *tag,
            ifd_num: exif::In::PRIMARY,
            value: value.clone(),
        })
        .collect();
    let mut writer = exif::experimental::Writer::new();
    fields.iter().for_each(|field| writer.push_field(field));
    let mut data = Cursor::new(Vec::new());
    writer.write(&mut data, false).unwrap();
    let segment = [b"Exif\0\0".to_vec(), data.into_inner()].concat();
    let length = (segment.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &segment, &jpeg[2..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jpeg(width: u32, height: u32, orientation: u16) -> Vec<u8> {
        let value = exif::Value::Short(vec![orientation]);
        exif_jpeg((width, height), &[(exif::Tag::Orientation, value)])
    }

    #[test]
    fn pictures_are_upright() {
        let picture = PictureFile::decode(&jpeg(32, 16, 6)).unwrap();
        assert!(picture.turn.swaps_sides());
        let upright = colours(picture.upright());
        assert_eq!(upright.dimensions(), (16, 32));
        // What lay left is up.
        assert!(upright.get_pixel(8, 3).0[0] > 200 && upright.get_pixel(8, 28).0[0] < 50);
    }

    #[test]
    fn a_jpeg_cut_off_anywhere_is_noticed() {
        let whole = jpeg(32, 16, 1);
        assert!(PictureFile::decode(&whole).is_ok());
        // Cameras append what they like.
        assert!(PictureFile::decode(&[&whole[..], b"trailer"].concat()).is_ok());
        for length in 4..whole.len() {
            assert!(PictureFile::decode(&whole[..length]).is_err(), "{length}");
            // What a download that stopped leaves of a file that was made at its full size.
            let mut blank = whole[..length].to_vec();
            blank.resize(whole.len() + 2, 0);
            assert!(PictureFile::decode(&blank).is_err(), "{length}");
        }
    }

    #[test]
    fn what_is_transparent_is_white() {
        let picture = image::RgbaImage::from_vec(3, 1, vec![9, 8, 7, 255, 9, 8, 7, 0, 0, 0, 0, 128]).unwrap();
        let shown = colours(picture.into());
        assert_eq!(shown.into_raw(), [9, 8, 7, 255, 255, 255, 127, 127, 127]);
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused_before_memory_is_taken() {
        let mut png = Vec::new();
        let encoder = image::codecs::png::PngEncoder::new(&mut png);
        image::ImageEncoder::write_image(encoder, &[0; 3], 1, 1, image::ExtendedColorType::Rgb8).unwrap();
        // IHDR: width and height from byte 16, the checksum of the chunk at 29.
        png[16..24].copy_from_slice(&[0, 0, 0x7f, 0xff, 0, 0, 0x7f, 0xff]);
        let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        let message = PictureFile::decode(&png).err().unwrap();
        assert!(message.contains("32767"), "{message}");
    }

    #[test]
    fn a_jpeg_that_cannot_hold_its_pixels_is_refused_before_the_work() {
        let mut jpeg = jpeg(32, 16, 1);
        let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
        // Height and width, after marker, length and precision.
        jpeg[frame + 5..frame + 9].copy_from_slice(&[0x40, 0, 0x40, 0]);
        let message = PictureFile::decode(&jpeg).err().unwrap();
        assert!(message.contains("hold no 16384 × 16384 pixels"), "{message}");
    }
}
