//! What the folders of off-the-shelf tools have in common: `images/`, `masks/`, `times.txt`.

use super::error::SequenceError;
use super::validate::inside;
use crate::files::read_text;
use crate::image::{Pictures, mask_of};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// How well feature-based structure from motion knows its poses, in diagonals of the object. Loose, so that the solver betters them.
pub(super) const MOTION_DEVIATION: f64 = 0.02;

/// `folder/name`, refused where the folder is missing.
pub(super) fn need_folder(workspace: &Path, name: &str, mend: &str) -> Result<PathBuf, SequenceError> {
    let folder = workspace.join(name);
    if folder.is_dir() {
        return Ok(folder);
    }
    Err(SequenceError::Missing {
        file: folder,
        what: "folder".into(),
        mend: mend.into(),
    })
}

/// The image of a registered frame; `name` comes from the reconstruction's own files, Windows's with backslashes.
pub(super) fn image_file(workspace: &Path, name: &str, listed_in: &Path) -> Result<PathBuf, SequenceError> {
    let images = workspace.join("images");
    let file = inside(&images, name, listed_in, "image name")?;
    if name.contains('\\') && !file.is_file() {
        return inside(&images, &name.replace('\\', "/"), listed_in, "image name");
    }
    Ok(file)
}

/// The mask of the image `name`, in `masks/`.
pub(super) fn mask_file(workspace: &Path, name: &str) -> PathBuf {
    let masks = workspace.join("masks");
    let named = mask_of(&masks, name);
    if name.contains('\\') && !named.is_file() {
        return mask_of(&masks, &name.replace('\\', "/"));
    }
    named
}

/// Names of frames from those of their images: without extension where that stays unique.
pub(super) fn frame_names(images: &[&str]) -> Vec<String> {
    let stem = |name: &&str| Path::new(name).with_extension("").to_string_lossy().into_owned();
    let stems: Vec<String> = images.iter().map(stem).collect();
    if stems.iter().collect::<BTreeSet<_>>().len() == stems.len() {
        stems
    } else {
        images.iter().map(|&name| name.to_owned()).collect()
    }
}

