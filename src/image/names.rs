//! Which files of a folder are pictures, in which order, and where their masks are.

use super::ImageError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Endings of what is read here.
const READ: [&str; 3] = ["png", "jpg", "jpeg"];
/// Endings of pictures of other formats, as cameras and tools write them.
const OTHERS: [&str; 25] = [
    "heic", "heif", "hif", "tif", "tiff", "webp", "bmp", "gif", "avif", "jxl", "jp2", "dng", "cr2", "cr3",
    "nef", "arw", "raf", "orf", "rw2", "exr", "hdr", "ppm", "pgm", "pnm", "tga",
];

/// The pictures of a folder.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    /// PNG and JPEG, numbers in names by their value.
    pub files: Vec<PathBuf>,
    /// How many there are of each other ending.
    others: BTreeMap<String, usize>,
}

impl Pictures {
    /// Those in `folder` itself. Hidden files are none: macOS puts `._a.jpg` beside `a.jpg`.
    pub fn of(folder: &Path) -> Result<Self, ImageError> {
        let mut found = Self::default();
        for entry in std::fs::read_dir(folder).map_err(|error| ImageError::read(folder, error))? {
            let file = entry.map_err(|error| ImageError::read(folder, error))?.path();
            let (name, ending) = (lossy(file.file_name()), lossy(file.extension()).to_lowercase());
            if name.starts_with('.') || !file.is_file() {
                continue;
            }
            if READ.contains(&&*ending) {
                found.files.push(file);
            } else if OTHERS.contains(&&*ending) {
                *found.others.entry(ending).or_default() += 1;
            }
        }
        found
            .files
            .sort_by_cached_key(|file| natural_key(&lossy(file.file_name())));
        Ok(found)
    }

    /// What is there and is not read, with its mend.
    pub fn left_out(&self) -> Option<String> {
        let count: usize = self.others.values().sum();
        let kinds: Vec<_> = self
            .others
            .iter()
            .map(|(ending, count)| format!("{count} .{ending}"))
            .collect();
        let kinds = kinds.join(", ");
        (count > 0)
            .then(|| format!("{count} pictures that are not read ({kinds}): convert them to JPEG or PNG"))
    }
}

fn lossy(name: Option<&std::ffi::OsStr>) -> String {
    name.unwrap_or_default().to_string_lossy().into_owned()
}

/// A key that sorts numbers in names by their value: frame2 before frame10; and names apart that differ in zeros alone.
pub(crate) fn natural_key(name: &str) -> (Vec<(u64, String)>, String) {
    let mut key = vec![(0u64, String::new())];
    let mut digits = false;
    for letter in name.chars() {
        if letter.is_ascii_digit() != digits {
            digits = letter.is_ascii_digit();
            if digits {
                key.push((0, String::new()));
            }
        }
        let last = key.len() - 1;
        match letter.to_digit(10) {
            Some(digit) => key[last].0 = key[last].0.saturating_mul(10).saturating_add(u64::from(digit)),
            None => key[last].1.push(letter),
        }
    }
    (key, name.to_owned())
}

/// Where a picture's mask is: below `folder`, under the picture's name with `.png` added (`a.jpg.png`) or instead of its own ending
/// (`a.png`), else likewise with `.jpg`. `name` is the picture's, with its own folders, with or without its ending. A file that does
/// not exist where there is no mask.
pub fn mask_of(folder: &Path, name: &str) -> PathBuf {
    let below = folder.join(name);
    let (Some(beside), own) = (below.parent(), lossy(below.file_name())) else {
        return below;
    };
    let is_picture = |ending: &str| {
        let ending = ending.to_lowercase();
        READ.contains(&&*ending) || OTHERS.contains(&&*ending)
    };
    let without_ending = |name: &str| match name.rsplit_once('.') {
        Some((stem, ending)) if is_picture(ending) => Some(stem.to_owned()),
        _ => None,
    };
    let stem = without_ending(&own).unwrap_or_else(|| own.clone());
    // The lowest is the mask: (format, whether the picture's ending is missing, name).
    let rank = |candidate: String| {
        let (mask_stem, ending) = candidate.rsplit_once('.')?;
        let format = READ.iter().position(|known| ending.eq_ignore_ascii_case(known))?;
        let added = if stem == own {
            without_ending(mask_stem).is_some_and(|inner| inner == stem)
        } else {
            mask_stem == own
        };
        let belongs = added || mask_stem == stem;
        belongs.then_some((format, !added, candidate))
    };
    let entries = std::fs::read_dir(beside).into_iter().flatten().flatten();
    let best = entries
        .filter_map(|entry| rank(entry.file_name().into_string().ok()?))
        .min();
    beside.join(best.map_or_else(|| format!("{own}.png"), |(_, _, name)| name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        folder
    }

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["f10.png", "f2.png", "a3_1.png", "f2b.png", "f02.png"];
        names.sort_by_cached_key(|name| natural_key(name));
        assert_eq!(names, ["a3_1.png", "f02.png", "f2.png", "f2b.png", "f10.png"]);
    }

    #[test]
    fn other_formats_are_counted_and_hidden_files_are_not() {
        let folder = folder(&[
            "p10.JPG",
            "p9.png",
            "._p9.png",
            "a.HEIC",
            "b.heic",
            "c.tif",
            "notes.txt",
        ]);
        let pictures = Pictures::of(folder.path()).unwrap();
        let names: Vec<_> = pictures
            .files
            .iter()
            .map(|file| lossy(file.file_name()))
            .collect();
        assert_eq!(names, ["p9.png", "p10.JPG"]);
        let told = pictures.left_out().unwrap();
        assert!(
            told.starts_with("3 pictures") && told.contains("(2 .heic, 1 .tif)"),
            "{told}"
        );
        assert_eq!(Pictures::default().left_out(), None);
    }

    #[test]
    fn masks_are_found_by_the_pictures_name_with_and_without_its_ending() {
        let folder = folder(&[
            "a.jpg",
            "a.json",
            "a.png",
            "._a.png",
            "b.png",
            "b.jpg.png",
            "b.png.png",
            "c.1.png",
            "d.jpg",
            "e.PNG",
        ]);
        let of = |name: &str| lossy(mask_of(folder.path(), name).file_name());
        for (name, mask) in [
            // The overlay and what a labelling tool keeps are not the mask.
            ("a", "a.png"),
            ("a.jpg", "a.png"),
            ("b", "b.jpg.png"),
            ("b.jpg", "b.jpg.png"),
            ("b.png", "b.png.png"),
            ("c.1.jpg", "c.1.png"),
            ("d.png", "d.jpg"),
            ("e", "e.PNG"),
            // `c.1.png` is the mask of `c.1`.
            ("c", "c.png"),
            ("none.jpg", "none.jpg.png"),
        ] {
            assert_eq!(of(name), mask, "{name}");
        }
        assert_eq!(
            mask_of(folder.path(), "left/1.jpg"),
            folder.path().join("left/1.jpg.png")
        );
    }
}
