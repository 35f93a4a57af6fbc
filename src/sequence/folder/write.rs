//! Writes a sequence folder: beside its target first, then renamed, so that a failure leaves nothing.

use super::schema::SCHEMA;
use super::{MANIFEST, points};
use crate::files::Staging;
use crate::geometry::{Pinhole, Pose};
use crate::image::{write_depth, write_deviation, write_mask, write_rgb};
use crate::sequence::{Frame, Sequence, SequenceError, Truth};
use std::fmt::Write;
use std::path::Path;

/// Writes `sequence` as the new folder `target`; images become PNG. Refuses a target that exists.
pub fn write(sequence: &Sequence, target: &Path) -> Result<(), SequenceError> {
    let failed = |problem| SequenceError::write(target, problem);
    if target.symlink_metadata().is_ok() {
        return Err(SequenceError::TargetExists(target.to_owned()));
    }
    let staging = Staging::beside(target).map_err(failed)?;
    fill(sequence, staging.path())?;
    staging.publish().map_err(failed)
}

/// Writes what a sequence folder holds into `folder`, which is empty.
pub(crate) fn fill(sequence: &Sequence, folder: &Path) -> Result<(), SequenceError> {
    let stems = file_stems(&sequence.frames);
    let mut manifest = header();
    for (field, deviation) in [
        ("motion_deviation", sequence.motion_deviation),
        ("focal_deviation", sequence.focal_deviation),
    ] {
        if let Some(deviation) = deviation {
            // Writing to a string cannot fail.
            let _ = writeln!(manifest, "{field} = {deviation:?}");
        }
    }
    for name in ["images", "masks"] {
        create(&folder.join(name))?;
    }
    if sequence.frames.iter().any(|frame| frame.depth.is_some()) {
        create(&folder.join("depth"))?;
    }
    if sequence
        .frames
        .iter()
        .any(|frame| frame.depth_deviation.is_some())
    {
        create(&folder.join("deviation"))?;
    }
    for (frame, stem) in sequence.frames.iter().zip(&stems) {
        write_rgb(&frame.image, &folder.join(format!("images/{stem}.png")))?;
        write_mask(&frame.mask, &folder.join(format!("masks/{stem}.png")))?;
        if let Some(depth) = &frame.depth {
            write_depth(depth, &folder.join(format!("depth/{stem}.exr")))?;
        }
        if let Some(deviation) = &frame.depth_deviation {
            write_deviation(deviation, &folder.join(format!("deviation/{stem}.exr")))?;
        }
        manifest += &frame_entry(frame, stem);
    }
    if let Some(truth) = &sequence.truth {
        create(&folder.join("truth"))?;
        for (depth, stem) in truth.depth.iter().zip(&stems) {
            write_depth(depth, &folder.join(format!("truth/{stem}.exr")))?;
        }
        save(&folder.join("truth/shape.ply"), &points::encode(&truth.shape))?;
        manifest += &truth_entry(truth, &stems);
    }
    save(&folder.join(MANIFEST), manifest.as_bytes())
}

fn header() -> String {
    format!(
        "# Poses are b_from_a: x_b = rotation x_a + translation (rotation row-major). Camera frame: x right, y down,\n\
         # z forward. Pixels: the centre of the top-left one is (0.5, 0.5). Depth: z, 0 = unknown.\n\
         schema = {SCHEMA}\n"
    )
}

fn frame_entry(frame: &Frame, stem: &str) -> String {
    let mut entry = format!(
        "\n[[frames]]\nname = {}\nimage = \"images/{stem}.png\"\nmask = \"masks/{stem}.png\"\n",
        toml::Value::from(frame.name.as_str())
    );
    // Writing to a string cannot fail.
    if let Some(time) = frame.timestamp_s {
        let _ = writeln!(entry, "timestamp_s = {time:?}");
    }
    let Pinhole { fx, fy, cx, cy } = frame.camera;
    let _ = writeln!(
        entry,
        "camera = {{ fx = {fx:?}, fy = {fy:?}, cx = {cx:?}, cy = {cy:?} }}"
    );
    if let Some(pose) = &frame.camera_from_input {
        let _ = writeln!(entry, "camera_from_input = {}", pose_entry(pose));
    }
    if frame.depth.is_some() {
        let _ = writeln!(entry, "depth = \"depth/{stem}.exr\"");
    }
    if frame.depth_deviation.is_some() {
        let _ = writeln!(entry, "depth_deviation = \"deviation/{stem}.exr\"");
    }
    entry
}

fn truth_entry(truth: &Truth, stems: &[String]) -> String {
    let depth: Vec<_> = stems.iter().map(|stem| format!("\"truth/{stem}.exr\"")).collect();
    let poses: Vec<_> = truth.camera_from_object.iter().map(pose_entry).collect();
    format!(
        "\n[truth]\nshape = \"truth/shape.ply\"\ndepth = [\n  {},\n]\ncamera_from_object = [\n  {},\n]\n",
        depth.join(",\n  "),
        poses.join(",\n  ")
    )
}

