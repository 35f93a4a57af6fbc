//! What a sequence holds, and the one check that all of it passes, whoever made it.

use super::error::SequenceError;
use super::validate::{
    check_camera_fits, check_name, check_pinhole, check_rotation, check_translation, is_deviation,
};
use super::{Frame, Truth};
use crate::geometry::Pose;
use crate::image::Grid;
use std::collections::BTreeSet;
use std::ops::Deref;
use std::path::Path;

/// What makes a [`Sequence`], not yet checked.
#[derive(Clone, Debug)]
pub struct SequenceContent {
    /// The folder's name.
    pub name: String,
    /// The frames, in order of time.
    pub frames: Vec<Frame>,
    /// Standard deviation, in diagonals of the object, of where the off-the-shelf poses take its points between two frames; None
    /// where nobody vouches for them.
    pub motion_deviation: Option<f64>,
    /// Standard deviation of the logarithm of one factor for all focal lengths, which the solver then finds; None where
    /// they are known.
    pub focal_deviation: Option<f64>,
    /// Known only for sequences that were rendered; never read by the solver.
    pub truth: Option<Truth>,
}

/// Frames in order, of which every number is finite and every size fits: there is no other way to have one than
/// [`Sequence::new`], so whoever takes one need not look again.
#[derive(Clone, Debug)]
pub struct Sequence(SequenceContent);

impl Deref for Sequence {
    type Target = SequenceContent;

    fn deref(&self) -> &SequenceContent {
        &self.0
    }
}

impl Sequence {
    /// Checks what the frames hold.
    ///
    /// # Errors
    /// The first fault: no frame, a name that occurs twice, a mask without object, sizes that differ, a number that is not finite,
    /// a camera that cannot be, a rotation that is none.
    pub fn new(content: SequenceContent) -> Result<Self, SequenceError> {
        let listing = content.name.clone();
        Self::checked(content, Path::new(&listing)).map_err(|mut faults| faults.swap_remove(0))
    }

    /// Likewise, with all faults, which name `listing`, the file that the frames were listed in.
    pub(super) fn checked(content: SequenceContent, listing: &Path) -> Result<Self, Vec<SequenceError>> {
        let faults = Check::of(&content, listing);
        if faults.is_empty() {
            Ok(Self(content))
        } else {
            Err(faults)
        }
    }

    /// The sequence with something changed, checked again.
    ///
    /// # Errors
    /// The errors of [`Sequence::new`].
    pub fn edited(self, edit: impl FnOnce(&mut SequenceContent)) -> Result<Self, SequenceError> {
        let mut content = self.0;
        edit(&mut content);
        Self::new(content)
    }

    /// The frames of these indices, in their order, without the truth.
    pub(crate) fn of_frames(&self, indices: &[usize]) -> Self {
        // What each of all frames passed, each of some passes.
        Self(SequenceContent {
            name: self.name.clone(),
            frames: indices.iter().map(|&index| self.frames[index].clone()).collect(),
            motion_deviation: self.motion_deviation,
            focal_deviation: self.focal_deviation,
            truth: None,
        })
    }

    /// The content, to be taken apart.
    pub fn into_content(self) -> SequenceContent {
        self.0
    }
}

struct Check<'a> {
    listing: &'a Path,
    faults: Vec<SequenceError>,
}

