//! What stages made, kept by the contents of what they were made of: a second run, or one that was interrupted, makes only what is new.

use crate::sources;
use serde::{Serialize, de::DeserializeOwned};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// A digest of contents and options: what a cached stage depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key(u64);

impl Key {
    pub fn of(contents: &(impl Hash + ?Sized)) -> Self {
        let mut hasher = DefaultHasher::new();
        build().hash(&mut hasher);
        contents.hash(&mut hasher);
        Self(hasher.finish())
    }

    /// This and what more a stage depends on; options are told apart by how they print.
    pub fn and(self, options: &impl std::fmt::Debug) -> Self {
        Self::of(&(self, format!("{options:?}")))
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Tells builds apart whose stages could make other things; a version number would not.
fn build() -> u64 {
    static BUILD: OnceLock<u64> = OnceLock::new();
    *BUILD.get_or_init(|| {
        let mut hasher = DefaultHasher::new();
        let counts = |path: &Path| {
            ["prepare", "bridge", "geometry", "image"]
                .iter()
                .any(|folder| path.starts_with(folder))
        };
        sources::hash_rust(counts, &mut hasher);
        sources::hash_cpp(&mut hasher);
        hasher.finish()
    })
}

/// A folder of what stages made; it may be deleted at any time.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: Option<PathBuf>,
    /// No more is kept in a folder that could not be written to.
    given_up: Arc<AtomicBool>,
}

/// Behind the name of an entry that is being written, with the number of the process that writes it before.
const PARTIAL: &str = "partial";

impl Cache {
    /// The folder is made with the first entry. What killed processes left in it is removed.
    pub fn new(folder: PathBuf) -> Self {
        for file in files_in(&folder) {
            if writer_of(&file).is_some_and(|process| !is_running(process)) {
                // It is tried again the next time.
                let _ = std::fs::remove_file(file);
            }
        }
        Self {
            folder: Some(folder),
            given_up: Arc::default(),
        }
    }

    /// A cache that keeps nothing.
    pub fn none() -> Self {
        Self {
            folder: None,
            given_up: Arc::default(),
        }
    }

    /// Removes all entries and keeps no more, so that there is room for what counts; whether there were any.
    pub fn give_up(&self) -> bool {
        self.given_up.store(true, Ordering::Relaxed);
        let Some(folder) = &self.folder else { return false };
        let removed = files_in(folder)
            .into_iter()
            .filter(|file| std::fs::remove_file(file).is_ok())
            .count();
        // Not empty where it holds what is not ours.
        let _ = std::fs::remove_dir(folder);
        removed > 0
    }

    /// What `make` made of the same before, or makes now. A cache that cannot be written to is none.
    ///
    /// # Errors
    /// The errors of `make`.
    pub fn get_or<T: Serialize + DeserializeOwned, E>(
        &self,
        stage: &str,
        key: Key,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let Some(folder) = &self.folder else {
            return make();
        };
        let file = folder.join(format!("{stage}-{key}"));
        let crc = crc();
        let kept = std::fs::read(&file)
            .ok()
            .and_then(|bytes| postcard::from_bytes_crc32(&bytes, crc.digest()).ok());
        if let Some(kept) = kept {
            return Ok(kept);
        }
        let made = make()?;
        if self.given_up.load(Ordering::Relaxed) {
            return Ok(made);
        }
        if let Ok(bytes) = postcard::to_stdvec_crc32(&made, crc.digest())
            && let Err(error) = write(&file, &bytes)
        {
            self.give_up();
            tracing::warn!(
                "{}: cannot be written ({error}); the cache is removed, and all is made anew the next time",
                folder.display()
            );
        }
        Ok(made)
    }
}

fn write(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    std::fs::create_dir_all(file.parent().unwrap_or(Path::new("")))?;
    let beside = file.with_extension(format!("{}.{PARTIAL}", std::process::id()));
    std::fs::write(&beside, bytes)?;
    std::fs::rename(&beside, file)
}

/// Entries, whole or partial: `<stage>-<key>[.<process>.partial]`.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let is_entry = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let key = name.split('.').next().and_then(|name| name.rsplit_once('-'));
        key.is_some_and(|(_, key)| key.len() == 16 && key.bytes().all(|byte| byte.is_ascii_hexdigit()))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(is_entry).collect()
}

/// The process that writes a partial entry.
fn writer_of(file: &Path) -> Option<u32> {
    let (before, ending) = file.file_name()?.to_str()?.rsplit_once('.')?;
    (ending == PARTIAL).then(|| before.rsplit_once('.')?.1.parse().ok())?
}

fn is_running(process: u32) -> bool {
    Path::new("/proc").join(process.to_string()).exists()
}

fn crc() -> crc::Crc<u32> {
    crc::Crc::<u32>::new(&crc::CRC_32_ISCSI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn what_was_made_is_made_once_unless_it_was_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("cache"));
        let key = Key::of("photo").and(&3.5);
        let made = Grid::from_fn(3, 2, |column, row| (column * row) as f32);
        let make = || Ok::<_, ()>(made.clone());
        let never = || Err::<Grid<f32>, ()>(());
        assert_eq!(
            cache.get_or("depth", key, never),
            Err(()),
            "a failure is not kept"
        );
        assert_eq!(cache.get_or("depth", key, make), Ok(made.clone()));
        assert_eq!(cache.get_or("depth", key, never), Ok(made.clone()));
        assert_eq!(cache.get_or("depth", Key::of("photo").and(&3.6), never), Err(()));
        assert_eq!(Cache::none().get_or("depth", key, never), Err(()));

        let file = folder.path().join("cache").join(format!("depth-{key}"));
        let mut bytes = std::fs::read(&file).unwrap();
        bytes[5] ^= 1;
        std::fs::write(&file, bytes).unwrap();
        assert_eq!(cache.get_or("depth", key, make), Ok(made));
    }

    #[test]
    fn a_folder_that_cannot_be_written_to_is_given_up_and_costs_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("cache"));
        let key = Key::of("photo");
        let made = |number: u32| move || Ok::<_, ()>(number);
        assert_eq!(cache.get_or("depth", key, made(1)), Ok(1));
        std::fs::write(folder.path().join("cache/notes.txt"), "mine").unwrap();
        // An entry's name is taken by a folder.
        std::fs::create_dir(folder.path().join("cache").join(format!("motion-{key}"))).unwrap();
        assert_eq!(cache.get_or("motion", key, made(2)), Ok(2));
        assert_eq!(
            cache.get_or("depth", key, made(3)),
            Ok(3),
            "removed, to make room"
        );
        assert_eq!(cache.get_or("depth", key, made(4)), Ok(4), "and nothing is kept");
        let left: Vec<_> = files_in(&folder.path().join("cache"));
        assert!(left.iter().all(|file| file.is_dir()), "{left:?}");
        assert!(folder.path().join("cache/notes.txt").exists());
        assert!(!cache.give_up());
    }

    #[test]
    fn what_killed_processes_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let key = Key::of("photo");
        let own = folder
            .path()
            .join(format!("depth-{key}.{}.partial", std::process::id()));
        let dead = folder.path().join(format!("depth-{key}.4194305.partial"));
        let other = folder.path().join("photo.partial");
        for file in [&own, &dead, &other] {
            std::fs::write(file, "half").unwrap();
        }
        Cache::new(folder.path().to_owned());
        assert!(own.exists() && !dead.exists() && other.exists());
    }
}
