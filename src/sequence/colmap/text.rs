//! COLMAP's text model: `cameras.txt`, `images.txt`, `points3D.txt`. The counts in the header comments, where there
//! are any, are held against what follows.

use super::camera::{Camera, CameraModel};
use super::model::{Image, Point, pose};
use crate::geometry::Vector3;
use crate::sequence::SequenceError;
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

/// Lines `id MODEL width height parameters…`.
pub(super) fn cameras(text: &str, file: &Path) -> Result<BTreeMap<u32, Camera>, SequenceError> {
    let mut cameras = BTreeMap::new();
    for line in Lines::new(file, text).filter(Line::has_data) {
        let mut words = line.words();
        let id = words.parse("camera id")?;
        let model = CameraModel::by_name(words.next("camera model")?, file)?;
        let size = (words.parse("width")?, words.parse("height")?);
        let parameters = words.rest::<f64>("camera parameters")?;
        let camera = model.camera(size, &parameters).ok_or_else(|| {
            let count = model.parameter_count;
            line.invalid(
                "camera parameters",
                format!("{} numbers, the model has {count}", parameters.len()),
            )
        })?;
        cameras.insert(id, camera);
    }
    check_count(file, text, "cameras", cameras.len())?;
    Ok(cameras)
}

/// Pairs of lines: `id qw qx qy qz tx ty tz camera name`, then `x y point …`, which may be empty.
pub(super) fn images(text: &str, file: &Path) -> Result<Vec<Image>, SequenceError> {
    let mut images = Vec::new();
    let mut lines = Lines::new(file, text);
    while let Some(line) = lines.by_ref().find(Line::has_data) {
        let mut words = line.words();
        let id = words.parse("image id")?;
        let quaternion = words.parse_array("quaternion")?;
        let translation = words.parse_array("translation")?;
        let camera = words.parse("camera id")?;
        let name = words.remainder("image name")?;
        if let Some(observations) = lines.next() {
            observations.check_observations()?;
        }
        images.push(Image {
            id,
            name: name.to_owned(),
            camera,
            camera_from_world: pose(quaternion, translation, file, &line.place("pose"))?,
        });
    }
    check_count(file, text, "images", images.len())?;
    Ok(images)
}

/// Lines `id x y z r g b error (image observation)…`.
pub(super) fn points(text: &str, file: &Path) -> Result<Vec<Point>, SequenceError> {
    let mut points = Vec::new();
    for line in Lines::new(file, text).filter(Line::has_data) {
        let mut words = line.words();
        words.parse::<u64>("point id")?;
        let position = Vector3::from(words.parse_array::<f64, 3>("position")?);
        words.parse_array::<f64, 4>("colour and error")?;
        let track = words.rest::<u32>("track")?;
        if !track.len().is_multiple_of(2) {
            return Err(line.invalid("track", format!("{} numbers, not pairs", track.len())));
        }
        let images = track.iter().step_by(2).copied().collect();
        points.push(Point { position, images });
    }
    check_count(file, text, "points", points.len())?;
    Ok(points)
}

/// Holds a comment such as `# Number of images: 16, mean …` against what was found.
fn check_count(file: &Path, text: &str, what: &str, found: usize) -> Result<(), SequenceError> {
    let prefix = format!("# Number of {what}:");
    let declared = text.lines().find_map(|line| {
        let rest = line.strip_prefix(&prefix)?.trim_start();
        let digits = rest.split(|c: char| !c.is_ascii_digit()).next()?;
        digits.parse::<u64>().ok()
    });
    match declared {
        Some(declared) if declared != found as u64 => Err(SequenceError::CountMismatch {
            file: file.to_owned(),
            field: format!("number of {what}"),
            declared,
            found: found as u64,
            mend: "the file was cut or edited; export it again or correct its header".into(),
        }),
        _ => Ok(()),
    }
}

struct Lines<'a> {
    file: &'a Path,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
}

