//! Files and folders that are whole or not there, and text as editors of all systems write it.

mod staging;

pub(crate) use staging::Staging;

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

/// A text file in UTF-8, or UTF-16 as its byte-order mark says, without that mark.
///
/// # Errors
/// An error of kind `InvalidData` where it is neither.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    decode_text(std::fs::read(path)?)
}

/// The text of a file's bytes, likewise.
pub(crate) fn decode_text(bytes: Vec<u8>) -> Result<String> {
    let wide = |order: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..]
            .as_chunks::<2>()
            .0
            .iter()
            .map(|&pair| order(pair))
            .collect();
        String::from_utf16(&units).ok()
    };
    let text = match bytes[..] {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, ..] => String::from_utf8(bytes[3..].to_vec()).ok(),
        _ => String::from_utf8(bytes).ok(),
    };
    text.ok_or_else(|| Error::new(ErrorKind::InvalidData, "no text in UTF-8: save it as that"))
}

/// Writes `bytes` beside `path`, then renames.
/// Leaves nothing where that fails.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".partial");
    let written = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    if written.is_err() {
        // What it failed for is the error to tell.
        let _ = std::fs::remove_file(&beside);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_order_marks_are_no_text() {
        let wide =
            |order: fn(u16) -> [u8; 2]| "\u{feff}né\n".encode_utf16().flat_map(order).collect::<Vec<u8>>();
        for bytes in [
            "né\n".as_bytes().to_vec(),
            "\u{feff}né\n".as_bytes().to_vec(),
            wide(u16::to_le_bytes),
            wide(u16::to_be_bytes),
        ] {
            assert_eq!(decode_text(bytes).unwrap(), "né\n");
        }
        // Latin-1.
        assert_eq!(
            decode_text(b"n\xe9".to_vec()).unwrap_err().kind(),
            ErrorKind::InvalidData
        );
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).unwrap();
        assert!(write_whole(&taken, b"a").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
