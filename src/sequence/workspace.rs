//! What the folders of off-the-shelf tools have in common: `images/`, `masks/`, `times.txt`.

use super::error::SequenceError;
use super::validate::inside;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const IMAGE_EXTENSIONS: [&str; 3] = ["jpg", "jpeg", "png"];

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

/// The image of a registered frame; `name` comes from the reconstruction's own files.
pub(super) fn image_file(workspace: &Path, name: &str, listed_in: &Path) -> Result<PathBuf, SequenceError> {
    inside(&workspace.join("images"), name, listed_in, "image name")
}

/// `masks/<name>.png`, with the image's extension kept or dropped; the former where neither exists.
pub(super) fn mask_file(workspace: &Path, name: &str) -> PathBuf {
    let masks = workspace.join("masks");
    let kept = masks.join(format!("{name}.png"));
    let dropped = masks.join(Path::new(name).with_extension("png"));
    if !kept.is_file() && dropped.is_file() {
        dropped
    } else {
        kept
    }
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
    let mut all = Vec::new();
    list_images(&images, &mut all);
    let used: BTreeSet<PathBuf> = used.iter().map(|name| images.join(name)).collect();
    let mut unused: Vec<String> = all
        .iter()
        .filter(|file| !used.contains(*file))
        .map(|file| {
            file.strip_prefix(&images)
                .unwrap_or(file)
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    unused.sort();
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

fn list_images(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if path.is_dir() {
            list_images(&path, found);
        } else if extension.is_some_and(|e| IMAGE_EXTENSIONS.contains(&e.as_str())) {
            found.push(path);
        }
    }
}

/// Seconds of each image from `times.txt` (lines `name seconds`, `#` comments); empty where there is no such file.
pub(super) fn times(workspace: &Path) -> Result<BTreeMap<String, f64>, SequenceError> {
    let file = workspace.join("times.txt");
    let mut times = BTreeMap::new();
    if !file.is_file() {
        return Ok(times);
    }
    let text = std::fs::read_to_string(&file).map_err(|source| SequenceError::read(&file, source))?;
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
    fn masks_are_found_by_either_name() {
        let folder = tempfile::tempdir().unwrap();
        let masks = folder.path().join("masks");
        std::fs::create_dir(&masks).unwrap();
        assert_eq!(mask_file(folder.path(), "a.jpg"), masks.join("a.jpg.png"));
        std::fs::write(masks.join("a.png"), "").unwrap();
        assert_eq!(mask_file(folder.path(), "a.jpg"), masks.join("a.png"));
        std::fs::write(masks.join("a.jpg.png"), "").unwrap();
        assert_eq!(mask_file(folder.path(), "a.jpg"), masks.join("a.jpg.png"));
    }
}
