//! Every kind of bad input: one line that names file, field and mend, exit status 1, nothing left behind.
//!
//! Each test makes a small valid input, breaks one thing and runs the program.

use crate::fixture;
use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// A folder with a valid input in `input/`.
struct Input {
    folder: tempfile::TempDir,
}

impl Input {
    /// A COLMAP workspace (text) with openMVS depth in `openmvs/`.
    fn workspace() -> Self {
        let input = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        fixture::workspace(&input.path(""));
        fixture::openmvs(&input.path("openmvs"), 6, 0.0);
        input
    }

    /// The same as a sequence folder.
    fn sequence() -> Self {
        let workspace = Self::workspace();
        let input = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        program()
            .args(["import".as_ref(), workspace.path("").as_os_str()])
            .args(["--depth".as_ref(), workspace.path("openmvs").as_os_str()])
            .args(["--out".as_ref(), input.path("").as_os_str()])
            .assert()
            .success();
        input
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join("input").join(name)
    }

    /// Replaces text in a file; it must be there.
    fn edit(&self, file: &str, from: &str, to: &str) -> &Self {
        let text = std::fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} holds no {from}");
        std::fs::write(self.path(file), text.replacen(from, to, 1)).unwrap();
        self
    }

    fn truncate(&self, file: &str) -> &Self {
        let bytes = std::fs::read(self.path(file)).unwrap();
        std::fs::write(self.path(file), &bytes[..bytes.len() * 2 / 3]).unwrap();
        self
    }

    fn remove(&self, file: &str) -> &Self {
        std::fs::remove_file(self.path(file)).unwrap();
        self
    }

    /// `import`, `solve` and `inspect` all refuse it, with all of `words` in the message.
    fn refused(&self, words: &[&str]) {
        self.refused_with(&[], words);
    }

    fn refused_with_depth(&self, words: &[&str]) {
        let depth = self.path("openmvs");
        self.refused_with(&["--depth", depth.to_str().unwrap()], words);
    }

    fn refused_with(&self, options: &[&str], words: &[&str]) {
        let out = self.folder.path().join("out");
        let input = self.path("");
        for verb in ["import", "solve"] {
            let run = program()
                .arg(verb)
                .arg(&input)
                .args(options)
                .args(["--out".as_ref(), out.as_os_str()])
                .output()
                .unwrap();
            let message = String::from_utf8(run.stderr).unwrap();
            let errors: Vec<_> = message
                .lines()
                .filter(|line| !line.starts_with("note: "))
                .collect();
            assert_eq!(run.status.code(), Some(1), "{verb}: {message}");
            assert_eq!(errors.len(), 1, "{verb}: {message}");
            for word in words {
                assert!(errors[0].contains(word), "{verb}: no `{word}` in: {message}");
            }
            assert_only_input_is_left(self.folder.path());
        }

        let inspect = program()
            .arg("inspect")
            .arg(&input)
            .args(options)
            .output()
            .unwrap();
        assert_eq!(inspect.status.code(), Some(1));
        let said = String::from_utf8(inspect.stdout).unwrap() + &String::from_utf8(inspect.stderr).unwrap();
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said}");
        }
        assert!(!said.contains("panicked"), "{said}");
    }
}

fn program() -> Command {
    Command::cargo_bin("spba-ceres").unwrap()
}

fn assert_only_input_is_left(folder: &Path) {
    let left: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["input"]);
}

#[test]
fn the_unbroken_inputs_are_usable() {
    let (workspace, sequence) = (Input::workspace(), Input::sequence());
    program().arg("inspect").arg(sequence.path("")).assert().success();
    program()
        .arg("inspect")
        .arg(workspace.path(""))
        .assert()
        .success();
    let depth = workspace.path("openmvs");
    program()
        .arg("inspect")
        .arg(workspace.path(""))
        .arg("--depth")
        .arg(depth)
        .assert()
        .success();
}

#[test]
fn masks() {
    let black = |file: &Path| fixture::picture(file, fixture::WIDTH, fixture::HEIGHT, |_, _| 127);
    let input = Input::sequence();
    black(&input.path("masks/b.png"));
    input.refused(&["masks/b.png: mask is empty", "paint"]);

    let input = Input::sequence();
    input
        .remove("masks/b.png")
        .refused(&["masks/b.png: mask of frame `b` is missing", "put it there"]);

    let input = Input::sequence();
    fixture::picture(&input.path("masks/b.png"), 31, 24, |_, _| 255);
    input.refused(&[
        "masks/b.png: mask is 31 × 24, but the frame is 32 × 24",
        "make it",
    ]);

    let input = Input::workspace();
    input
        .remove("masks/c.png.png")
        .refused(&["masks/c.png.png: mask of frame `c` is missing"]);
}

