//! `spba-ceres prepare`: the bundled sequence's pictures alone, against its truth; and inputs that cannot be prepared.
#![cfg(feature = "vision")]

use assert_cmd::Command;
use image::codecs::jpeg::JpegEncoder;
use spba_ceres::geometry::Vector3;
use spba_ceres::image::{Grid, Mask};
use spba_ceres::init::Estimate;
use spba_ceres::prepare::{MaskOptions, masks_by_shape};
use spba_ceres::report::{Surface, silhouette_iou};
use spba_ceres::sequence::{self, LoadOptions, Sequence};
use std::path::{Path, PathBuf};

fn bundled() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sequences/car")
}

fn prepare(arguments: &[&str]) -> std::process::Output {
    Command::cargo_bin("spba-ceres")
        .unwrap()
        // Whether networks are installed must not matter.
        .env("XDG_DATA_HOME", env!("CARGO_TARGET_TMPDIR"))
        .arg("prepare")
        .args(arguments)
        .output()
        .unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn load(folder: &Path) -> Sequence {
    sequence::load(folder, &LoadOptions::default()).unwrap()
}

/// The mean angle, in degrees, by which the turns between frames differ from the truth's.
fn turn_error_deg(found: &Sequence, truth: &Sequence) -> f64 {
    let poses = &truth.truth.as_ref().unwrap().camera_from_object;
    let of = |name: &str| poses[truth.frames.iter().position(|frame| frame.name == name).unwrap()];
    let first = &found.frames[0];
    let turned: Vec<f64> = found.frames[1..]
        .iter()
        .map(|frame| {
            let turn = frame
                .camera_from_input
                .unwrap()
                .after(&first.camera_from_input.unwrap().inverse());
            let expected = of(&frame.name).after(&of(&first.name).inverse());
            (turn.rotation * expected.rotation.inverse()).angle().to_degrees()
        })
        .collect();
    turned.iter().sum::<f64>() / turned.len() as f64
}

#[test]
fn pictures_and_masks_become_poses_and_depth() {
    let folder = tempfile::tempdir().unwrap();
    let truth = load(&bundled());
    let focal = truth.frames[0].camera.fx.to_string();
    let (images, masks) = (bundled().join("images"), bundled().join("masks"));
    let run = |out: &Path| {
        let output = prepare(&[
            text(&images),
            "--masks",
            text(&masks),
            "--focal",
            &focal,
            "--out",
            text(out),
        ]);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    };
    let out = folder.path().join("a");
    let said = run(&out);
    assert!(said.contains("10 of 10 frames placed"), "{said}");
    let found = load(&out);
    let error = turn_error_deg(&found, &truth);
    assert!(error < 1.0, "{error}");

    // Depth, once brought to the truth's scale, against the truth's.
    let mut ratios: Vec<f32> = Vec::new();
    for (frame, depth) in found.frames.iter().zip(&truth.truth.as_ref().unwrap().depth) {
        let pairs = frame.depth.as_ref().unwrap().data().iter().zip(depth.data());
        ratios.extend(pairs.filter(|(z, t)| **z > 0.0 && **t > 0.0).map(|(z, t)| z / t));
    }
    ratios.sort_by(f32::total_cmp);
    let at = |share: f64| ratios[(share * (ratios.len() - 1) as f64) as usize];
    assert!(ratios.len() > 5000, "{}", ratios.len());
    assert!(at(0.9) / at(0.1) < 1.06, "{} {} {}", at(0.1), at(0.5), at(0.9));

    assert!(run(&out).contains("made of this input already"));
    let again = folder.path().join("b");
    run(&again);
    let bytes = |folder: &Path| std::fs::read(folder.join("sequence.toml")).unwrap();
    assert_eq!(bytes(&out), bytes(&again));
}

#[test]
fn missing_and_blurred_frames_are_done_without() {
    let folder = tempfile::tempdir().unwrap();
    let truth = load(&bundled());
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    for k in [0, 1, 3, 4, 6, 7, 9] {
        let name = format!("{k:03}.png");
        let picture = image::open(bundled().join("images").join(&name)).unwrap();
        let picture = if k == 4 { picture.blur(6.0) } else { picture };
        picture.save(pictures.join(name)).unwrap();
    }
    let out = folder.path().join("out");
    let masks = bundled().join("masks");
    let output = prepare(&[
        text(&pictures),
        "--masks",
        text(&masks),
        "--focal",
        "400",
        "--review",
        "--out",
        text(&out),
    ]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        said.contains("6 of 7 frames placed")
            && said.contains("dropped, too little in common with the others: 004"),
        "{said}"
    );
    let error = turn_error_deg(&load(&out), &truth);
    assert!(error < 1.0, "{error}");
    assert!(image::open(out.join("review.png")).is_ok());

    let agreement = Command::cargo_bin("spba-ceres")
        .unwrap()
        .args(["eval", text(&out), "--masks", text(&masks)])
        .output()
        .unwrap();
    let table = String::from_utf8(agreement.stdout).unwrap();
    assert!(
        table
            .lines()
            .any(|line| line.starts_with("min") && line.contains("1.000")),
        "{table}"
    );
}

#[test]
fn a_focal_length_that_is_wrong_by_a_fifth_is_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let (images, masks) = (bundled().join("images"), bundled().join("masks"));
    for (focal, doubted) in [("400", false), ("480", true), ("320", true)] {
        let out = folder.path().join(focal);
        let output = prepare(&[
            text(&images),
            "--masks",
            text(&masks),
            "--focal",
            focal,
            "--out",
            text(&out),
        ]);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("10 of 10 frames placed"), "{said}");
        assert_eq!(said.contains("IN DOUBT"), doubted, "{said}");
    }
}