fn pose_entry(pose: &Pose) -> String {
    let rows: [[f64; 3]; 3] =
        std::array::from_fn(|row| std::array::from_fn(|column| pose.rotation[(row, column)]));
    let translation: [f64; 3] = pose.translation.into();
    format!("{{ rotation = {rows:?}, translation = {translation:?} }}")
}

/// The frames' names where all are safe as file names, else their numbers.
fn file_stems(frames: &[Frame]) -> Vec<String> {
    let safe = |name: &str| {
        !name.starts_with('.')
            && !name.is_empty()
            && name
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.'))
    };
    if frames.iter().all(|frame| safe(&frame.name)) {
        frames.iter().map(|frame| frame.name.clone()).collect()
    } else {
        (0..frames.len()).map(|index| format!("{index:03}")).collect()
    }
}

fn create(folder: &Path) -> Result<(), SequenceError> {
    std::fs::create_dir(folder).map_err(|source| SequenceError::write(folder, source))
}

fn save(file: &Path, bytes: &[u8]) -> Result<(), SequenceError> {
    std::fs::write(file, bytes).map_err(|source| SequenceError::write(file, source))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Rotation3, Vector3};
    use crate::image::Grid;
    use crate::sequence::{LoadOptions, SequenceContent, load};

    fn pose(angle: f64) -> Pose {
        Pose {
            rotation: Rotation3::from_euler_angles(angle, 1.0 / 3.0, -2.0 * angle),
            translation: Vector3::new(0.1, -1e-17, 2.0 + angle),
        }
    }

    fn sample(names: [&str; 2]) -> Sequence {
        let frames = names.map(|name| Frame {
            name: name.into(),
            image: Grid::from_fn(8, 6, |c, r| [c as f32, r as f32, 255.0]).into(),
            mask: Grid::from_fn(8, 6, |c, r| (2..5).contains(&c) && r > 1),
            camera: Pinhole {
                fx: 10.1,
                fy: 1.0 / 3.0 * 31.0,
                cx: 4.0,
                cy: 3.25,
            },
            timestamp_s: (name != "b").then_some(0.1),
            camera_from_input: (name != "b").then(|| pose(0.7)),
            depth: (name != "b").then(|| Grid::from_fn(8, 6, |c, r| (c * r) as f32 * 0.1)),
            depth_deviation: (name == "a").then(|| Grid::from_fn(8, 6, |c, r| (c + r) as f32 * 0.001)),
        });
        Sequence::new(SequenceContent {
            name: "sample".into(),
            frames: frames.into(),
            motion_deviation: Some(0.01),
            focal_deviation: Some(0.1),
            truth: Some(Truth {
                camera_from_object: vec![pose(0.1), pose(-3.0)],
                depth: vec![Grid::filled(8, 6, 0.3), Grid::filled(8, 6, 0.0)],
                shape: vec![[0.1, 0.2, 0.3], [-1.0, 0.0, 1e-9]],
            }),
        })
        .unwrap()
    }

    fn assert_same(a: &Sequence, b: &Sequence) {
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }

    #[test]
    fn a_sequence_reads_back_bit_for_bit() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("deep/sample");
        let sequence = sample(["a", "b"]);
        write(&sequence, &target).unwrap();
        assert_same(&load(&target, &LoadOptions::default()).unwrap(), &sequence);
        let left: Vec<_> = std::fs::read_dir(target.parent().unwrap()).unwrap().collect();
        assert_eq!(left.len(), 1, "only the target is left");
    }

    #[test]
    fn names_that_are_no_file_names_become_numbers() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("sample");
        let sequence = sample(["left/\"0\"", "ö"]);
        write(&sequence, &target).unwrap();
        assert!(target.join("images/001.png").is_file());
        assert_same(&load(&target, &LoadOptions::default()).unwrap(), &sequence);
    }

    #[test]
    fn the_window_picks_frames_and_their_truth() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("sample");
        let mut content = sample(["a", "b"]).into_content();
        let last = Frame {
            name: "c".into(),
            ..content.frames[0].clone()
        };
        content.frames.push(last);
        let truth = content.truth.as_mut().unwrap();
        truth.camera_from_object.push(pose(2.0));
        truth.depth.push(Grid::filled(8, 6, 7.0));
        let sequence = Sequence::new(content).unwrap();
        write(&sequence, &target).unwrap();
        let window = crate::sequence::FrameWindow::parse("0..3", 2).unwrap();
        let picked = load(&target, &LoadOptions { depth: None, window }).unwrap();
        assert_eq!(
            picked
                .frames
                .iter()
                .map(|frame| &frame.name[..])
                .collect::<Vec<_>>(),
            ["a", "c"]
        );
        let truth = picked.truth.as_ref().unwrap();
        assert_eq!(truth.camera_from_object, [pose(0.1), pose(2.0)]);
        assert_eq!(truth.depth[1][(0, 0)], 7.0);
    }

    #[test]
    fn a_folder_in_use_is_left_alone() {
        let parent = tempfile::tempdir().unwrap();
        let outcome = write(&sample(["a", "b"]), parent.path());
        assert!(matches!(outcome, Err(SequenceError::TargetExists(_))));
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
    }
}
