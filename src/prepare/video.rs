//! Frames out of a video: upright, of square pixels, with times that rise.

use super::PrepareError;
use super::photos::{Origin, Photo, PhotoOptions, Photos, check_memory, image_of, sharpest, small};
use crate::bridge::vision::ffi::{self, Picture, Video};
use cxx::UniquePtr;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// A duration is no exact count of frames.
const COUNT_TOLERANCE: f64 = 0.02;
/// A header larger than this is not searched.
const MAX_HEADER_BYTES: u64 = 1 << 26;

/// The chosen frames, and what to know of them.
pub(super) fn video(file: &Path, options: &PhotoOptions) -> Result<Photos, PrepareError> {
    let mut notes = Vec::new();
    let mut decoder = open(file)?;
    let announced = decoder.announced();
    let (mut sharpness, mut times) = (Vec::new(), Vec::new());
    let mut picture = Picture::default();
    let mut size = (0, 0);
    while decoder.pin_mut().next(&mut picture)? {
        let kept = small(&picture, options.longest_px)?;
        size = (kept.width, kept.height);
        sharpness.push(ffi::sharpness(&small(&kept, 320)?)?);
        times.push(picture.seconds);
    }
    if let Some(note) = cut_off(sharpness.len(), announced) {
        notes.push(note);
        // Decoders fill up what they have not got of a frame.
        sharpness.pop();
    }
    // Headers alone open, too.
    if sharpness.is_empty() {
        return Err(PrepareError::NoVideo(file.to_owned()));
    }
    let chosen = sharpest(&sharpness, options.max_frames);
    if chosen.len() < 2 {
        return Err(PrepareError::TooFew {
            input: file.to_owned(),
            found: chosen.len(),
            mend: "give a longer video".into(),
        });
    }
    check_memory(chosen.len(), size)?;
    if let Some(transfer) = high_dynamic_range(file) {
        notes.push(format!(
            "it is in HDR ({transfer}), whose colours are taken as they are stored, paler than players show them: export it in SDR"
        ));
    }
    let times = rising(&times);
    let mut photos = Vec::with_capacity(chosen.len());
    let mut decoder = open(file)?;
    let mut number = 0;
    while decoder.pin_mut().next(&mut picture)? {
        if chosen.binary_search(&number).is_ok() {
            let kept = small(&picture, options.longest_px)?;
            photos.push(Photo {
                name: format!("{number:06}"),
                image: image_of(&kept),
                seconds: times.get(number).copied(),
                focal_px: None,
                scale: kept.width as f64 / picture.width as f64,
                origin: Origin::Video,
            });
        }
        number += 1;
    }
    Ok(Photos { photos, notes })
}

fn open(file: &Path) -> Result<UniquePtr<Video>, PrepareError> {
    let video = ffi::open_video(&file.to_string_lossy())?;
    if video.is_null() {
        return Err(PrepareError::NoVideo(file.to_owned()));
    }
    Ok(video)
}

/// What to say where a file ends before the frames that it announces do.
fn cut_off(decoded: usize, announced: f64) -> Option<String> {
    let missing = announced - decoded as f64;
    (announced.is_finite() && missing >= 1.0 && missing > COUNT_TOLERANCE * announced).then(|| {
        format!(
            "only {decoded} of the {announced:.0} frames that the file announces can be decoded, of which the last, which may be \
             partial, is left out: the video is cut off or damaged"
        )
    })
}

/// Seconds since the first frame. OpenCV gives the last frames of a stream with frames between others the time 0.
fn rising(times: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|step| step.is_finite() && *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    // Without any time, frames are counted.
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
    let mut risen: Vec<f64> = Vec::with_capacity(times.len());
    let first = times.first().copied().unwrap_or(0.0);
    for &time in times {
        let time = time - first;
        risen.push(match risen.last() {
            None => 0.0,
            Some(&before) if time.is_finite() && time > before => time,
            Some(&before) => before + usual,
        });
    }
    risen
}

/// The name of an HDR video's transfer function, as the containers of phones (MP4, MOV) tell it.
fn high_dynamic_range(file: &Path) -> Option<&'static str> {
    let header = movie_header(file)?;
    let at = header.windows(8).position(|bytes| bytes == b"colrnclx")?;
    // u16 primaries, u16 transfer function, as in ITU-T H.273.
    match header.get(at + 10..at + 12)? {
        [0, 16] => Some("PQ"),
        [0, 18] => Some("HLG"),
        _ => None,
    }
}

/// The bytes of the box `moov`.
fn movie_header(file: &Path) -> Option<Vec<u8>> {
    let mut file = File::open(file).ok()?;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head).ok()?;
        let [a, b, c, d, name @ ..] = head;
        let (mut length, mut own) = (u64::from(u32::from_be_bytes([a, b, c, d])), 8);
        if length == 1 {
            let mut long = [0; 8];
            file.read_exact(&mut long).ok()?;
            (length, own) = (u64::from_be_bytes(long), 16);
        }
        let rest = length.checked_sub(own)?;
        if &name == b"moov" {
            let mut bytes = Vec::new();
            file.take(rest.min(MAX_HEADER_BYTES))
                .read_to_end(&mut bytes)
                .ok()?;
            return Some(bytes);
        }
        file.seek(SeekFrom::Current(i64::try_from(rest).ok()?)).ok()?;
    }
}

