//! What a prepared sequence was made of, so that it is not made twice.

use super::cache::Key;
use super::{Input, PrepareError, PrepareOptions, masks};
use crate::sequence::SequenceError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The contents of an input and the options, in short.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    input: String,
}

/// Its file in the sequence folder.
const FILE: &str = "prepared.json";

impl Stamp {
    /// The stamp of an input as it is now.
    ///
    /// # Errors
    /// An input that cannot be read.
    pub fn new(input: &Path, options: &PrepareOptions) -> Result<Self, PrepareError> {
        let mut files = Input::find(input)?.files();
        if let Some(folder) = &options.masks.given {
            let mut masks: Vec<PathBuf> = std::fs::read_dir(folder)
                .map_err(|problem| PrepareError::Read {
                    file: folder.clone(),
                    problem,
                })?
                .flatten()
                .map(|entry| entry.path())
                .filter(|path| path.is_file())
                .collect();
            masks.sort();
            files.extend(masks);
        }
        if let Some(folder) = &options.masks.networks {
            for beside in masks::descriptions(folder)? {
                files.extend(
                    [beside.with_extension("onnx"), beside]
                        .into_iter()
                        .filter(|file| file.is_file()),
                );
            }
        }
        Ok(Self {
            input: contents(&files)?.and(options).to_string(),
        })
    }

    /// The stamp of a sequence folder; `None` where it has none.
    pub fn load(sequence: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(sequence.join(FILE)).ok()?).ok()
    }

    /// Into a sequence folder.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub fn save(&self, sequence: &Path) -> Result<(), PrepareError> {
        let file = sequence.join(FILE);
        let json = serde_json::to_vec(self).unwrap_or_default();
        std::fs::write(&file, json).map_err(|problem| SequenceError::write(&file, problem))?;
        Ok(())
    }
}

/// A key made of files' names and bytes.
///
/// # Errors
/// A file that cannot be read.
pub fn contents(files: &[PathBuf]) -> Result<Key, PrepareError> {
    let mut key = Key::of("files");
    for file in files {
        let bytes = std::fs::read(file).map_err(|problem| PrepareError::Read {
            file: file.clone(),
            problem,
        })?;
        key = Key::of(&(key, file.file_name(), bytes));
    }
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_tells_contents_and_options_apart() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
        write("a.png", b"a");
        write("b.png", b"b");
        write("notes.txt", b"c");
        let options = PrepareOptions::default();
        let stamp = || Stamp::new(folder.path(), &options).unwrap();
        let first = stamp();
        write("notes.txt", b"d");
        assert_eq!(stamp(), first, "no picture");
        let other = PrepareOptions {
            focal: "500".parse().ok(),
            ..PrepareOptions::default()
        };
        assert_ne!(Stamp::new(folder.path(), &other).unwrap(), first);
        write("b.png", b"e");
        assert_ne!(stamp(), first);
        let sequence = tempfile::tempdir().unwrap();
        assert_eq!(Stamp::load(sequence.path()), None);
        first.save(sequence.path()).unwrap();
        assert_eq!(Stamp::load(sequence.path()), Some(first));
    }
}