#[test]
fn too_few_frames() {
    Input::sequence().refused_with(&["--frames", "1..2"], &["sequence.toml: frames: 1 left", "widen"]);
    Input::workspace().refused_with(&["--every", "3"], &["images.txt: frames: 1 left"]);
    Input::workspace().refused_with(&["--frames", "7.."], &["frames: 0 left"]);
    Input::workspace().refused_with(&["--frames", "2..1"], &["`2..1` holds no frame"]);
    Input::workspace().refused_with(&["--every", "0"], &["--every must be at least 1"]);
}

#[test]
fn intrinsics() {
    for (value, shown) in [("nan", "NaN"), ("0.0", "0"), ("-40.0", "-40"), ("inf", "inf")] {
        let input = Input::sequence();
        input.edit("sequence.toml", "fx = 40.0", &format!("fx = {value}"));
        input.refused(&[
            "sequence.toml: frames[0].camera.fx: focal length is",
            shown,
            "greater than zero",
        ]);
    }
    let input = Input::workspace();
    input.edit("sparse/cameras.txt", "24 40 40", "24 40 NaN");
    input.refused(&["cameras.txt: camera 1.fy: focal length is NaN"]);

    let input = Input::workspace();
    input.edit("sparse/cameras.txt", "PINHOLE", "EQUIRECTANGULAR");
    input.refused(&[
        "cameras.txt: camera model: `EQUIRECTANGULAR` is unknown",
        "convert",
        "OPENCV_FISHEYE",
    ]);

    let input = Input::workspace();
    fixture::sparse_binary(&input.path(""), 77, &fixture::CAMERA);
    input.refused(&["cameras.bin: camera model: `77` is unknown"]);

    let input = Input::workspace();
    input.edit("sparse/cameras.txt", "16 12", "16");
    input.refused(&["cameras.txt: line 2: camera parameters: 3 numbers, the model has 4"]);
}

#[test]
fn poses() {
    let given = "motion_deviation = 0.02\n";
    for (field, what) in [
        ("motion_deviation", "is no length"),
        ("focal_deviation", "is no share"),
    ] {
        for value in ["-0.005", "0", "nan", "inf"] {
            let input = Input::sequence();
            input.edit("sequence.toml", given, &format!("{field} = {value}\n"));
            input.refused(&[&format!("sequence.toml: {field}:"), what, "more than 0"]);
        }
    }
    let input = Input::sequence();
    input.edit("sequence.toml", "rotation = [[1.0", "rotation = [[1.1");
    input.refused(&[
        "sequence.toml: frames[0].camera_from_input.rotation: not orthonormal",
        "give an orthonormal",
    ]);

    let input = Input::workspace();
    input.edit("sparse/images.txt", "2 1 0 0 0", "2 0 0 0 0");
    input.refused(&["images.txt: line 4: pose: pose is no rigid motion"]);
}

#[test]
fn truncated_files() {
    for file in ["cameras.bin", "images.bin", "points3D.bin"] {
        let input = Input::workspace();
        fixture::sparse_binary(&input.path(""), 1, &fixture::CAMERA);
        input
            .truncate(&format!("sparse/{file}"))
            .refused(&[file, "file is truncated", "export it again"]);
    }
    for file in ["scene.mvs", "depth0001.dmap"] {
        let input = Input::workspace();
        input
            .truncate(&format!("openmvs/{file}"))
            .refused_with_depth(&[file, "file is truncated"]);
    }
    let input = Input::workspace();
    fixture::stereo(&input.path(""));
    input
        .truncate("stereo/depth_maps/b.png.geometric.bin")
        .refused(&["b.png.geometric.bin: depth: file is truncated"]);
    Input::sequence()
        .truncate("depth/b.exr")
        .refused(&["depth/b.exr: depth map does not decode", "EXR"]);
    Input::sequence()
        .truncate("images/b.png")
        .refused(&["images/b.png: image does not decode", "PNG or JPEG"]);
    Input::workspace()
        .truncate("sparse/images.txt")
        .refused(&["images.txt: "]);
}

#[test]
fn an_openmvs_archive() {
    let input = Input::workspace();
    fixture::write(&input.path("openmvs/scene.mvs"), b"MVS\0and more");
    input.refused_with_depth(&[
        "scene.mvs: format: this is openMVS's internal archive",
        "InterfaceCOLMAP",
    ]);
}

