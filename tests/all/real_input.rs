//! What tools and people leave in a workspace: taken as it is meant, or told.

use crate::fixture;
use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// A valid COLMAP workspace, to be changed.
struct Workspace {
    folder: tempfile::TempDir,
}

impl Workspace {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fixture::workspace(folder.path());
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn edit(&self, name: &str, edit: impl Fn(String) -> String) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        std::fs::write(self.path(name), edit(text)).unwrap();
    }

    /// A mask whose object is the box of the fixture's.
    fn mask(&self, file: &str, object: u8, else_: u8) {
        fixture::picture(&self.path(file), fixture::WIDTH, fixture::HEIGHT, |c, r| {
            if (8..24).contains(&c) && (6..18).contains(&r) {
                object
            } else {
                else_
            }
        });
    }

    /// What `inspect` prints, and whether it finds the input usable.
    fn inspect(&self) -> (String, bool) {
        let output = Command::cargo_bin("spba-ceres")
            .unwrap()
            .arg("inspect")
            .arg(self.folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)), "{said}");
        (said, output.status.success())
    }

    fn usable(&self, words: &[&str]) -> String {
        let (said, usable) = self.inspect();
        assert!(usable, "{said}");
        for word in words {
            assert!(said.contains(word), "no `{word}` in {said}");
        }
        said
    }

    fn refused(&self, words: &[&str]) {
        let (said, usable) = self.inspect();
        assert!(!usable, "{said}");
        for word in words {
            assert!(said.contains(word), "no `{word}` in {said}");
        }
    }

    /// The frames in order.
    fn frames(&self) -> Vec<String> {
        let said = self.usable(&[]);
        let rows = said.lines().skip_while(|line| !line.starts_with("frame")).skip(1);
        let names = rows
            .take_while(|line| !line.is_empty())
            .map(|line| line.split(' ').next());
        names.map(|name| name.unwrap().to_owned()).collect()
    }
}

#[test]
fn frames_come_in_the_order_of_their_numbers() {
    let workspace = Workspace::new();
    for (from, to) in [("a", "f1"), ("b", "f10"), ("c", "f9")] {
        for (from, to) in [
            (format!("images/{from}.png"), format!("images/{to}.png")),
            (format!("masks/{from}.png.png"), format!("masks/{to}.png.png")),
        ] {
            std::fs::rename(workspace.path(&from), workspace.path(&to)).unwrap();
        }
        workspace.edit("sparse/images.txt", |text| {
            text.replace(&format!(" {from}.png"), &format!(" {to}.png"))
        });
    }
    assert_eq!(workspace.frames(), ["f1", "f9", "f10"]);
}

#[test]
fn byte_order_marks_are_passed_over() {
    let workspace = Workspace::new();
    let plain = workspace.usable(&[]);
    for name in ["sparse/cameras.txt", "sparse/images.txt", "sparse/points3D.txt"] {
        workspace.edit(name, |text| format!("\u{feff}{}", text.replace('\n', "\r\n")));
    }
    let times = std::fs::read_to_string(workspace.path("times.txt")).unwrap();
    let wide: Vec<u8> = format!("\u{feff}{times}")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    std::fs::write(workspace.path("times.txt"), wide).unwrap();
    assert_eq!(workspace.usable(&[]), plain);
    std::fs::write(workspace.path("times.txt"), b"a.png \xff1").unwrap();
    let (said, _) = workspace.inspect();
    assert!(
        said.contains("times.txt: text: not in UTF-8; save it in UTF-8"),
        "{said}"
    );
}

#[test]
fn of_several_models_the_one_with_most_images_is_read() {
    let workspace = Workspace::new();
    let sparse = workspace.path("sparse");
    for model in ["0", "1"] {
        std::fs::create_dir(sparse.join(model)).unwrap();
    }
    for file in ["cameras.txt", "images.txt", "points3D.txt"] {
        std::fs::rename(sparse.join(file), sparse.join("1").join(file)).unwrap();
    }
    std::fs::copy(sparse.join("1/cameras.txt"), sparse.join("0/cameras.txt")).unwrap();
    std::fs::write(
        sparse.join("0/images.txt"),
        "1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 -0.2 0 0 1 b.png\n\n",
    )
    .unwrap();
    workspace.usable(&["sparse/0, sparse/1) of 2, 3 images; sparse/1 is read", "c "]);
}

