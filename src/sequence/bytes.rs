//! A little-endian reader over a whole binary file that never trusts a declared count.

use super::error::SequenceError;
use std::path::Path;

pub(super) struct Bytes<'a> {
    file: &'a Path,
    data: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(file: &'a Path, data: &'a [u8]) -> Self {
        Self { file, data, at: 0 }
    }

    pub fn remaining(&self) -> usize {
        self.data.len().saturating_sub(self.at)
    }

    /// The next `length` bytes; `field` names them in the error.
    pub fn take(&mut self, length: usize, field: &str) -> Result<&'a [u8], SequenceError> {
        let end = self.at.checked_add(length);
        match end.and_then(|end| self.data.get(self.at..end)) {
            Some(bytes) => {
                self.at += length;
                Ok(bytes)
            }
            None => Err(self.truncated(length as u64, field)),
        }
    }

    /// A declared `count` of items of at least `item_bytes` each, checked against what the file still holds.
    pub fn count(&self, count: u64, item_bytes: usize, field: &str) -> Result<usize, SequenceError> {
        let needed = count.saturating_mul(item_bytes as u64);
        match usize::try_from(count) {
            Ok(count) if needed <= self.remaining() as u64 => Ok(count),
            _ => Err(self.truncated(needed, field)),
        }
    }

    /// Skips `count` items of `item_bytes` each.
    pub fn skip(&mut self, count: u64, item_bytes: usize, field: &str) -> Result<(), SequenceError> {
        let count = self.count(count, item_bytes, field)?;
        self.take(count * item_bytes, field).map(|_| ())
    }

    fn array<const N: usize>(&mut self, field: &str) -> Result<[u8; N], SequenceError> {
        let bytes = self.take(N, field)?;
        bytes.try_into().map_err(|_| self.truncated(N as u64, field))
    }

    pub fn u8(&mut self, field: &str) -> Result<u8, SequenceError> {
        self.array::<1>(field).map(|[byte]| byte)
    }

    pub fn u16(&mut self, field: &str) -> Result<u16, SequenceError> {
        self.array(field).map(u16::from_le_bytes)
    }

    pub fn u32(&mut self, field: &str) -> Result<u32, SequenceError> {
        self.array(field).map(u32::from_le_bytes)
    }

    pub fn i32(&mut self, field: &str) -> Result<i32, SequenceError> {
        self.array(field).map(i32::from_le_bytes)
    }

    pub fn u64(&mut self, field: &str) -> Result<u64, SequenceError> {
        self.array(field).map(u64::from_le_bytes)
    }

    pub fn f64(&mut self, field: &str) -> Result<f64, SequenceError> {
        self.array(field).map(f64::from_le_bytes)
    }

    pub fn f64s<const N: usize>(&mut self, field: &str) -> Result<[f64; N], SequenceError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(field)?;
        }
        Ok(values)
    }

    /// The next `count` f32.
    pub fn f32s(&mut self, count: u64, field: &str) -> Result<Vec<f32>, SequenceError> {
        let count = self.count(count, 4, field)?;
        let bytes = self.take(count * 4, field)?;
        Ok(bytes
            .chunks_exact(4)
            .map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect())
    }

    /// A string of `length` bytes.
    pub fn string(&mut self, length: u64, field: &str) -> Result<String, SequenceError> {
        let length = self.count(length, 1, field)?;
        let bytes = self.take(length, field)?;
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    /// A string that ends with a zero byte.
    pub fn zero_terminated(&mut self, field: &str) -> Result<String, SequenceError> {
        let rest = self.data.get(self.at..).unwrap_or_default();
        let length = rest
            .iter()
            .position(|&byte| byte == 0)
            .ok_or_else(|| self.truncated(1, field))?;
        let text = self.string(length as u64, field)?;
        self.take(1, field)?;
        Ok(text)
    }

    /// Refuses bytes after the last thing that the file should hold.
    pub fn end(&self, last: &str) -> Result<(), SequenceError> {
        match self.remaining() {
            0 => Ok(()),
            extra => Err(SequenceError::invalid(
                self.file,
                last,
                format!("{extra} bytes follow what the file's own counts announce"),
                "copy or export it again",
            )),
        }
    }

    fn truncated(&self, needed: u64, field: &str) -> SequenceError {
        SequenceError::Truncated {
            file: self.file.to_owned(),
            field: field.to_owned(),
            at: self.at,
            needed: needed.saturating_sub(self.remaining() as u64),
        }
    }
}
