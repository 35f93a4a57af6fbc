//! What EXIF data say of a photo's lens and time.

use exif::{Exif, In, Tag};
use std::io::Cursor;

/// Diagonal of 35 mm film, in millimetres.
pub(crate) const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;
/// Sensor widths in millimetres; a model's name as EXIF data have it.
const SENSOR_WIDTHS: [(&str, f64); 6] = [
    ("NIKON D70", 23.7),
    ("NIKON D80", 23.6),
    ("NIKON D90", 23.6),
    ("Canon EOS 300D", 22.7),
    ("Canon EOS 400D", 22.2),
    ("Canon EOS 5D", 35.8),
];

/// The focal length in pixels of a picture of this size.
pub(crate) fn focal_px(exif: &Exif, width: usize, height: usize) -> Option<f64> {
    let number = |tag| match &exif.get_field(tag, In::PRIMARY)?.value {
        exif::Value::Rational(values) => values.first().map(exif::Rational::to_f64),
        value => value.get_uint(0).map(f64::from),
    };
    let positive = |value: &f64| value.is_finite() && *value > 0.0;
    // The 35 mm equivalent is rounded to millimetres; a known sensor is better.
    let sensor_mm = exif.get_field(Tag::Model, In::PRIMARY).and_then(|model| {
        let model = model.display_value().to_string();
        SENSOR_WIDTHS
            .iter()
            .find(|(known, _)| model.contains(known))
            .map(|(_, mm)| mm)
    });
    if let Some((focal_mm, sensor_mm)) = number(Tag::FocalLength).filter(positive).zip(sensor_mm) {
        return Some(focal_mm / sensor_mm * width.max(height) as f64);
    }
    let equivalent = number(Tag::FocalLengthIn35mmFilm).filter(positive)?;
    Some(equivalent / FILM_DIAGONAL_MM * (width as f64).hypot(height as f64))
}

/// When a photo was taken; of use only as a difference.
pub(crate) fn seconds(exif: &Exif) -> Option<u64> {
    let exif::Value::Ascii(texts) = &exif.get_field(Tag::DateTimeOriginal, In::PRIMARY)?.value else {
        return None;
    };
    let taken = exif::DateTime::from_ascii(texts.first()?).ok()?;
    let days = days_since_march_0000(
        u64::from(taken.year),
        u64::from(taken.month),
        u64::from(taken.day),
    );
    let whole =
        86_400 * days + 3600 * u64::from(taken.hour) + 60 * u64::from(taken.minute) + u64::from(taken.second);
    Some(whole)
}

/// Days of the Gregorian calendar, counted from a 1 March, so that leap days end a year.
fn days_since_march_0000(year: u64, month: u64, day: u64) -> u64 {
    let (year, month) = if month < 3 {
        (year.saturating_sub(1), month + 9)
    } else {
        (year, month - 3)
    };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day
}

/// The EXIF data in a picture's bytes, as far as they can be read: programs that edit them leave broken tables behind. `None` where
/// there are none.
pub(crate) fn read(bytes: &[u8]) -> Option<Exif> {
    exif::Reader::new()
        .continue_on_error(true)
        .read_from_container(&mut Cursor::new(bytes))
        .or_else(|error| error.distill_partial_result(|_| {}))
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_go_on_across_months_leap_days_and_years() {
        let days = |y, m, d| days_since_march_0000(y, m, d);
        for ((y, m, d), (y2, m2, d2)) in [
            ((2024, 2, 29), (2024, 3, 1)),
            ((2023, 2, 28), (2023, 3, 1)),
            ((2023, 12, 31), (2024, 1, 1)),
            ((2024, 4, 30), (2024, 5, 1)),
        ] {
            assert_eq!(days(y, m, d) + 1, days(y2, m2, d2), "{y}-{m}-{d}");
        }
    }
}
