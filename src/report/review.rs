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
/// The file cannot be written.
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
    use crate::sequence::Frame;

    #[test]
    fn every_frame_is_on_the_sheet() {
        let (four, _) = solved(&Surface::from_points(box_car(50)), 4);
        // The same four over and over, as the sheet's window depends on the masks.
        let eighteen = four.clone().edited(|content| {
            let frames = four.frames.iter().cycle().enumerate().take(18);
            content.frames = frames
                .map(|(index, frame)| Frame {
                    name: index.to_string(),
                    ..frame.clone()
                })
                .collect();
            content.truth = None;
        });
        let eighteen = eighteen.unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("review.png");
        let size = |sequence: &Sequence| {
            write_review(sequence, &file).unwrap();
            image::image_dimensions(&file).unwrap()
        };
        let (row, rows) = (size(&four), size(&eighteen));
        assert_eq!(row.0, rows.0);
        // Four a row: five rows, each as tall as the one.
        assert!(rows.1 > 9 * row.1 / 2, "{row:?} {rows:?}");
    }
}