impl Check<'_> {
    fn of(content: &SequenceContent, listing: &Path) -> Vec<SequenceError> {
        let mut check = Check {
            listing,
            faults: Vec::new(),
        };
        if content.frames.is_empty() {
            check.fault("frames", "there is none", "give at least one");
        }
        for (field, deviation) in [
            ("motion_deviation", content.motion_deviation),
            ("focal_deviation", content.focal_deviation),
        ] {
            if deviation.is_some_and(|deviation| !is_deviation(deviation)) {
                check.fault(field, "not positive and finite", "give a number above 0, or none");
            }
        }
        let mut names = BTreeSet::new();
        for (index, frame) in content.frames.iter().enumerate() {
            let taken = !names.insert(&frame.name);
            check
                .faults
                .extend(check_name(&frame.name, taken, listing, index).err());
            check.frame(frame, &format!("frames[{index}]"));
        }
        if let Some(truth) = &content.truth {
            check.truth(truth, &content.frames);
        }
        check.faults
    }

    fn fault(&mut self, field: &str, problem: impl Into<String>, mend: &str) {
        self.faults
            .push(SequenceError::invalid(self.listing, field, problem, mend));
    }

    fn frame(&mut self, frame: &Frame, field: &str) {
        let size = frame.image.size();
        if !frame.image.data().iter().flatten().all(|value| value.is_finite()) {
            self.fault(
                &format!("{field}.image"),
                "holds a value that is not finite",
                "give colours in [0, 255]",
            );
        }
        self.same_size(frame.mask.size(), size, field, "mask");
        if !frame.mask.data().contains(&true) {
            self.fault(
                &format!("{field}.mask"),
                "mask is empty",
                "mark the object, or leave the frame out",
            );
        }
        let camera = format!("{field}.camera");
        let mut faults = check_pinhole(&frame.camera, self.listing, &camera);
        if faults.is_empty() {
            faults.extend(check_camera_fits(&frame.camera, size, self.listing, &camera).err());
        }
        self.faults.append(&mut faults);
        if frame.timestamp_s.is_some_and(|time| !time.is_finite()) {
            self.fault(
                &format!("{field}.timestamp_s"),
                "not finite",
                "give seconds or leave it out",
            );
        }
        if let Some(pose) = &frame.camera_from_input {
            self.pose(pose, &format!("{field}.camera_from_input"));
        }
        for (name, values) in [
            ("depth", &frame.depth),
            ("depth_deviation", &frame.depth_deviation),
        ] {
            if let Some(values) = values {
                self.values(values, size, field, name);
            }
        }
    }

    fn truth(&mut self, truth: &Truth, frames: &[Frame]) {
        let counts = [truth.camera_from_object.len(), truth.depth.len()];
        if counts != [frames.len(); 2] {
            let problem = format!(
                "{} poses and {} depth maps for {} frames",
                counts[0],
                counts[1],
                frames.len()
            );
            self.fault("truth", problem, "give one of each per frame");
        }
        for (index, pose) in truth.camera_from_object.iter().enumerate() {
            self.pose(pose, &format!("truth.camera_from_object[{index}]"));
        }
        for (index, (depth, frame)) in truth.depth.iter().zip(frames).enumerate() {
            self.values(depth, frame.image.size(), "truth", &format!("depth[{index}]"));
        }
        if !truth.shape.iter().flatten().all(|value| value.is_finite()) {
            self.fault(
                "truth.shape",
                "holds a number that is not finite",
                "leave that point out",
            );
        }
    }

    fn pose(&mut self, pose: &Pose, field: &str) {
        let rotation = check_rotation(pose.rotation.matrix(), self.listing, field);
        let translation = check_translation(&pose.translation, self.listing, field);
        self.faults.extend(rotation.err());
        self.faults.extend(translation.err());
    }

    /// Depths, or their deviations.
    fn values(&mut self, values: &Grid<f32>, size: (usize, usize), field: &str, name: &str) {
        self.same_size(values.size(), size, field, name);
        if !values
            .data()
            .iter()
            .all(|value| value.is_finite() && *value >= 0.0)
        {
            let field = format!("{field}.{name}");
            self.fault(
                &field,
                "holds a value that is negative or not finite",
                "0 stands for unknown",
            );
        }
    }

    fn same_size(&mut self, found: (usize, usize), expected: (usize, usize), field: &str, what: &str) {
        if found != expected {
            self.faults.push(SequenceError::Size {
                file: self.listing.to_owned(),
                what: format!("{field}.{what}"),
                found,
                expected,
                mend: "make it the image's size".into(),
            });
        }
    }
}
