//! What stages made, kept by the contents of what they were made of: a second run, or one that was interrupted, makes only what is new.

use crate::sources;
use serde::{Serialize, de::DeserializeOwned};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Of contents and options.
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
}

impl Cache {
    /// The folder is made with the first entry.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder: Some(folder) }
    }

    /// Keeps nothing.
    pub fn none() -> Self {
        Self { folder: None }
    }

    /// What `make` made of the same before, or makes now. A cache that cannot be written to is none.
    ///
    /// # Errors
    /// Those of `make`.
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
        if let Ok(bytes) = postcard::to_stdvec_crc32(&made, crc.digest()) {
            let written =
                std::fs::create_dir_all(folder).and_then(|()| crate::files::write_whole(&file, &bytes));
            if let Err(error) = written {
                tracing::warn!(
                    "{}: {error}; this will be made anew the next time",
                    file.display()
                );
            }
        }
        Ok(made)
    }
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
}