#[cfg(test)]
#[path = "../../tests/all/fixture/movie.rs"]
mod movie;

#[cfg(test)]
mod tests {
    use super::movie::{Shown, movie};
    use super::*;

    const UPRIGHT: Shown = Shown {
        clockwise_deg: 0,
        pixel: (1, 1),
    };

    /// A film of 64 × 48 pixels whose upper left quarter is white.
    fn film(frames: usize, shown: Shown) -> Vec<u8> {
        let frame = image::RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb([if x < 32 && y < 24 { 250 } else { 5 }; 3])
        });
        let mut jpeg = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95)
            .encode_image(&frame)
            .unwrap();
        movie(&vec![jpeg; frames], (64, 48), shown)
    }

    fn read(bytes: &[u8]) -> Result<Photos, PrepareError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mov");
        std::fs::write(&file, bytes).unwrap();
        video(&file, &PhotoOptions::default())
    }

    #[test]
    fn frames_are_as_players_show_them() {
        // Which quarter is white once a player has turned the film: 0 upper left, 1 upper right, 2 lower left, 3 lower right.
        for (clockwise_deg, pixel, size, quarter) in [
            (0, (1, 1), (64, 48), 0),
            (90, (1, 1), (48, 64), 1),
            (180, (1, 1), (64, 48), 3),
            (270, (1, 1), (48, 64), 2),
            (0, (4, 3), (85, 48), 0),
            (90, (1, 2), (96, 64), 1),
        ] {
            let Photos { photos, notes } = read(&film(6, Shown { clockwise_deg, pixel })).unwrap();
            let image = &photos[0].image;
            assert_eq!(
                (photos.len(), image.size()),
                (6, size),
                "{clockwise_deg} {pixel:?}"
            );
            assert!(notes.is_empty(), "{notes:?}");
            let (width, height) = size;
            for (place, (x, y)) in [(1, 1), (3, 1), (1, 3), (3, 3)].into_iter().enumerate() {
                let bright = image[(x * width / 4, y * height / 4)][0] > 128.0;
                assert_eq!(bright, place == quarter, "{clockwise_deg} {pixel:?} {place}");
            }
            let times: Vec<_> = photos.iter().filter_map(|photo| photo.seconds).collect();
            assert_eq!(times, [0.0, 0.25, 0.5, 0.75, 1.0, 1.25]);
        }
    }

    #[test]
    fn a_film_that_is_cut_off_loses_its_last_frame_and_says_so() {
        let bytes = film(8, UPRIGHT);
        let frame = (bytes.len() - film(0, UPRIGHT).len()) / 8;
        let Photos { photos, notes } = read(&bytes[..bytes.len() - 5 * frame / 2]).unwrap();
        assert!(
            notes[0].contains("of the 8 frames") && notes[0].contains("cut off"),
            "{notes:?}"
        );
        assert!((4..=5).contains(&photos.len()), "{}", photos.len());
        assert!(matches!(read(&bytes[..200]), Err(PrepareError::NoVideo(_))));
    }

    #[test]
    fn times_rise_to_the_last_frame() {
        assert_eq!(
            rising(&[5.0, 5.25, 5.75, 6.0, 0.0, 0.0]),
            [0.0, 0.25, 0.75, 1.0, 1.25, 1.5]
        );
        assert_eq!(rising(&[0.0; 3]), [0.0, 1.0, 2.0]);
        assert_eq!(rising(&[0.0, 0.5, f64::NAN]), [0.0, 0.5, 1.0]);
        assert!(rising(&[]).is_empty());
    }

    #[test]
    fn a_file_with_fewer_frames_than_it_announces_is_cut_off() {
        for (decoded, announced) in [
            (10, 10.0),
            (10, 0.0),
            (10, -9e18),
            (10, f64::NAN),
            (11, 10.0),
            (990, 1000.0),
        ] {
            assert_eq!(cut_off(decoded, announced), None, "{decoded} {announced}");
        }
        assert!(cut_off(9, 10.0).unwrap().contains("only 9 of the 10 frames"));
    }

    #[test]
    fn the_transfer_function_is_found_in_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mp4");
        let told = |transfer: u8, header: &[u8]| {
            let colour = [&b"....colrnclx"[..], &[0, 9, 0, transfer, 0, 9, 0]].concat();
            let moov = [&(8 + colour.len() as u32).to_be_bytes()[..], b"moov", &colour].concat();
            std::fs::write(&file, [header, &moov].concat()).unwrap();
            high_dynamic_range(&file)
        };
        let data = [&16u32.to_be_bytes()[..], b"mdatcolrnclx"].concat();
        let long = [&1u32.to_be_bytes()[..], b"mdat", &17u64.to_be_bytes(), b"x"].concat();
        assert_eq!(told(16, b""), Some("PQ"));
        assert_eq!(told(18, &data), Some("HLG"));
        assert_eq!(told(1, &long), None);
        std::fs::write(&file, [&[0u8; 3][..], b"no movie"].concat()).unwrap();
        assert_eq!(high_dynamic_range(&file), None);
    }
}
