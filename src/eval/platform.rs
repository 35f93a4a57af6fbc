//! What is known of a turning platform: `turn.txt` (keys and values) and `times.txt` (image, seconds).

use super::{TurnErrors, against_turn};
use crate::geometry::Rotation3;
use crate::sequence::same_frame;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The platform turns at a constant rate; image i was taken `seconds` after the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Platform {
    /// The time of one full turn, seconds.
    pub full_turn_s: f64,
    /// +1 or −1. Only the sign of the fitted axis depends on it.
    pub sense: f64,
    /// Each image's name and time in seconds, in the file's order.
    pub times: Vec<(String, f64)>,
}

/// Why the files that describe a turning platform cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlatformError {
    /// A file cannot be read.
    #[error("{}: {problem}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        problem: std::io::Error,
    },
    /// A file lacks a value or holds one that is out of range.
    #[error("{}: {message}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The line or key, what is wrong and how to mend it.
        message: String,
    },
}

impl Platform {
    /// Reads a platform from `turn.txt` (`turn`) and `times.txt` (`times`), as docs/formats.md describes them.
    ///
    /// # Errors
    /// A file that cannot be read, or a value that is missing or out of range.
    pub fn load(turn: &Path, times: &Path) -> Result<Self, PlatformError> {
        let read = |path: &Path| {
            crate::files::read_text(path).map_err(|problem| PlatformError::Io {
                path: path.to_owned(),
                problem,
            })
        };
        let invalid = |path: &Path| {
            let path = path.to_owned();
            move |message| PlatformError::Invalid { path, message }
        };
        let (full_turn_s, sense) = parse_turn(&read(turn)?).map_err(invalid(turn))?;
        Ok(Self {
            full_turn_s,
            sense,
            times: parse_times(&read(times)?).map_err(invalid(times))?,
        })
    }

    /// When an image was taken; names may lack their extension.
    pub fn time_of(&self, image: &str) -> Option<f64> {
        let exact = self.times.iter().find(|(name, _)| name == image);
        let by_stem = || self.times.iter().find(|(name, _)| same_frame(name, image));
        exact.or_else(by_stem).map(|&(_, seconds)| seconds)
    }
}

impl Platform {
    /// How far each frame's `camera_from_object` rotation is from the platform's turn since the first of them, which
    /// the timestamps tell; see [`against_turn`].
    ///
    /// # Errors
    /// A frame without a time, or poses that do not turn.
    pub fn errors(&self, rotations: &[(String, Rotation3<f64>)]) -> Result<TurnTable, TurnError> {
        let seconds: Vec<f64> = rotations
            .iter()
            .map(|(name, _)| self.time_of(name).ok_or_else(|| TurnError::NoTime(name.clone())))
            .collect::<Result<_, _>>()?;
        let start = seconds.first().ok_or(TurnError::Still)?;
        let turn = self.sense * std::f64::consts::TAU / self.full_turn_s;
        let angles: Vec<_> = seconds.iter().map(|time| turn * (time - start)).collect();
        let matrices: Vec<_> = rotations.iter().map(|(_, rotation)| *rotation).collect();
        Ok(TurnTable {
            frames: rotations.iter().map(|(name, _)| name.clone()).collect(),
            platform_deg: angles.iter().map(|angle| angle.to_degrees()).collect(),
            errors: against_turn(&matrices, &angles).ok_or(TurnError::Still)?,
        })
    }
}

/// [`TurnErrors`] with the frames' names and the platform's angles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TurnTable {
    /// The frames' names, in order.
    pub frames: Vec<String>,
    /// The angle by which the platform turned since the first of `frames`, degrees, signed by its sense; one per frame.
    pub platform_deg: Vec<f64>,
    /// The rotation errors of `frames`, and the fitted axis.
    #[serde(flatten)]
    pub errors: TurnErrors,
}

/// Why rotations cannot be compared with the platform's.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum TurnError {
    /// A frame is not in the list of times. The field is the frame's name.
    #[error("frame {0} is not in the times; add its line")]
    NoTime(String),
    /// The rotations do not determine an axis: there are fewer than three, or they are all alike.
    #[error("the poses do not turn; at least three frames with rotation between them are needed")]
    Still,
}

fn parse_turn(text: &str) -> Result<(f64, f64), String> {
    let value = |key: &str| {
        lines(text)
            .find_map(|(_, line)| line.strip_prefix(key)?.strip_prefix(char::is_whitespace))
            .map(str::trim)
    };
    let full_turn = value("full_turn_seconds").ok_or("no full_turn_seconds; add one full turn's duration")?;
    let seconds = full_turn
        .parse::<f64>()
        .ok()
        .filter(|seconds| seconds.is_finite() && *seconds > 0.0);
    let seconds = seconds.ok_or(format!(
        "full_turn_seconds is {full_turn}; it must be a positive number"
    ))?;
    match value("sense").unwrap_or("1") {
        "1" | "+1" => Ok((seconds, 1.0)),
        "-1" => Ok((seconds, -1.0)),
        other => Err(format!("sense is {other}; it must be 1 or -1")),
    }
}

fn parse_times(text: &str) -> Result<Vec<(String, f64)>, String> {
    lines(text)
        .map(|(number, line)| {
            let (name, seconds) = line.rsplit_once(char::is_whitespace).unwrap_or((line, ""));
            match seconds.parse::<f64>() {
                Ok(seconds) if seconds.is_finite() => Ok((name.trim().to_owned(), seconds)),
                _ => Err(format!("line {number}: `{line}` is not `image seconds`")),
            }
        })
        .collect()
}

/// (number from 1, text) of the lines that hold something.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..)
        .zip(text.lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_keys_and_times() {
        let turn = "# a turn\nfull_turn_seconds 118\nsense -1\nfocal_length_mm 19.0\n";
        assert_eq!(parse_turn(turn), Ok((118.0, -1.0)));
        let times = parse_times("# image seconds\na b.jpg 0\nc.jpg\t2.5\n").unwrap();
        assert_eq!(times, [("a b.jpg".to_owned(), 0.0), ("c.jpg".to_owned(), 2.5)]);
        let platform = Platform {
            full_turn_s: 118.0,
            sense: 1.0,
            times,
        };
        assert_eq!(platform.time_of("c.jpg"), Some(2.5));
        assert_eq!(platform.time_of("c"), Some(2.5));
        assert_eq!(platform.time_of("d.jpg"), None);
    }

    #[test]
    fn faults_name_field_and_mend() {
        assert!(parse_turn("sense 1").unwrap_err().contains("full_turn_seconds"));
        assert!(
            parse_turn("full_turn_seconds 0")
                .unwrap_err()
                .contains("positive")
        );
        assert!(
            parse_turn("full_turn_seconds 9\nsense 2")
                .unwrap_err()
                .contains("1 or -1")
        );
        assert!(parse_times("a.jpg 0\nb.jpg x").unwrap_err().contains("line 2"));
    }
}
