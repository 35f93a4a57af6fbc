//! A prepared sequence as a folder: the old one or the new one at any time, never half.

use super::{Cache, PrepareError, Stamp};
use crate::files::Staging;
use crate::image::ImageError;
use crate::sequence::{Sequence, SequenceError, folder};
use std::io::ErrorKind;
use std::path::Path;

/// Writes a sequence and what it was made of, instead of `out` where there is one. A full disk is made room on by removing `cache`.
///
/// # Errors
/// A folder that cannot be written.
pub fn save(sequence: &Sequence, stamp: &Stamp, out: &Path, cache: &Cache) -> Result<(), PrepareError> {
    match write(sequence, stamp, out) {
        Err(error) if is_full(&error) && cache.give_up() => {
            tracing::warn!(
                "{}: the disk is full; the cache is removed to make room",
                out.display()
            );
            write(sequence, stamp, out)
        }
        outcome => outcome,
    }
}

/// Removes what a run that was killed left beside `out`.
pub fn remove_stale(out: &Path) {
    Staging::remove_stale(out);
}

fn write(sequence: &Sequence, stamp: &Stamp, out: &Path) -> Result<(), PrepareError> {
    let failed = |problem| SequenceError::write(out, problem);
    let staging = Staging::beside(out).map_err(failed)?;
    folder::fill(sequence, staging.path())?;
    stamp.save(staging.path())?;
    staging.replace().map_err(failed)?;
    Ok(())
}

fn is_full(error: &PrepareError) -> bool {
    let PrepareError::Sequence(
        SequenceError::Write { problem, .. } | SequenceError::Image(ImageError::Write { problem, .. }),
    ) = error
    else {
        return false;
    };
    problem.kind() == ErrorKind::StorageFull
}