#[test]
fn a_solved_shape_mends_masks_that_it_does_not_explain() {
    let truth = load(&bundled());
    let known = truth.truth.clone().unwrap();
    let points = known
        .shape
        .iter()
        .map(|point| Vector3::from(point.map(f64::from)));
    let surface = Surface::from_points(points.collect());
    let (depth, known_depth) = (truth.frames[0].depth.as_ref().unwrap(), &known.depth[0]);
    let pairs = depth.data().iter().zip(known_depth.data());
    let (off_the_shelf, right) = pairs
        .filter(|(z, right)| **z > 0.0 && **right > 0.0)
        .fold((0.0, 0.0), |sums, (z, right)| {
            (sums.0 + f64::from(*z), sums.1 + f64::from(*right))
        });
    let estimate = Estimate {
        camera_from_object: known.camera_from_object,
        style: vec![],
        alpha: right / off_the_shelf,
        focal_factor: 1.0,
    };
    let whole: Vec<Mask> = truth.frames.iter().map(|frame| frame.mask.clone()).collect();
    // In one frame the mask goes down to the border, over all of the car's width.
    let leaked = truth
        .edited(|content| {
            let mask = &mut content.frames[2].mask;
            let [left, top, right, _] = mask.bounds().unwrap();
            *mask = Grid::from_fn(mask.width(), mask.height(), |column, row| {
                mask[(column, row)] || (left..right).contains(&column) && row > top
            });
        })
        .unwrap();
    let mended = masks_by_shape(&leaked, &surface, &estimate, &MaskOptions::default(), &|_| true).unwrap();
    let anew: Vec<usize> = (0..mended.len()).filter(|&k| mended[k].is_some()).collect();
    assert_eq!(anew, [2]);
    let before = silhouette_iou(&leaked.frames[2].mask, &whole[2]);
    let after = silhouette_iou(mended[2].as_ref().unwrap(), &whole[2]);
    assert!(before < 0.75 && after > 0.95, "{before} -> {after}");
}

#[test]
fn solve_makes_its_sequence_anew_where_options_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (images, masks) = (bundled().join("images"), bundled().join("masks"));
    let solve = |focal: &str, out: &str| {
        let output = Command::cargo_bin("spba-ceres")
            .unwrap()
            .args(["solve", text(&images), "--masks", text(&masks), "--focal", focal])
            .args(["--max-frames", "4", "--set", "init.hypotheses.count=1"])
            .args([
                "--set",
                "solver={ levels = 1, max_steps = 1, iterations_per_call = 2 }",
            ])
            .args(["--out", text(&folder.path().join(out))])
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let said = String::from_utf8(output.stdout).unwrap();
        let sequence = load(&folder.path().join("images.sequence"));
        let config = std::fs::read_to_string(folder.path().join(out).join("config.toml")).unwrap();
        assert!(config.contains("motion_deviation = 0.001"), "{config}");
        (
            said.contains("made of this input already"),
            sequence.frames[0].camera.fx,
        )
    };
    let (first, again, other) = (solve("400", "a"), solve("400", "b"), solve("380", "c"));
    assert!(!first.0 && again.0 && !other.0);
    assert_eq!(first.1, again.1);
    assert!(other.1 < first.1 - 5.0, "{} {}", first.1, other.1);
}

