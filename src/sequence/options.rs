//! What to read of an input: where its dense depth lies and which frames are wanted.

use std::path::PathBuf;

/// What [`load`](super::load) reads of an input. The defaults are its own depth and every frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// A folder with openMVS's `scene.mvs` and `depth*.dmap`, for COLMAP workspaces.
    pub depth: Option<PathBuf>,
    /// Which frames are loaded.
    pub window: FrameWindow,
}

/// Frames `start`, `start + every`, … before `end` (an index into the sorted frames, exclusive; `None` = all).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameWindow {
    /// The index of the first frame.
    pub start: usize,
    /// The index after that of the last frame; `None` takes all.
    pub end: Option<usize>,
    /// The step from frame to frame, at least 1.
    pub every: usize,
}

/// Why a range of frames cannot be used.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum WindowError {
    /// The text is no range. The field is the text.
    #[error("`{0}` is no frame range; write start..end, start.. or ..end, such as 0..16")]
    Syntax(String),
    /// The range ends where or before it begins. The field is the range.
    #[error("`{0}` holds no frame; its end must lie beyond its start")]
    Empty(String),
    /// The step is 0.
    #[error("0 is no step; --every must be at least 1")]
    ZeroStep,
}

impl Default for FrameWindow {
    fn default() -> Self {
        Self {
            start: 0,
            end: None,
            every: 1,
        }
    }
}

impl FrameWindow {
    /// Parses what `--frames` and `--every` were given: `0..16`, `4..`, `..16`, `..`, and a step.
    ///
    /// ```
    /// use spba_ceres::sequence::FrameWindow;
    ///
    /// let window = FrameWindow::parse("4..16", 2)?;
    /// assert_eq!((window.start, window.end, window.every), (4, Some(16), 2));
    /// assert!(FrameWindow::parse("16..4", 1).is_err());
    /// # Ok::<(), spba_ceres::sequence::WindowError>(())
    /// ```
    ///
    /// # Errors
    /// No range, a range without a frame, a step of 0.
    pub fn parse(range: &str, every: usize) -> Result<Self, WindowError> {
        let syntax = || WindowError::Syntax(range.to_owned());
        let bound = |text: &str| match text.trim() {
            "" => Ok(None),
            digits => digits.parse::<usize>().map(Some).map_err(|_| syntax()),
        };
        let (start, end) = range.split_once("..").ok_or_else(syntax)?;
        let (start, end) = (bound(start)?.unwrap_or(0), bound(end)?);
        if end.is_some_and(|end| end <= start) {
            return Err(WindowError::Empty(range.to_owned()));
        }
        if every == 0 {
            return Err(WindowError::ZeroStep);
        }
        Ok(Self { start, end, every })
    }

    /// The items of `all` inside the window, in order.
    pub(crate) fn select<T>(&self, all: Vec<T>) -> Vec<T> {
        let end = self.end.unwrap_or(usize::MAX);
        let wanted = end.saturating_sub(self.start);
        all.into_iter()
            .skip(self.start)
            .take(wanted)
            .step_by(self.every.max(1))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_select_what_they_say() {
        let pick = |range, every| {
            FrameWindow::parse(range, every)
                .unwrap()
                .select((0..10).collect::<Vec<_>>())
        };
        assert_eq!(pick("0..4", 1), [0, 1, 2, 3]);
        assert_eq!(pick("2..9", 3), [2, 5, 8]);
        assert_eq!(pick("7..", 1), [7, 8, 9]);
        assert_eq!(pick("..2", 1), [0, 1]);
        assert_eq!(pick("..", 5), [0, 5]);
        assert_eq!(pick("0..99", 1).len(), 10);
    }

    #[test]
    fn wrong_ranges_say_what_is_wrong() {
        for range in ["", "3", "a..b", "1..2..3", "-1..4"] {
            assert!(
                matches!(FrameWindow::parse(range, 1), Err(WindowError::Syntax(_))),
                "{range}"
            );
        }
        assert_eq!(
            FrameWindow::parse("4..4", 1),
            Err(WindowError::Empty("4..4".into()))
        );
        assert_eq!(FrameWindow::parse("0..4", 0), Err(WindowError::ZeroStep));
    }
}