#[test]
fn counts_that_disagree() {
    let input = Input::workspace();
    input.edit("sparse/images.txt", "images: 3", "images: 4");
    input.refused(&[
        "images.txt: number of images: says 4, but there are 3",
        "export it again",
    ]);

    let input = Input::workspace();
    fixture::sparse_binary(&input.path(""), 1, &fixture::CAMERA);
    let mut bytes = std::fs::read(input.path("sparse/images.bin")).unwrap();
    bytes[0] = 2;
    fixture::write(&input.path("sparse/images.bin"), &bytes);
    input.refused(&["images.bin: number of images: ", "bytes follow"]);
    bytes[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    fixture::write(&input.path("sparse/images.bin"), &bytes);
    input.refused(&["images.bin: images: file is truncated"]);

    let input = Input::workspace();
    input.remove("openmvs/depth0002.dmap");
    input.refused_with_depth(&[
        "scene.mvs: calibrated images: says 3, but there are 2",
        "DensifyPointCloud",
    ]);

    let input = Input::workspace();
    input
        .remove("images/b.png")
        .refused(&["images/b.png: image of frame `b` is missing"]);
}

#[test]
fn depth_that_does_not_belong() {
    let input = Input::workspace();
    let mut map = fixture::dmap(1, "images/b.png", fixture::CAMERA);
    map.center[1] += 0.5;
    fixture::write(&input.path("openmvs/depth0001.dmap"), &map.encode());
    input.refused_with_depth(&[
        "depth0001.dmap: R, C: pose differs from COLMAP's",
        "image_undistorter",
    ]);

    let input = Input::workspace();
    let mut map = fixture::dmap(1, "images/b.png", fixture::CAMERA);
    (map.depth_size, map.z) = ((16, 24), vec![4.0; 16 * 24]);
    fixture::write(&input.path("openmvs/depth0001.dmap"), &map.encode());
    input.refused_with_depth(&["depth0001.dmap: depth map is 16 × 24, but the frame is 32 × 24"]);

    let input = Input::sequence();
    let small = spba_ceres::image::Grid::filled(5, 4, 1.0f32);
    spba_ceres::image::write_depth(&small, &input.path("depth/a.exr")).unwrap();
    input.refused(&["depth/a.exr: depth map is 5 × 4, but the frame is 32 × 24"]);

    let input = Input::workspace();
    input.refused_with(&["--depth", "nowhere"], &["nowhere/scene.mvs: cannot be read"]);
    let input = Input::sequence();
    input.refused_with(
        &["--depth", "openmvs"],
        &["--depth: a sequence folder names its own depth"],
    );
}

#[test]
fn the_manifest() {
    let input = Input::sequence();
    input.edit("sequence.toml", "mask = ", "masc = ");
    input.refused(&["sequence.toml: line ", "unknown field `masc`", "expected"]);

    let input = Input::sequence();
    input.edit("sequence.toml", "name = \"b\"", "name = \"a\"");
    input.refused(&["sequence.toml: frames[1].name: `a` is taken", "name of its own"]);

    let input = Input::sequence();
    input.edit("sequence.toml", "\"images/a.png\"", "\"../input/images/a.png\"");
    input.refused(&["sequence.toml: frames[0].image: path `../input/images/a.png` leaves the folder"]);

    let input = Input::sequence();
    input.edit("sequence.toml", "schema = 1", "schema = 2");
    input.refused(&["sequence.toml: schema: 2 is not known here", "reads schema 1"]);

    Input::sequence()
        .truncate("sequence.toml")
        .refused(&["sequence.toml: line "]);
}

#[test]
fn inspect_lists_every_problem() {
    let input = Input::sequence();
    input
        .edit("sequence.toml", "fx = 40.0", "fx = 0.0")
        .remove("masks/b.png")
        .truncate("images/c.png");
    let output = program().arg("inspect").arg(input.path("")).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(said.matches("problem: ").count(), 3, "{said}");
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("mend the 3 problems above"), "{message}");
}

#[test]
fn folders() {
    let empty = Input {
        folder: tempfile::tempdir().unwrap(),
    };
    std::fs::create_dir(empty.path("")).unwrap();
    empty.refused(&["input", "no input of a known kind", "sequence.toml"]);

    let input = Input::workspace();
    std::fs::remove_dir_all(input.path("masks")).unwrap();
    input.refused(&["masks: folder is missing", "one mask an image"]);
}

#[test]
fn an_output_folder_in_use_is_left_alone() {
    let input = Input::workspace();
    let out = input.path("images");
    let output = program()
        .arg("import")
        .arg(input.path(""))
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("images: output folder is in use"), "{message}");
    assert_eq!(std::fs::read_dir(out).unwrap().count(), 3);
}