/// Motion JPEG in an AVI file: one chunk a frame behind the least of headers.
fn video(file: &Path, frames: &[PathBuf]) {
    let chunk = |name: &[u8; 4], data: &[u8]| {
        let mut bytes = name.to_vec();
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        bytes
    };
    let list = |name: &[u8; 4], parts: &[Vec<u8>]| chunk(b"LIST", &[&name[..], &parts.concat()].concat());
    let words = |numbers: &[u32]| -> Vec<u8> { numbers.iter().flat_map(|n| n.to_le_bytes()).collect() };
    let mut pictures = Vec::new();
    let (mut width, mut height) = (0, 0);
    for frame in frames {
        let picture = image::open(frame).unwrap().into_rgb8();
        (width, height) = picture.dimensions();
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, 98)
            .encode_image(&picture)
            .unwrap();
        pictures.push(chunk(b"00dc", &jpeg));
    }
    let count = frames.len() as u32;
    let main = words(&[100_000, 0, 0, 0x10, count, 0, 1, 0, width, height, 0, 0, 0, 0]);
    let mut stream = b"vidsMJPG".to_vec();
    stream.extend(words(&[0, 0, 0, 1, 10, 0, count, 0, u32::MAX, 0, 0, 0]));
    let mut format = words(&[40, width, height, 1 | 24 << 16]);
    format.extend(b"MJPG");
    format.extend(words(&[3 * width * height, 0, 0, 0, 0]));
    let headers = list(
        b"hdrl",
        &[
            chunk(b"avih", &main),
            list(b"strl", &[chunk(b"strh", &stream), chunk(b"strf", &format)]),
        ],
    );
    let body = [headers, list(b"movi", &pictures)].concat();
    std::fs::write(file, chunk(b"RIFF", &[b"AVI ".to_vec(), body].concat())).unwrap();
}

#[test]
fn a_video_is_read_and_a_truncated_one_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<PathBuf> = (0..10)
        .map(|k| bundled().join(format!("images/{k:03}.png")))
        .collect();
    let whole = folder.path().join("whole.avi");
    video(&whole, &frames);
    let bytes = std::fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.avi");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    for (file, expected) in [(&whole, "10 of 320 × 240"), (&cut, "of 320 × 240")] {
        let out = folder
            .path()
            .join(format!("{}-out", file.file_stem().unwrap().to_str().unwrap()));
        let output = prepare(&[
            text(file),
            "--focal",
            "400",
            "--box",
            "40,40,240,160",
            "--out",
            text(&out),
        ]);
        let said =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.contains(expected), "{said}");
        // Before the work and again at the end.
        assert_eq!(said.matches("scripts/fetch_networks").count(), 2, "{said}");
    }
    std::fs::write(&cut, &bytes[..300]).unwrap();
    refused(
        &[text(&cut), "--out", text(&folder.path().join("none"))],
        "no video that OpenCV can decode",
    );
}

/// One line on standard error that says so, and nothing made.
fn refused(arguments: &[&str], message: &str) {
    let output = prepare(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{said}");
    assert!(
        said.contains(message) && said.trim_end().lines().count() <= 3,
        "{said}"
    );
    assert!(!Path::new(arguments[arguments.len() - 1]).exists());
}

#[test]
fn what_cannot_be_prepared_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (pictures, out) = (folder.path().join("pictures"), folder.path().join("out"));
    std::fs::create_dir(&pictures).unwrap();
    let copy = |k: usize, to: &str| {
        std::fs::copy(bundled().join(format!("images/{k:03}.png")), pictures.join(to)).unwrap();
    };
    let of_pictures = |message: &str| refused(&[text(&pictures), "--out", text(&out)], message);
    refused(
        &[text(&folder.path().join("nowhere")), "--out", text(&out)],
        "no such file or folder",
    );
    copy(0, "a.png");
    std::fs::write(pictures.join("notes.txt"), "no picture").unwrap();
    of_pictures("1 frames, at least two are needed");
    copy(5, "b.png");
    image::RgbImage::new(64, 48).save(pictures.join("c.png")).unwrap();
    of_pictures("c.png: 64 × 48 pixels, but most are 320 × 240");
    std::fs::write(pictures.join("c.png"), "no picture either").unwrap();
    of_pictures("c.png: image does not decode");
    std::fs::remove_file(pictures.join("c.png")).unwrap();
    let masks = bundled().join("masks");
    refused(
        &[text(&pictures), "--masks", text(&masks), "--out", text(&out)],
        "a.png: file is missing",
    );
    refused(&[text(&pictures), "--focal", "wide", "--out", text(&out)], "26mm");
    refused(
        &[text(&pictures), "--box", "1,2,3", "--out", text(&out)],
        "four numbers",
    );
    for (flags, message) in [
        (["--box", "5000,5000,10,10"], "--box: no pixel is inside it"),
        (["--max-frames", "1"], "--max-frames: 1 is too few"),
        (["--max-size", "0"], "--max-size: 0 is too few"),
        (["--networks", "nowhere"], "nowhere: cannot be read"),
    ] {
        refused(
            &[text(&pictures), flags[0], flags[1], "--out", text(&out)],
            message,
        );
    }
    // Two pictures of nothing have nothing in common.
    for name in ["a.png", "b.png"] {
        image::RgbImage::from_pixel(320, 240, image::Rgb([90, 90, 90]))
            .save(pictures.join(name))
            .unwrap();
    }
    refused(
        &[text(&pictures), "--box", "40,40,240,160", "--out", text(&out)],
        "error:",
    );
}
