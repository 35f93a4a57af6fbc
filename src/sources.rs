//! The library's own sources, compiled in: what they made is kept under their digest, so that no later build takes it for its own.

use include_dir::{Dir, DirEntry, include_dir};
use std::hash::Hash;
use std::path::Path;

static RUST: Dir = include_dir!("$CARGO_MANIFEST_DIR/src");
#[cfg(any(feature = "study", feature = "vision"))]
static CPP: Dir = include_dir!("$CARGO_MANIFEST_DIR/cpp");

/// Feeds `hasher` the files of `src/`, with their paths relative to it, but those whose path or folder does not count.
pub(crate) fn hash_rust(counts: impl Fn(&Path) -> bool, hasher: &mut impl std::hash::Hasher) {
    hash(&RUST, &counts, hasher);
}

/// Feeds `hasher` the files of `cpp/`.
#[cfg(any(feature = "study", feature = "vision"))]
pub(crate) fn hash_cpp(hasher: &mut impl std::hash::Hasher) {
    hash(&CPP, &|_| true, hasher);
}

fn hash(folder: &Dir, counts: &impl Fn(&Path) -> bool, hasher: &mut impl std::hash::Hasher) {
    for entry in folder.entries().iter().filter(|entry| counts(entry.path())) {
        match entry {
            DirEntry::Dir(folder) => hash(folder, counts, hasher),
            DirEntry::File(file) => (file.path(), file.contents()).hash(hasher),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hash::{DefaultHasher, Hasher};

    fn digest(counts: impl Fn(&Path) -> bool) -> u64 {
        let mut hasher = DefaultHasher::new();
        hash_rust(counts, &mut hasher);
        hasher.finish()
    }

    #[test]
    fn a_file_left_out_alone_or_with_its_folder_changes_the_digest() {
        let all = digest(|_| true);
        let without_file = digest(|path| path != Path::new("study/plot.rs"));
        let without_folder = digest(|path| path != Path::new("study"));
        assert_ne!(all, without_file);
        assert_ne!(without_file, without_folder);
        assert_eq!(all, digest(|path| path != Path::new("no such")));
    }
}
