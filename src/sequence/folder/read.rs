//! Reads `sequence.toml` into a draft; every entry's faults are collected, not only the first.

use super::schema::{FrameEntry, Manifest, PoseEntry, SCHEMA, TruthEntry, Version};
use super::{MANIFEST, points};
use crate::files::read_text;
use crate::geometry::{Pinhole, Pose};
use crate::image::one_line;
use crate::sequence::distortion::Distortion;
use crate::sequence::draft::{DenseDepth, Draft, FrameDraft, FrameTruth, folder_name};
use crate::sequence::error::SequenceError;
use crate::sequence::validate::{check_name, check_pinhole, check_pose, inside, is_deviation};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub fn draft(folder: &Path) -> Result<Draft, SequenceError> {
    let file = folder.join(MANIFEST);
    let manifest = parse(&file)?;
    let mut reader = FolderReader {
        folder,
        file: &file,
        problems: Vec::new(),
    };
    reader.check_names(&manifest.frames);
    for (field, deviation, what, unit) in [
        (
            "motion_deviation",
            manifest.motion_deviation,
            "no length",
            "in diagonals of the object",
        ),
        (
            "focal_deviation",
            manifest.focal_deviation,
            "no share",
            "as a share of the focal length",
        ),
    ] {
        if let Some(deviation) = deviation
            && !is_deviation(deviation)
        {
            reader.problems.push(SequenceError::invalid(
                &file,
                field,
                format!("{deviation} is {what}"),
                format!("give it {unit}, more than 0, or leave it out"),
            ));
        }
    }
    let count = manifest.frames.len();
    let (truth_shape, truths) = match manifest.truth {
        Some(entry) => reader.truth(entry, count),
        None => (None, Vec::new()),
    };
    let mut truths = truths.into_iter();
    let mut frames = Vec::with_capacity(count);
    for (index, entry) in manifest.frames.into_iter().enumerate() {
        frames.extend(reader.frame(index, entry, truths.next()));
    }
    Ok(Draft {
        name: folder_name(folder),
        kind: "sequence folder",
        frames,
        motion_deviation: manifest.motion_deviation,
        focal_deviation: manifest.focal_deviation,
        truth_shape,
        notes: Vec::new(),
        problems: reader.problems,
        listing: file,
    })
}

fn parse(file: &Path) -> Result<Manifest, SequenceError> {
    let text = read_text(file).map_err(|error| SequenceError::read(file, error))?;
    let syntax = |error: toml::de::Error| {
        let line = error.span().map_or(1, |span| {
            1 + text
                .as_bytes()
                .iter()
                .take(span.start)
                .filter(|&&byte| byte == b'\n')
                .count()
        });
        SequenceError::invalid(
            file,
            format!("line {line}"),
            one_line(error.message()),
            "the format is described in the library's `sequence` module",
        )
    };
    let version: Version = toml::from_str(&text).map_err(syntax)?;
    if version.schema != SCHEMA {
        return Err(SequenceError::invalid(
            file,
            "schema",
            format!("{} is not known here", version.schema),
            format!("this program reads schema {SCHEMA}; import the sequence again with it"),
        ));
    }
    toml::from_str(&text).map_err(syntax)
}

struct FolderReader<'a> {
    folder: &'a Path,
    file: &'a Path,
    problems: Vec<SequenceError>,
}

impl FolderReader<'_> {
    fn check_names(&mut self, frames: &[FrameEntry]) {
        let mut seen = BTreeSet::new();
        for (index, frame) in frames.iter().enumerate() {
            let taken = !seen.insert(&frame.name);
            self.problems
                .extend(check_name(&frame.name, taken, self.file, index).err());
        }
    }

    /// `None` where the frame cannot even be looked at; its problems are noted.
    fn frame(&mut self, index: usize, entry: FrameEntry, truth: Option<FrameTruth>) -> Option<FrameDraft> {
        let field = |name: &str| format!("frames[{index}].{name}");
        let camera = Pinhole {
            fx: entry.camera.fx,
            fy: entry.camera.fy,
            cx: entry.camera.cx,
            cy: entry.camera.cy,
        };
        self.problems
            .extend(check_pinhole(&camera, self.file, &field("camera")));
        if entry.timestamp_s.is_some_and(|time| !time.is_finite()) {
            self.problems.push(SequenceError::invalid(
                self.file,
                field("timestamp_s"),
                "not finite",
                "give seconds or leave it out",
            ));
        }
        let camera_from_input = entry
            .camera_from_input
            .and_then(|pose| self.pose(&pose, &field("camera_from_input")));
        let image = self.path(&entry.image, &field("image"));
        let mask = self.path(&entry.mask, &field("mask"));
        let depth = entry
            .depth
            .and_then(|depth| self.path(&depth, &field("depth")))
            .map(DenseDepth::Exr);
        let depth_deviation = entry
            .depth_deviation
            .and_then(|deviation| self.path(&deviation, &field("depth_deviation")));
        Some(FrameDraft {
            name: entry.name,
            declared_in: self.file.to_owned(),
            image: image?,
            mask: mask?,
            camera,
            distortion: Distortion::None,
            calibrated_size: None,
            timestamp_s: entry.timestamp_s,
            camera_from_input,
            depth,
            points: Vec::new(),
            depth_deviation,
            truth,
        })
    }

    fn truth(&mut self, entry: TruthEntry, frame_count: usize) -> (Option<Vec<[f32; 3]>>, Vec<FrameTruth>) {
        for (field, found) in [
            ("truth.depth", entry.depth.len()),
            ("truth.camera_from_object", entry.camera_from_object.len()),
        ] {
            if found != frame_count {
                self.problems.push(SequenceError::CountMismatch {
                    file: self.file.to_owned(),
                    field: field.to_owned(),
                    declared: found as u64,
                    found: frame_count as u64,
                    mend: "give one per frame".into(),
                });
            }
        }
        let shape = self.path(&entry.shape, "truth.shape").and_then(|path| {
            let points = points::read(&path);
            self.keep(points)
        });
        let truths = entry
            .depth
            .iter()
            .zip(&entry.camera_from_object)
            .enumerate()
            .map_while(|(index, (depth, pose))| {
                Some(FrameTruth {
                    camera_from_object: self.pose(pose, &format!("truth.camera_from_object[{index}]"))?,
                    depth: self.path(depth, &format!("truth.depth[{index}]"))?,
                })
            })
            .collect();
        (shape, truths)
    }

    fn path(&mut self, relative: &str, field: &str) -> Option<PathBuf> {
        let path = inside(self.folder, relative, self.file, field);
        self.keep(path)
    }

    fn pose(&mut self, entry: &PoseEntry, field: &str) -> Option<Pose> {
        let pose = check_pose(&entry.rotation, &entry.translation, self.file, field);
        self.keep(pose)
    }

    fn keep<T>(&mut self, outcome: Result<T, SequenceError>) -> Option<T> {
        outcome.map_err(|problem| self.problems.push(problem)).ok()
    }
}
