//! Which focal length, and how it is known.

use super::motion::{FREE, FocalEvidence, Motion};
use super::{Photo, PrepareError};
use crate::geometry::Pinhole;
use crate::image::exif_data::FILM_DIAGONAL_MM;
use std::str::FromStr;

/// A focal length as the user gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focal {
    /// In pixels of the pictures as they are given to `prepare`, before they are made smaller.
    Pixels(f64),
    /// Equivalent on 35 mm film.
    Millimetres(f64),
}

impl FromStr for Focal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, millimetres) = match text.strip_suffix("mm") {
            Some(number) => (number, true),
            None => (text.strip_suffix("px").unwrap_or(text), false),
        };
        match number.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(if millimetres {
                Self::Millimetres(value)
            } else {
                Self::Pixels(value)
            }),
            _ => Err("give pixels (1200) or its equivalent on 35 mm film (26mm)".into()),
        }
    }
}

/// The source of a focal length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FocalSource {
    /// The caller gave it.
    Flag,
    /// All pictures' EXIF data give it.
    Exif,
    /// Neither: found with the motion.
    Refined,
}

impl FocalSource {
    /// How well it is known before the features are asked: the standard deviation of its logarithm; 0 holds it, as whoever gives one means it.
    /// EXIF data are rounded, lenses breathe with the distance, and sensors are cropped: of epfl_04, 10 and 16 they are 7 to 10 % too short.
    pub fn deviation(self) -> f64 {
        match self {
            Self::Flag => 0.0,
            Self::Exif => 0.06,
            Self::Refined => FREE,
        }
    }

    /// For people: the focal length of a motion, and what each source said of it.
    pub fn say(self, motion: &Motion, known: Option<FocalEvidence>) -> String {
        let features = motion.focal_by_features;
        let by_features = format!(
            "features {:.0} ± {:.0} %",
            features.px,
            100.0 * features.deviation
        );
        let found = format!("focal length {:.0} px", motion.camera.fx);
        let Some(known) = known else {
            let usual = FocalEvidence::usual(&motion.camera);
            return format!(
                "{found}: usual lenses {:.0} ± {:.0} %, {by_features}; give --focal if you know it",
                usual.px,
                100.0 * usual.deviation
            );
        };
        let mut words = match self {
            Self::Flag => format!("{found} from --focal ({by_features})"),
            _ => format!(
                "{found}: EXIF data {:.0} ± {:.0} %, {by_features}",
                known.px,
                100.0 * known.deviation
            ),
        };
        // What is held is not therefore exact.
        let known = FocalEvidence {
            deviation: known.deviation.max(MIN_FOCAL_DEVIATION),
            ..known
        };
        if features.apart(known) > DOUBTFUL {
            words += ", IN DOUBT: they contradict each other; give --focal if you know it";
        }
        words
    }
}

/// No focal length is known better than this before the features are asked: the standard deviation of its logarithm.
const MIN_FOCAL_DEVIATION: f64 = 0.02;
/// What is known of a focal length and what the features say differ by more of their deviation than this only if one is wrong.
const DOUBTFUL: f64 = 2.0;

/// Where nothing is known, reconstructions start with these focal lengths, in longer sides of the picture, until one has all frames: a usual
/// one, a short tele lens's, a phone's, a tele lens's.
const GUESSES: [f64; 4] = [1.3, 2.6, 0.8, 5.0];

/// The cameras to try, centred, and how their focal length is known.
///
/// # Errors
/// Photos whose EXIF data disagree.
pub fn cameras(photos: &[Photo], flag: Option<Focal>) -> Result<(Vec<Pinhole>, FocalSource), PrepareError> {
    let (width, height) = photos.first().map_or((1, 1), |photo| photo.image.size());
    let (width, height) = (width as f64, height as f64);
    let camera = |focal_px: f64| Pinhole {
        fx: focal_px,
        fy: focal_px,
        cx: width / 2.0,
        cy: height / 2.0,
    };
    if let Some(flag) = flag {
        let focal_px = match flag {
            Focal::Pixels(px) => px * photos.first().map_or(1.0, |photo| photo.scale),
            Focal::Millimetres(mm) => mm / FILM_DIAGONAL_MM * width.hypot(height),
        };
        return Ok((vec![camera(focal_px)], FocalSource::Flag));
    }
    let known: Vec<f64> = photos.iter().filter_map(|photo| photo.focal_px).collect();
    if known.len() == photos.len() && !known.is_empty() {
        let (shortest, longest) = known
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(shortest, longest), &px| {
                (shortest.min(px), longest.max(px))
            });
        if longest > 1.01 * shortest {
            return Err(PrepareError::Option {
                option: "--focal",
                problem: format!("EXIF data say {shortest:.0} to {longest:.0} pixels: the lens was zoomed"),
                mend: "give photos taken with one focal length",
            });
        }
        return Ok((vec![camera(shortest)], FocalSource::Exif));
    }
    let guesses = GUESSES.map(|guess| camera(guess * width.max(height)));
    Ok((guesses.to_vec(), FocalSource::Refined))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn photo(focal_px: Option<f64>) -> Photo {
        Photo {
            name: "a".into(),
            image: Grid::filled(300, 400, [0.0; 3]),
            seconds: None,
            focal_px,
            scale: 0.5,
            origin: crate::prepare::photos::Origin::Video,
        }
    }

    #[test]
    fn a_flag_comes_before_exif_data_and_those_before_guesses() {
        let photos = [photo(Some(500.0)), photo(Some(501.0))];
        let (found, source) = cameras(&photos, Some("1000".parse().unwrap())).unwrap();
        assert_eq!(
            (found[0].fx, found[0].cx, found[0].cy, source),
            (500.0, 150.0, 200.0, FocalSource::Flag)
        );
        // The diagonal is 500 pixels.
        let (found, _) = cameras(&photos, Some("43.2666153mm".parse().unwrap())).unwrap();
        assert!((found[0].fx - 500.0).abs() < 1e-4);
        assert_eq!(cameras(&photos, None).unwrap().1, FocalSource::Exif);
        let (found, source) = cameras(&[photo(None), photo(Some(500.0))], None).unwrap();
        assert_eq!((found.len(), source), (GUESSES.len(), FocalSource::Refined));
    }

    #[test]
    fn zoomed_photos_and_senseless_flags_are_refused() {
        let photos = [photo(Some(500.0)), photo(Some(600.0))];
        let message = cameras(&photos, None).unwrap_err().to_string();
        assert!(message.contains("500 to 600"), "{message}");
        for wrong in ["", "-3", "nanmm", "wide", "0"] {
            assert!(wrong.parse::<Focal>().is_err(), "{wrong}");
        }
    }
}