#[test]
fn lens_coefficients_must_be_numbers_and_leave_an_object() {
    let workspace = Workspace::new();
    for (model, parameters, words) in [
        (
            "SIMPLE_RADIAL",
            "40 16 12 nan",
            "cameras.txt: camera 1.k1: lens coefficient is NaN",
        ),
        (
            "OPENCV",
            "40 40 16 12 0 0 inf 0",
            "camera 1.p1: lens coefficient is inf",
        ),
        (
            "FOV",
            "40 40 16 12 -inf",
            "camera 1.omega: lens coefficient is -inf",
        ),
        (
            "SIMPLE_RADIAL",
            "40 16 12 1e200",
            "lens coefficients put none of the 192 pixels of the object",
        ),
        (
            "PINHOLE",
            "0.004 0.004 16 12",
            "camera 1.fx: focal length is 0.004 in an image of 32 × 24",
        ),
        ("PINHOLE", "40 1e30 16 12", "camera 1.fy: focal length is"),
        (
            "PINHOLE",
            "40 40 16 1e9",
            "camera 1.cy: principal point is 1000000000 in",
        ),
    ] {
        let text = format!("1 {model} 32 24 {parameters}\n");
        std::fs::write(workspace.path("sparse/cameras.txt"), text).unwrap();
        workspace.refused(&[words]);
    }
}

#[test]
fn cameras_that_went_astray_are_named() {
    let workspace = Workspace::new();
    workspace.edit("sparse/images.txt", |text| {
        text.replace("2 1 0 0 0 -0.2 0 0 1", "2 1 0 0 0 -1e7 0 0 1")
    });
    workspace.refused(&[
        "images.txt: image of frame `b`: its camera is ",
        "times farther away",
    ]);
    workspace.edit("sparse/images.txt", |text| text.replace("-1e7", "1e177"));
    workspace.refused(&["images.txt: ", "1e177 units away"]);
}

#[test]
fn points_that_are_no_points_are_left_out() {
    let workspace = Workspace::new();
    workspace.edit("sparse/points3D.txt", |text| {
        text.replace("points: 6", "points: 8") + "6 nan 0 4 1 2 3 0.5 1 0\n7 0 0 inf 1 2 3 0.5 1 0\n"
    });
    workspace.usable(&["2 points whose position is not finite are left out"]);
    workspace.edit("sparse/points3D.txt", |text| {
        text.replace("points: 8", "points: 9") + "8 1e8 0 1e9 1 2 3 0.5 1 0\n"
    });
    workspace
        .usable(&["1 depth values are more than 1000 times larger or smaller than the object's (4.000)"]);
}

#[test]
fn dense_depth_that_is_empty_gives_way_to_points() {
    let workspace = Workspace::new();
    fixture::stereo(workspace.folder.path());
    workspace.usable(&["100.0 %"]);
    let map = |name: &str, z: f32| {
        let (width, height) = (fixture::WIDTH, fixture::HEIGHT);
        let mut bytes = format!("{width}&{height}&1&").into_bytes();
        bytes.extend((0..width * height).flat_map(|_| z.to_le_bytes()));
        let file = format!("stereo/depth_maps/{name}.geometric.bin");
        fixture::write(&workspace.path(&file), &bytes);
    };
    for name in ["a.png", "b.png"] {
        map(name, 0.0);
    }
    let said =
        workspace.usable(&["2 frames have dense depth that is empty on the object; the sparse points"]);
    assert!(!said.contains(" 0.0 %"), "{said}");
    // What openMVS and COLMAP call invalid, and what is no depth at all.
    for (z, told) in [(-1.0, "2 frames have dense"), (f32::NAN, "2 frames have dense")] {
        map("a.png", z);
        workspace.usable(&[told]);
    }
}

#[test]
fn dense_depth_of_another_model_is_refused() {
    let workspace = Workspace::new();
    // Points enough to tell, on the object and on the plane.
    let mut text = String::new();
    for i in 0..40 {
        text += &format!(
            "{i} {} {} 4 1 2 3 0.5 1 0\n",
            0.1 * f64::from(i % 8) - 0.35,
            0.1 * f64::from(i / 8) - 0.25
        );
    }
    std::fs::write(workspace.path("sparse/points3D.txt"), text).unwrap();
    fixture::stereo(workspace.folder.path());
    workspace.usable(&["100.0 %"]);
    for name in fixture::NAMES {
        let file = workspace.path(&format!("stereo/depth_maps/{name}.geometric.bin"));
        let bytes = std::fs::read(&file).unwrap();
        let at = bytes.len() - 4 * fixture::WIDTH * fixture::HEIGHT;
        let far = bytes[at..]
            .as_chunks::<4>()
            .0
            .iter()
            .flat_map(|&z| (3.0 * f32::from_le_bytes(z)).to_le_bytes());
        let far: Vec<u8> = bytes[..at].iter().copied().chain(far).collect();
        std::fs::write(&file, far).unwrap();
    }
    workspace.refused(&["geometric.bin: depth: it is 3.000 times the depth of the sparse points"]);
}

