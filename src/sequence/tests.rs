//! Whole inputs, read through the public door.

use super::*;
use crate::geometry::Vector3;
use std::path::PathBuf;

fn workspace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fixture::workspace(folder.path());
    folder
}

fn plain(folder: &Path) -> Sequence {
    load(folder, &LoadOptions::default()).unwrap()
}

fn with_depth(folder: &Path) -> Result<Sequence, SequenceError> {
    let depth = Some(folder.join("openmvs"));
    load(
        folder,
        &LoadOptions {
            depth,
            ..LoadOptions::default()
        },
    )
}

#[test]
fn colmap_text_is_read_with_its_points_as_depth() {
    let folder = workspace();
    let sequence = plain(folder.path());
    let names: Vec<_> = sequence.frames.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    for (i, frame) in sequence.frames.iter().enumerate() {
        assert_eq!(frame.timestamp_s, Some(i as f64));
        let pose = frame.camera_from_input.unwrap();
        assert!((pose.center() - Vector3::from(fixture::center(i))).norm() < 1e-12);
        let depth = frame.depth.as_ref().unwrap();
        for (point, _) in fixture::points() {
            let at = frame
                .camera
                .project(&pose.transform(&Vector3::from(point)))
                .unwrap();
            if let Some(pixel) = depth.pixel_at(at.x, at.y) {
                assert_eq!(depth[pixel], fixture::PLANE as f32);
            }
        }
        assert!(depth.data().iter().filter(|&&z| z > 0.0).count() >= 5);
    }
}

#[test]
fn colmap_binary_says_the_same_as_text() {
    let folder = workspace();
    let from_text = plain(folder.path());
    for name in ["cameras.txt", "images.txt", "points3D.txt"] {
        std::fs::remove_file(folder.path().join("sparse").join(name)).unwrap();
    }
    fixture::sparse_binary(folder.path(), 1, &fixture::CAMERA);
    assert_eq!(format!("{:?}", plain(folder.path())), format!("{from_text:?}"));
    let (sparse, zero) = (folder.path().join("sparse"), folder.path().join("sparse/0"));
    std::fs::create_dir(&zero).unwrap();
    for name in ["cameras.bin", "images.bin", "points3D.bin"] {
        std::fs::rename(sparse.join(name), zero.join(name)).unwrap();
    }
    assert_eq!(format!("{:?}", plain(folder.path())), format!("{from_text:?}"));
}

#[test]
fn colmaps_dense_depth_comes_before_its_points() {
    let folder = workspace();
    fixture::stereo(folder.path());
    let depth = plain(folder.path())
        .into_content()
        .frames
        .remove(1)
        .depth
        .unwrap();
    assert!(depth.data().iter().all(|&z| z == fixture::PLANE as f32));
}

#[test]
fn both_openmvs_habits_line_up_with_the_image() {
    for (version, shift) in [(6, 0.0), (7, -0.5)] {
        let folder = workspace();
        fixture::openmvs(&folder.path().join("openmvs"), version, shift);
        let sequence = with_depth(folder.path()).unwrap();
        let depth = sequence.frames[2].depth.as_ref().unwrap();
        assert_eq!(depth[(7, 3)], fixture::PLANE as f32 + 7e-3);
        assert_eq!(sequence.frames[2].camera.cx, fixture::CAMERA[2]);
    }
    let folder = workspace();
    fixture::openmvs(&folder.path().join("openmvs"), 7, 0.25);
    let message = with_depth(folder.path()).unwrap_err().to_string();
    assert!(
        message.contains("depth0000.dmap: K: principal point differs"),
        "{message}"
    );
}

#[test]
fn an_openmvs_project_alone_gives_the_same_cameras() {
    for (version, shift) in [(6, 0.0), (7, -0.5)] {
        let folder = tempfile::tempdir().unwrap();
        fixture::images_and_masks(folder.path());
        fixture::openmvs(folder.path(), version, shift);
        let sequence = plain(folder.path());
        assert_eq!(sequence.frames.len(), 3);
        let camera = sequence.frames[0].camera;
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], fixture::CAMERA);
    }
}

/// Features know poses less well than the solver does.
#[test]
fn poses_of_other_tools_are_held_loosely() {
    let colmap = workspace();
    let openmvs = tempfile::tempdir().unwrap();
    fixture::images_and_masks(openmvs.path());
    fixture::openmvs(openmvs.path(), 6, 0.0);
    for folder in [colmap.path(), openmvs.path()] {
        let sequence = plain(folder);
        assert_eq!(sequence.motion_deviation, Some(0.02), "{}", folder.display());
        assert_eq!(sequence.focal_deviation, None);
    }
}