/// Says which images in `images/` the reconstruction does not use.
pub(super) fn note_unused_images(workspace: &Path, used: &[&str], notes: &mut Vec<String>) {
    let images = workspace.join("images");
    let (mut all, mut left_out) = (Vec::new(), Vec::new());
    list_images(&images, &mut all, &mut left_out);
    for left_out in left_out {
        notes.push(format!("images/: left out are {left_out}"));
    }
    let used: BTreeSet<PathBuf> = used
        .iter()
        .map(|name| images.join(name.replace('\\', "/")))
        .collect();
    let unused: Vec<String> = all
        .iter()
        .filter(|file| !used.contains(*file))
        .map(|file| {
            file.strip_prefix(&images)
                .unwrap_or(file)
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    if let (Some(first), Some(last)) = (unused.first(), unused.last()) {
        let which = if first == last {
            first.clone()
        } else {
            format!("{first} … {last}")
        };
        notes.push(format!(
            "{} of {} images are not registered and left out ({which})",
            unused.len(),
            all.len()
        ));
    }
}

/// The pictures in a folder and below it, and what is there that is not read.
fn list_images(folder: &Path, found: &mut Vec<PathBuf>, left_out: &mut Vec<String>) {
    if let Ok(pictures) = Pictures::of(folder) {
        left_out.extend(pictures.left_out());
        found.extend(pictures.files);
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut folders: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    for folder in folders {
        list_images(&folder, found, left_out);
    }
}

/// Seconds of each image from `times.txt` (lines `name seconds`, `#` comments); empty where there is no such file.
pub(super) fn times(workspace: &Path) -> Result<BTreeMap<String, f64>, SequenceError> {
    let file = workspace.join("times.txt");
    let mut times = BTreeMap::new();
    if !file.is_file() {
        return Ok(times);
    }
    let text = read_text(&file).map_err(|error| SequenceError::read(&file, error))?;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = |problem: &str| {
            let field = format!("line {}", index + 1);
            SequenceError::invalid(&file, field, problem, "write `name seconds`, each name once")
        };
        let (name, seconds) = line
            .rsplit_once(char::is_whitespace)
            .ok_or_else(|| wrong("not two words"))?;
        let seconds: f64 = seconds.parse().map_err(|_| wrong("its time is no number"))?;
        if !seconds.is_finite() {
            return Err(wrong("its time is not finite"));
        }
        if times.insert(name.trim().to_owned(), seconds).is_some() {
            return Err(wrong("its name was given a time before"));
        }
    }
    Ok(times)
}

/// The time of an image, listed with or without its extension.
pub(super) fn time_of(times: &BTreeMap<String, f64>, image: &str) -> Option<f64> {
    let stem = Path::new(image).with_extension("");
    times
        .get(image)
        .or_else(|| times.get(&*stem.to_string_lossy()))
        .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lose_their_extension_only_where_they_stay_apart() {
        assert_eq!(frame_names(&["a/1.jpg", "b/1.jpg"]), ["a/1", "b/1"]);
        assert_eq!(frame_names(&["1.jpg", "1.png"]), ["1.jpg", "1.png"]);
        assert_eq!(frame_names(&["shot.1.jpg"]), ["shot.1"]);
    }

    #[test]
    fn times_are_read_and_checked() {
        let folder = tempfile::tempdir().unwrap();
        assert!(times(folder.path()).unwrap().is_empty());
        let write = |text: &str| std::fs::write(folder.path().join("times.txt"), text).unwrap();
        write("# name seconds\n\na b.jpg 1.5\nc 2\n");
        let read = times(folder.path()).unwrap();
        assert_eq!(time_of(&read, "a b.jpg"), Some(1.5));
        assert_eq!(time_of(&read, "c.png"), Some(2.0));
        assert_eq!(time_of(&read, "d.png"), None);
        for text in ["a", "a x", "a NaN", "a 1\na 2"] {
            write(text);
            assert!(
                times(folder.path())
                    .unwrap_err()
                    .to_string()
                    .contains("times.txt: line"),
                "{text}"
            );
        }
    }

    #[test]
    fn names_may_have_windowss_slashes() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["images/left", "masks/left"] {
            std::fs::create_dir_all(folder.path().join(name)).unwrap();
        }
        let (image, mask) = (
            folder.path().join("images/left/1.jpg"),
            folder.path().join("masks/left/1.png"),
        );
        std::fs::write(&image, "").unwrap();
        std::fs::write(&mask, "").unwrap();
        let listing = Path::new("images.txt");
        for name in ["left/1.jpg", "left\\1.jpg"] {
            assert_eq!(image_file(folder.path(), name, listing).unwrap(), image);
            assert_eq!(mask_file(folder.path(), name), mask);
        }
        assert!(image_file(folder.path(), "..\\1.jpg", listing).is_err());
        let mut notes = Vec::new();
        note_unused_images(folder.path(), &["left\\1.jpg"], &mut notes);
        assert!(notes.is_empty(), "{notes:?}");
    }

    #[test]
    fn pictures_that_no_one_uses_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("images");
        std::fs::create_dir(&images).unwrap();
        for name in ["a10.jpg", "a9.jpg", "b.heic", "used.png", "._used.png"] {
            std::fs::write(images.join(name), "").unwrap();
        }
        let mut notes = Vec::new();
        note_unused_images(folder.path(), &["used.png"], &mut notes);
        assert!(
            notes[0].contains("1 pictures that are not read (1 .heic)"),
            "{notes:?}"
        );
        assert!(
            notes[1].contains("2 of 3 images") && notes[1].contains("(a9.jpg … a10.jpg)"),
            "{notes:?}"
        );
    }
}
