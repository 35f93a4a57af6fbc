//! Files that are whole or not there.

use std::path::Path;

/// Writes `bytes` beside `path`, then renames.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".partial");
    std::fs::write(&beside, bytes)?;
    std::fs::rename(&beside, path)
}
