//! A folder that appears complete or not at all.

use std::fs::{File, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A hidden sibling of its target, `.<name>.partial`, that becomes the target once it is complete. One that is dropped before is
/// removed; one whose program was killed is cleared by the next that has the same target.
pub(crate) struct Staging {
    folder: PathBuf,
    target: PathBuf,
    /// Tells those of other programs that are running from those that were killed.
    _lock: File,
}

impl Staging {
    /// Makes an empty folder beside the target.
    ///
    /// # Errors
    /// Of kind `ResourceBusy` where another program is making the same target.
    pub fn beside(target: &Path) -> Result<Self> {
        let folder = folder_of(target)?;
        let lock = loop {
            std::fs::create_dir_all(&folder)?;
            match lock(&folder) {
                Ok(Some(lock)) => break lock,
                // Another program became done with it since.
                Ok(None) => {}
                Err(error) => return Err(error),
            }
        };
        clear(&folder)?;
        Ok(Self {
            folder,
            target: target.to_owned(),
            _lock: lock,
        })
    }

    /// Removes what a program that was killed left of the same target.
    pub fn remove_stale(target: &Path) {
        if let Ok(folder) = folder_of(target)
            && let Ok(Some(_lock)) = lock(&folder)
        {
            // What cannot be removed now is tried again the next time.
            let _ = std::fs::remove_dir_all(&folder);
        }
    }

    /// The folder to write into.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Renames the folder to the target.
    ///
    /// # Errors
    /// An error of kind `AlreadyExists` where the target exists.
    pub fn publish(self) -> Result<()> {
        if self.target.symlink_metadata().is_ok() {
            return Err(ErrorKind::AlreadyExists.into());
        }
        std::fs::rename(&self.folder, &self.target)
    }

    /// Makes it the target, instead of one that is there.
    #[cfg(any(feature = "vision", test))]
    pub fn replace(self) -> Result<()> {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        if self.target.symlink_metadata().is_err() {
            return self.publish();
        }
        // At one stroke, so that there is the old one or the new one at any time; what is dropped is the old one then.
        match renameat_with(CWD, &self.folder, CWD, &self.target, RenameFlags::EXCHANGE) {
            Ok(()) => Ok(()),
            // File systems that cannot.
            Err(_) => {
                std::fs::remove_dir_all(&self.target)?;
                std::fs::rename(&self.folder, &self.target)
            }
        }
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // It may have become the target; and what cannot be removed is cleared by the next.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn folder_of(target: &Path) -> Result<PathBuf> {
    let name = target
        .file_name()
        .ok_or_else(|| Error::new(ErrorKind::InvalidInput, "it names no folder of its own"))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(".partial");
    Ok(target.with_file_name(hidden))
}

/// `None` where the folder is not there any more.
fn lock(folder: &Path) -> Result<Option<File>> {
    let missing = |error: Error| match error.kind() {
        ErrorKind::NotFound => Ok(None),
        _ => Err(error),
    };
    let opened = match File::open(folder) {
        Ok(opened) => opened,
        Err(error) => return missing(error),
    };
    match opened.try_lock() {
        // File systems without locks have no guard against two programs with one target.
        Ok(()) | Err(TryLockError::Error(_)) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(Error::new(
                ErrorKind::ResourceBusy,
                "another run is making it right now",
            ));
        }
    }
    let (held, there) = (opened.metadata()?, std::fs::metadata(folder));
    match there {
        Ok(there) if there.ino() == held.ino() => Ok(Some(opened)),
        Ok(_) => Ok(None),
        Err(error) => missing(error),
    }
}

fn clear(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            std::fs::remove_dir_all(entry.path())?;
        } else {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_target_is_there_as_a_whole_or_not_at_all() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("deep/out");
        let staging = Staging::beside(&target).unwrap();
        std::fs::write(staging.path().join("a"), "1").unwrap();
        drop(staging);
        assert!(names(&home.path().join("deep")).is_empty());

        let staging = Staging::beside(&target).unwrap();
        std::fs::write(staging.path().join("a"), "1").unwrap();
        staging.publish().unwrap();
        assert_eq!(names(&home.path().join("deep")), ["out"]);
        let refused = Staging::beside(&target).unwrap().publish().unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::AlreadyExists);

        let staging = Staging::beside(&target).unwrap();
        std::fs::write(staging.path().join("b"), "2").unwrap();
        staging.replace().unwrap();
        assert_eq!(
            (names(&target), names(&home.path().join("deep"))),
            (vec!["b".into()], vec!["out".into()])
        );
    }

    #[test]
    fn what_a_killed_program_left_is_cleared_and_what_a_running_one_makes_is_not() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("out");
        let left = home.path().join(".out.partial");
        std::fs::create_dir_all(left.join("images")).unwrap();
        std::fs::write(left.join("images/a"), "half").unwrap();
        let staging = Staging::beside(&target).unwrap();
        assert!(names(staging.path()).is_empty());
        std::fs::write(staging.path().join("a"), "1").unwrap();
        let busy = Staging::beside(&target).err().unwrap();
        assert_eq!(busy.kind(), ErrorKind::ResourceBusy);
        Staging::remove_stale(&target);
        staging.publish().unwrap();
        assert_eq!(names(&target), ["a"]);

        std::fs::create_dir_all(left.join("images")).unwrap();
        Staging::remove_stale(&target);
        assert_eq!(names(home.path()), ["out"]);
        assert!(Staging::beside(Path::new("/")).is_err());
    }
}
