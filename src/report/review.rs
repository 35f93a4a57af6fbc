//! What a sequence holds, as one picture to look at before solving.

use super::sheet::Sheet;
use super::write::save_png;
use super::{ReportError, overlay};
use crate::image::Grid;
use crate::sequence::Sequence;
use std::path::Path;

/// Writes a contact sheet of every frame: the picture, and below it the mask's outline and the off-the-shelf depth.
///
/// # Errors
/// A file that cannot be written.
pub fn write_review(sequence: &Sequence, file: &Path) -> Result<(), ReportError> {
    let frames = &sequence.frames;
    let mut sheet = Sheet::new(frames, frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let (width, height) = frame.image.size();
        let none = || Grid::filled(width, height, 0.0);
        let depth = frame.depth.clone().unwrap_or_else(none);
        let known = super::density(&frame.mask, &depth.known());
        sheet.add(
            i,
            &frame.name,
            format!("mask {:.2} depth {known:.2}", frame.mask.share()),
            &overlay::picture(&frame.image),
            &overlay::overlay(&frame.image, &depth, &frame.mask),
        );
    }
    save_png(file, &sheet.draw())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Surface;
    use crate::report::fixture::{box_car, solved};

    #[test]
    fn every_frame_is_on_the_sheet() {
        let (sequence, _) = solved(&Surface::from_points(box_car(50)), 18);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("review.png");
        write_review(&sequence, &file).unwrap();
        let all = image::open(&file).unwrap();
        let few = Sequence {
            frames: sequence.frames[..4].to_vec(),
            ..sequence
        };
        write_review(&few, &file).unwrap();
        let row = image::open(&file).unwrap();
        assert_eq!(all.width(), row.width());
        // Four a row: five rows, each as tall as the one.
        assert!(
            all.height() > 9 * row.height() / 2,
            "{} {}",
            all.height(),
            row.height()
        );
    }
}
