//! Line by line through a text file that may hold stretches of raw bytes, with line numbers for messages.

use super::CadError;
use std::path::Path;

/// What files hold numbers of.
pub(super) trait Number: Sized {
    /// The number in a word; `None` where there is none, or one that is not finite.
    fn finite(word: &str) -> Option<Self>;
}

impl Number for f32 {
    fn finite(word: &str) -> Option<Self> {
        word.parse().ok().filter(|value: &Self| value.is_finite())
    }
}

impl Number for f64 {
    fn finite(word: &str) -> Option<Self> {
        word.parse().ok().filter(|value: &Self| value.is_finite())
    }
}

impl Number for usize {
    fn finite(word: &str) -> Option<Self> {
        word.parse().ok()
    }
}

pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: usize,
    path: &'a Path,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8], path: &'a Path) -> Self {
        Self {
            // Some editors begin with a byte-order mark.
            bytes: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            at: 0,
            number: 0,
            path,
        }
    }

    /// The next line that is not blank, without its end.
    pub(super) fn next(&mut self) -> Option<String> {
        loop {
            let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
            let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            self.at += length + 1;
            self.number += 1;
            let line = String::from_utf8_lossy(&rest[..length]).trim().to_owned();
            if !line.is_empty() {
                return Some(line);
            }
        }
    }

    pub(super) fn skip_bytes(&mut self, count: usize) -> Result<(), CadError> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| self.error("data runs past the end of the file"))?;
        self.number += self.bytes[self.at..end].iter().filter(|&&b| b == b'\n').count();
        self.at = end;
        Ok(())
    }

    /// The first `count` words as numbers, all of them finite.
    pub(super) fn numbers<T: Number>(
        &self,
        words: &[impl AsRef<str>],
        count: usize,
    ) -> Result<Vec<T>, CadError> {
        words
            .get(..count)
            .and_then(|words| words.iter().map(|w| T::finite(w.as_ref())).collect())
            .ok_or_else(|| self.error(format!("expected {count} finite numbers")))
    }

    /// An error at the line that was read last.
    pub(super) fn error(&self, problem: impl std::fmt::Display) -> CadError {
        CadError::malformed(self.path, format!("line {}", self.number), problem)
    }
}