impl<'a> Lines<'a> {
    fn new(file: &'a Path, text: &'a str) -> Self {
        Self {
            file,
            lines: text.lines().enumerate(),
        }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        let (index, text) = self.lines.next()?;
        Some(Line {
            file: self.file,
            number: index + 1,
            text,
        })
    }
}

#[derive(Clone, Copy)]
struct Line<'a> {
    file: &'a Path,
    number: usize,
    text: &'a str,
}

impl<'a> Line<'a> {
    fn has_data(&self) -> bool {
        let text = self.text.trim_start();
        !text.is_empty() && !text.starts_with('#')
    }

    fn words(&self) -> Words<'a> {
        Words {
            line: *self,
            rest: self.text,
        }
    }

    /// Triples `x y point`; anything else means that the pairs of lines have lost step.
    fn check_observations(&self) -> Result<(), SequenceError> {
        let count = self.words().rest::<f64>("observations")?.len();
        if count.is_multiple_of(3) {
            Ok(())
        } else {
            Err(self.invalid("observations", format!("{count} numbers, not triples")))
        }
    }

    fn place(&self, field: &str) -> String {
        format!("line {}: {field}", self.number)
    }

    fn invalid(&self, field: &str, problem: impl Into<String>) -> SequenceError {
        SequenceError::invalid(self.file, self.place(field), problem, "export the model again")
    }
}

/// The words of a line, taken one by one.
struct Words<'a> {
    line: Line<'a>,
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn next(&mut self, field: &str) -> Result<&'a str, SequenceError> {
        let text = self.rest.trim_start();
        let (word, rest) = text.split_at(text.find(char::is_whitespace).unwrap_or(text.len()));
        self.rest = rest;
        if word.is_empty() {
            Err(self.line.invalid(field, "missing"))
        } else {
            Ok(word)
        }
    }

    fn parse<T: FromStr>(&mut self, field: &str) -> Result<T, SequenceError> {
        let word = self.next(field)?;
        word.parse().map_err(|_| {
            self.line
                .invalid(field, format!("`{}` is no number", word.escape_default()))
        })
    }

    fn parse_array<T: FromStr + Default + Copy, const N: usize>(
        &mut self,
        field: &str,
    ) -> Result<[T; N], SequenceError> {
        let mut values = [T::default(); N];
        for value in &mut values {
            *value = self.parse(field)?;
        }
        Ok(values)
    }

    /// Every word that is left, as numbers.
    fn rest<T: FromStr>(mut self, field: &str) -> Result<Vec<T>, SequenceError> {
        let mut values = Vec::new();
        while !self.rest.trim().is_empty() {
            values.push(self.parse(field)?);
        }
        Ok(values)
    }

    /// What is left as one string: names may hold spaces.
    fn remainder(self, field: &str) -> Result<&'a str, SequenceError> {
        match self.rest.trim() {
            "" => Err(self.line.invalid(field, "missing")),
            name => Ok(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FILE: &str = "images.txt";

    #[test]
    fn names_may_hold_spaces_and_observations_may_be_empty() {
        let text = "# Number of images: 2, mean observations per image: 0\n\
                    7 1 0 0 0 1 2 3 1 my car.jpg\n\n9 1 0 0 0 1 2 3 1 b.jpg";
        let images = images(text, Path::new(FILE)).unwrap();
        assert_eq!((images[0].id, images[0].name.as_str()), (7, "my car.jpg"));
        assert_eq!((images[1].id, images[1].name.as_str()), (9, "b.jpg"));
    }

    #[test]
    fn a_lost_line_is_noticed() {
        let text = "7 1 0 0 0 1 2 3 1 a.jpg\n9 1 0 0 0 1 2 3 1 b.jpg\n";
        let message = images(text, Path::new(FILE)).err().unwrap().to_string();
        assert!(message.contains("images.txt: line 2: observations"), "{message}");
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "[0-9a-z .#\n-]{0,200}") {
            let _ = (cameras(&text, Path::new(FILE)), images(&text, Path::new(FILE)), points(&text, Path::new(FILE)));
        }
    }
}