#[test]
fn a_reduced_depth_map_is_enlarged() {
    let folder = workspace();
    let openmvs = folder.path().join("openmvs");
    fixture::openmvs(&openmvs, 6, 0.0);
    let mut map = fixture::dmap(0, "images/a.png", fixture::CAMERA);
    map.depth_size = (16, 12);
    map.z = (0..16 * 12).map(|i| 1.0 + i as f32).collect();
    fixture::write(&openmvs.join("depth0000.dmap"), &map.encode());
    let depth = with_depth(folder.path())
        .unwrap()
        .into_content()
        .frames
        .remove(0)
        .depth
        .unwrap();
    assert_eq!(depth.size(), (32, 24));
    assert_eq!(
        (depth[(0, 0)], depth[(1, 1)], depth[(2, 0)], depth[(31, 23)]),
        (1.0, 1.0, 2.0, 192.0)
    );
}

#[cfg(feature = "vision")]
#[test]
fn a_distorted_camera_becomes_a_pinhole() {
    let folder = workspace();
    fixture::sparse_text(folder.path(), "SIMPLE_RADIAL", &[40.0, 16.0, 12.0, 2.0]);
    let bent = plain(folder.path());
    assert_eq!((bent.frames[0].camera.fx, bent.frames[0].camera.cx), (40.0, 16.0));
    // Pincushion: the straight image shows, away from the centre, what lay farther out, so the object shrinks.
    let mask = crate::image::read_mask(&folder.path().join("masks/a.png.png")).unwrap();
    assert!(bent.frames[0].mask.share() < mask.share());
    assert!(bent.frames[0].mask[(16, 12)]);
}

#[cfg(not(feature = "vision"))]
#[test]
fn a_distorted_camera_needs_the_feature() {
    let folder = workspace();
    fixture::sparse_text(folder.path(), "SIMPLE_RADIAL", &[40.0, 16.0, 12.0, 2.0]);
    let message = load(folder.path(), &LoadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("cameras.txt: camera model:") && message.contains("feature `vision`"),
        "{message}"
    );
}

#[test]
fn an_imported_workspace_reads_back_the_same() {
    let folder = workspace();
    fixture::openmvs(&folder.path().join("openmvs"), 6, 0.0);
    let sequence = with_depth(folder.path()).unwrap();
    let target = folder.path().join("imported");
    write(&sequence, &target).unwrap();
    let back = plain(&target);
    assert_eq!(format!("{:?}", back.frames), format!("{:?}", sequence.frames));
}

/// Median and quartiles of dense z over the z of COLMAP's points, inside the mask, on real data.
#[test]
fn openmvs_depth_agrees_with_colmap_points_on_a_real_car() {
    let input = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/natural/epfl_04"));
    if !input.is_dir() {
        println!("skipped: {} is missing", input.display());
        return;
    }
    let sparse = plain(&input);
    let dense = load(
        &input,
        &LoadOptions {
            depth: Some(input.join("openmvs")),
            ..LoadOptions::default()
        },
    )
    .unwrap();
    assert_eq!(dense.frames.len(), 16);
    let mut ratios = Vec::new();
    for (points, map) in sparse.frames.iter().zip(&dense.frames) {
        let (points_z, map_z) = (points.depth.as_ref().unwrap(), map.depth.as_ref().unwrap());
        let pixels = points_z.data().iter().zip(map_z.data()).zip(map.mask.data());
        ratios.extend(
            pixels
                .filter(|((p, m), inside)| **p > 0.0 && **m > 0.0 && **inside)
                .map(|((p, m), _)| m / p),
        );
    }
    ratios.sort_by(f32::total_cmp);
    let quantile = |share: f64| ratios[(share * ratios.len() as f64) as usize];
    println!(
        "{} pixels, dense / sparse z: {:.4} [{:.4}, {:.4}]",
        ratios.len(),
        quantile(0.5),
        quantile(0.25),
        quantile(0.75)
    );
    assert!(ratios.len() > 1000);
    assert!((quantile(0.5) - 1.0).abs() < 0.005);
    assert!(quantile(0.75) - quantile(0.25) < 0.02);
}