#[test]
fn photometric_depth_alone_is_told() {
    let workspace = Workspace::new();
    fixture::write(
        &workspace.path("stereo/depth_maps/a.png.photometric.bin"),
        b"1&1&1&\0\0\x80\x3f",
    );
    workspace.usable(&["holds no geometric depth maps"]);
}

#[test]
fn masks_are_believed_where_they_can_be() {
    let workspace = Workspace::new();
    let plain = workspace.usable(&[]);
    // 0 and 1; and a mask beside an overlay and a labelling tool's file.
    workspace.mask("masks/a.png.png", 1, 0);
    std::fs::rename(workspace.path("masks/b.png.png"), workspace.path("masks/b.png")).unwrap();
    std::fs::copy(workspace.path("images/b.png"), workspace.path("masks/b.jpg")).unwrap();
    std::fs::write(workspace.path("masks/b.json"), "{}").unwrap();
    std::fs::write(workspace.path("images/._a.png"), "\0\u{5}").unwrap();
    assert_eq!(workspace.usable(&[]), plain);

    workspace.mask("masks/a.png.png", 0, 255);
    workspace.refused(&[
        "masks/a.png.png: no mask of an object: it covers 75 %",
        "100 % of its border (is it inverted?)",
    ]);
    workspace.mask("masks/a.png.png", 255, 255);
    workspace.refused(&["masks/a.png.png: no mask of an object: it covers 100 %"]);
    fixture::picture(
        &workspace.path("masks/a.png.png"),
        fixture::WIDTH,
        fixture::HEIGHT,
        |c, r| (8 * c + r) as u8,
    );
    workspace.refused(&[
        "masks/a.png.png: no mask of an object: ",
        "neither black nor white",
    ]);
}

#[test]
fn masks_along_most_of_the_border_are_doubted() {
    let workspace = Workspace::new();
    for name in fixture::NAMES {
        // All but the lower left.
        let mask = format!("masks/{name}.png");
        fixture::picture(&workspace.path(&mask), fixture::WIDTH, fixture::HEIGHT, |c, r| {
            if c < 14 && r > 8 { 0 } else { 255 }
        });
    }
    workspace.usable(&["the masks cover 73 % of the pictures", "are they inverted?"]);
}

#[test]
fn pictures_that_are_not_read_are_told() {
    let workspace = Workspace::new();
    for name in ["d.HEIC", "e.heic", "f.webp", "._a.png"] {
        std::fs::write(workspace.path("images").join(name), "").unwrap();
    }
    workspace
        .usable(&["images/: left out are 3 pictures that are not read (2 .heic, 1 .webp): convert them"]);
}

#[test]
fn a_jpeg_that_is_cut_off_is_refused() {
    let workspace = Workspace::new();
    let picture = image::open(workspace.path("images/b.png")).unwrap();
    let file = workspace.path("images/b.png");
    // Told by content, not by name.
    picture.save_with_format(&file, image::ImageFormat::Jpeg).unwrap();
    workspace.usable(&[]);
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() - 20]).unwrap();
    workspace.refused(&[
        "images/b.png: image does not decode (the file ends before its picture does); copy it again",
    ]);
}

#[test]
fn more_than_memory_holds_is_refused_before_it_is_read() {
    let workspace = Workspace::new();
    for name in fixture::NAMES {
        // A PNG's header alone: 30,000 × 30,000 pixels in grey.
        let mut png = std::fs::read(workspace.path("images").join(name)).unwrap();
        png[16..24].copy_from_slice(&[0, 0, 0x75, 0x30, 0, 0, 0x75, 0x30]);
        let sum = checksum(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        std::fs::write(workspace.path("images").join(name), png).unwrap();
    }
    let (said, usable) = workspace.inspect();
    assert!(
        !usable && said.contains("images.txt: frames: 3 pictures would take about 162.0 GB"),
        "{said}"
    );
}

/// PNG's.
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            if sum & 1 == 1 {
                sum >> 1 ^ 0xedb8_8320
            } else {
                sum >> 1
            }
        })
    })
}

#[test]
fn colours_are_for_terminals_alone() {
    let output = Command::cargo_bin("spba-ceres")
        .unwrap()
        .env("RUST_LOG", "info")
        .args([
            "prior",
            "learn",
            "--sources",
            "nowhere.toml",
            "--out",
            "x.safetensors",
        ])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests"))
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && !said.contains('\u{1b}'), "{said}");
    // The cause once.
    assert_eq!(said.matches("No such file").count(), 1, "{said}");
}
