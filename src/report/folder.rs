//! The folder that a result is written to, and the names in it.

use super::ReportError;
use crate::files;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Refuses an `out` that exists: call it before the work, so that no solve is lost. What a killed run left of it is removed.
pub fn check_out(out: &Path) -> Result<(), ReportError> {
    files::Staging::remove_stale(out);
    match out.symlink_metadata() {
        Ok(_) => Err(ReportError::OutputExists { path: out.to_owned() }),
        Err(_) => Ok(()),
    }
}

/// A result folder in the making.
pub(super) struct Staging {
    staging: files::Staging,
    out: PathBuf,
}

impl Staging {
    pub(super) fn beside(out: &Path) -> Result<Self, ReportError> {
        check_out(out)?;
        Ok(Self {
            staging: files::Staging::beside(out).map_err(ReportError::io(out))?,
            out: out.to_owned(),
        })
    }

    pub(super) fn path(&self) -> PathBuf {
        self.staging.path().to_owned()
    }

    /// Creates a folder inside.
    pub(super) fn folder(&self, name: &str) -> Result<PathBuf, ReportError> {
        let path = self.path().join(name);
        std::fs::create_dir(&path).map_err(ReportError::io(&path))?;
        Ok(path)
    }

    pub(super) fn text(&self, name: &str, text: &str) -> Result<(), ReportError> {
        let path = self.path().join(name);
        std::fs::write(&path, text).map_err(ReportError::io(&path))
    }

    /// Renames the folder to `out`.
    pub(super) fn publish(self) -> Result<(), ReportError> {
        self.staging.publish().map_err(ReportError::io(&self.out))
    }
}

/// A file name without extension for each frame: its name without the image's extension, anything but letters,
/// digits, `.`, `_` and `-` replaced by `_`, and its index appended where two would be equal.
pub fn file_stems<'a>(frames: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    frames
        .into_iter()
        .enumerate()
        .map(|(index, name)| {
            let stem = match name.rsplit_once('.') {
                Some((stem, extension)) if !stem.is_empty() && is_image(extension) => stem,
                _ => name,
            };
            let safe = |c: char| {
                if c.is_ascii_alphanumeric() || "._-".contains(c) {
                    c
                } else {
                    '_'
                }
            };
            let mut stem: String = stem.chars().map(safe).collect();
            while !taken.insert(stem.clone()) {
                stem = format!("{stem}-{index}");
            }
            stem
        })
        .collect()
}

fn is_image(extension: &str) -> bool {
    ["png", "jpg", "jpeg", "ppm", "bmp", "tif", "tiff"]
        .iter()
        .any(|known| extension.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_are_safe_and_distinct() {
        let stems = file_stems(["a.JPG", "left/a.jpg", "a.png", "00.5", "../x", "left_a"]);
        assert_eq!(stems, ["a", "left_a", "a-2", "00.5", ".._x", "left_a-5"]);
    }
}
