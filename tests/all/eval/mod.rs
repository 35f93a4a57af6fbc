//! `spba-ceres eval` as a user runs it.

use crate::fixture;
use assert_cmd::Command;
use serde_json::Value;
use spba_ceres::geometry::{Pose, Rotation3, Vector3};
use spba_ceres::image::Grid;
use spba_ceres::init::Estimate;
use spba_ceres::sequence::Truth;
use std::path::Path;

mod platform;
mod rendered;

use rendered::{rendered, write_result, write_result_of};

fn eval(arguments: &[&Path]) -> Command {
    let mut command = Command::cargo_bin("spba-ceres").unwrap();
    command.arg("eval").args(arguments);
    command
}

fn json(command: &mut Command) -> Value {
    let output = command
        .arg("--json")
        .assert()
        .success()
        .get_output()
        .stdout
        .clone();
    serde_json::from_slice(&output).unwrap()
}

#[test]
fn a_result_and_its_input_against_truth() {
    let home = tempfile::tempdir().unwrap();
    let (truth, result) = (home.path().join("truth"), home.path().join("result"));
    let (surface, sequence, mut estimate) = rendered();
    spba_ceres::sequence::write(&sequence, &truth).unwrap();
    // Every camera 2° off about its own optical axis: the centres and depths stay.
    let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), 2f64.to_radians());
    for pose in &mut estimate.camera_from_object {
        pose.rotation = roll * pose.rotation;
    }
    write_result_of((&truth, ""), &surface, &sequence, estimate, &result);

    let errors = json(&mut eval(&[&result, Path::new("--truth"), &truth]));
    let of = |column: &str, key: &str| errors[column][key].clone();
    assert!((of("result", "orientation_error_deg")["mean"].as_f64().unwrap() - 2.0).abs() < 1e-6);
    assert!(of("result", "location_error_percent")["max"].as_f64().unwrap() < 1e-6);
    assert!(of("result", "depth_error").as_f64().unwrap() < 0.005);
    assert!(of("result", "depth_error_at_best_scale").as_f64() <= of("result", "depth_error").as_f64());
    assert!((of("result", "best_depth_scale").as_f64().unwrap() - 1.0).abs() < 0.005);
    assert!(of("result", "silhouette_iou_mean").as_f64().unwrap() > 0.95);
    assert!(of("result", "chamfer_percent").as_f64().unwrap() < 1e-3);
    assert!(of("input", "orientation_error_deg")["max"].as_f64().unwrap() < 1e-6);
    assert!(of("input", "location_error_percent")["max"].as_f64().unwrap() < 1e-6);
    // The same of the input alone, and as a table.
    let alone = json(&mut eval(&[&truth, Path::new("--truth"), &truth]));
    assert_eq!(
        alone["input"]["orientation_error_deg"],
        errors["input"]["orientation_error_deg"]
    );
    let table = eval(&[&result, Path::new("--truth"), &truth]).assert().success();
    let table = String::from_utf8(table.get_output().stdout.clone()).unwrap();
    assert!(
        table.contains("camera orientation error") && table.contains("2.000 / 2.000"),
        "{table}"
    );
}

/// Standard output as JSON, and standard error.
fn json_and_notes(command: &mut Command) -> (Value, String) {
    let output = command.arg("--json").assert().success().get_output().clone();
    (
        serde_json::from_slice(&output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn the_input_beside_a_result_is_what_it_was_solved_from() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name);
    let (surface, sequence, estimate) = rendered();
    // The truth's own input is exact. In the other one every camera but the first is 1° off about its optical axis.
    spba_ceres::sequence::write(&sequence, &path("truth")).unwrap();
    let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), 1f64.to_radians());
    let other = sequence.clone().edited(|content| {
        content.truth = None;
        for pose in content.frames[1..]
            .iter_mut()
            .filter_map(|f| f.camera_from_input.as_mut())
        {
            pose.rotation = roll * pose.rotation;
            pose.translation = roll * pose.translation;
        }
    });
    let other = other.unwrap();
    spba_ceres::sequence::write(&other, &path("other")).unwrap();
    write_result_of(
        (&path("other"), ""),
        &surface,
        &sequence,
        estimate.clone(),
        &path("result"),
    );
    let judged = |result: &str| eval(&[&path(result), Path::new("--truth"), &path("truth")]);
    let off = |errors: &Value| {
        let error = &errors["input"]["orientation_error_deg"];
        assert!((error["max"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{errors}");
        assert!((error["mean"].as_f64().unwrap() - 0.75).abs() < 1e-6, "{errors}");
    };
    off(&json(&mut judged("result")));
    // A name that is relative is so to the current folder.
    let relative = (Path::new("other"), "");
    write_result_of(relative, &surface, &sequence, estimate.clone(), &path("relative"));
    off(&json(judged("relative").current_dir(home.path())));

    // Gone: one line says so, and the truth's input does not stand in.
    std::fs::rename(path("other"), path("moved")).unwrap();
    let left_out = |result: &str, part: &str| {
        let (errors, notes) = json_and_notes(&mut judged(result));
        assert!(
            errors["input"].is_null() && errors["result"].is_object(),
            "{errors}"
        );
        assert!(
            notes.starts_with("note: no column `input`: ") && notes.contains(part),
            "{notes}"
        );
        assert!(
            notes.trim_end().ends_with("--input") && notes.lines().count() == 1,
            "{notes}"
        );
    };
    left_out("result", "/other, its input, is not there any more");
    off(&json(judged("result").arg("--input").arg(path("moved"))));

    // Made of a video or of pictures: the sequence folder lies beside the result.
    write_result_of(
        (Path::new("somewhere/clip.mp4"), ""),
        &surface,
        &sequence,
        estimate.clone(),
        &path("of-video"),
    );
    left_out("of-video", "somewhere/clip.mp4, its input, is not there any more");
    std::fs::rename(path("moved"), path("clip.mp4.sequence")).unwrap();
    off(&json(&mut judged("of-video")));
    off(&json(
        eval(&[Path::new("."), Path::new("--truth"), &path("truth")]).current_dir(path("of-video")),
    ));

    // Another input under that name.
    let other = other.edited(|content| {
        content.frames.pop();
    });
    let other = other.unwrap();
    spba_ceres::sequence::write(&other, &path("other")).unwrap();
    left_out("result", "/other has no frame 003.png of the result");
    let named = judged("result")
        .arg("--input")
        .arg(path("other"))
        .assert()
        .failure();
    let message = String::from_utf8(named.get_output().stderr.clone()).unwrap();
    assert!(
        message.contains("has no frame 003.png of the result"),
        "{message}"
    );

    // An input without poses has none to be judged by.
    let other = other.edited(|content| {
        content.frames.push(sequence.frames[3].clone());
        content
            .frames
            .iter_mut()
            .for_each(|frame| frame.camera_from_input = None);
    });
    let other = other.unwrap();
    spba_ceres::sequence::write(&other, &path("still")).unwrap();
    let (errors, notes) = json_and_notes(judged("result").arg("--input").arg(path("still")));
    assert!(errors["input"].is_null(), "{errors}");
    assert!(
        notes.contains("no off-the-shelf poses that could be aligned"),
        "{notes}"
    );
}

/// Every camera somewhere else: a solve with known errors.
fn shifted(mut estimate: Estimate) -> Estimate {
    for (l, pose) in estimate.camera_from_object.iter_mut().enumerate() {
        pose.translation += Vector3::new(0.01, -0.02, 0.03) * l as f64;
    }
    estimate
}

#[test]
fn a_colmap_model_is_judged_like_a_result() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name);
    let (surface, sequence, estimate) = rendered();
    spba_ceres::sequence::write(&sequence, &path("truth")).unwrap();
    write_result(&surface, &sequence, shifted(estimate), &path("result"));
    // A workspace around the model that `solve` wrote, its images under the same names.
    std::fs::create_dir_all(path("workspace/masks")).unwrap();
    std::fs::rename(path("result/colmap"), path("workspace/sparse")).unwrap();
    std::fs::create_dir_all(path("workspace/images")).unwrap();
    let files = |folder: &str| {
        let entries = std::fs::read_dir(path("truth").join(folder)).unwrap();
        let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    };
    for (frame, (image, mask)) in sequence
        .frames
        .iter()
        .zip(files("images").into_iter().zip(files("masks")))
    {
        std::fs::copy(image, path("workspace/images").join(&frame.name)).unwrap();
        let mask_name = format!("{}.png", frame.name);
        std::fs::copy(mask, path("workspace/masks").join(mask_name)).unwrap();
    }
    let workspace = json(&mut eval(&[
        &path("workspace"),
        Path::new("--truth"),
        &path("truth"),
    ]));
    let result = json(&mut eval(&[
        &path("result"),
        Path::new("--truth"),
        &path("truth"),
    ]));
    assert_eq!(workspace["input"]["frames"].as_array().unwrap().len(), 4);
    let location =
        |errors: &Value, column: &str| errors[column]["location_error_percent"]["mean"].as_f64().unwrap();
    // Imported with the truth, it is its own measure.
    let import = |truth: &str, out: &str| {
        let mut command = Command::cargo_bin("spba-ceres").unwrap();
        command.arg("import").arg(path("workspace"));
        command
            .args(["--truth".as_ref(), path(truth).as_os_str()])
            .args(["--out".as_ref(), path(out).as_os_str()]);
        command.assert()
    };
    import("truth", "imported").success();
    let imported = json(&mut eval(&[
        &path("imported"),
        Path::new("--truth"),
        &path("imported"),
    ]));
    let errors = |errors: &Value| {
        errors["input"]["location_error_percent"]["mean"]
            .as_f64()
            .unwrap()
    };
    assert!((errors(&imported) - errors(&workspace)).abs() < 1e-6);
    let without = import("workspace", "never").failure();
    let message = String::from_utf8(without.get_output().stderr.clone()).unwrap();
    assert!(
        message.contains("[truth] is missing; name a rendered sequence"),
        "{message}"
    );
    assert!(!path("never").exists());
    // Frame 0 is right and aligned exactly; the scale is fitted, so the rest can only come closer.
    assert!(location(&workspace, "input") <= location(&result, "result"));
    assert!(location(&workspace, "input") > 0.5 * location(&result, "result"));
}

#[test]
fn openmvs_depth_is_judged_with_its_colmap_workspace() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name);
    fixture::workspace(&path("workspace"));
    fixture::openmvs(&path("openmvs"), 5, 0.0);
    // The truth is half as large, and everywhere 0.01 further away than openMVS says.
    let sequence = spba_ceres::sequence::load(&path("workspace"), &Default::default()).unwrap();
    let truth = Truth {
        camera_from_object: (0..3)
            .map(|frame| Pose {
                translation: -0.5 * Vector3::from(fixture::center(frame)),
                ..Pose::identity()
            })
            .collect(),
        depth: (0..3)
            .map(|_| {
                Grid::from_fn(fixture::WIDTH, fixture::HEIGHT, |column, _| {
                    (0.5 * (fixture::PLANE + 1e-3 * column as f64) + 0.01) as f32
                })
            })
            .collect(),
        shape: vec![[0.0; 3]],
    };
    let sequence = sequence.edited(|content| content.truth = Some(truth)).unwrap();
    spba_ceres::sequence::write(&sequence, &path("truth")).unwrap();
    let mut command = eval(&[&path("workspace"), Path::new("--truth"), &path("truth")]);
    let errors = &json(command.arg("--depth").arg(path("openmvs")))["input"];
    assert!(errors["location_error_percent"]["max"].as_f64().unwrap() < 1e-6);
    assert!(
        (errors["depth_error"].as_f64().unwrap() - 0.01).abs() < 1e-5,
        "{errors}"
    );
    // Depths of 2 + 0.0005 column, 0.01 short: nearly all of it is scale.
    assert!(errors["depth_error_at_best_scale"].as_f64().unwrap() < 1e-4);
    assert!((errors["best_depth_scale"].as_f64().unwrap() - 1.005).abs() < 1e-4);
    assert!((errors["density_mean"].as_f64().unwrap() - 1.0).abs() < 1e-9);

    // A result that was solved from both finds both again.
    let poses = &sequence.truth.as_ref().unwrap().camera_from_object;
    let estimate = Estimate {
        camera_from_object: poses.clone(),
        style: vec![],
        alpha: 0.5,
        focal_factor: 1.0,
    };
    let (surface, ..) = rendered();
    let config = format!("[input]\ndepth = {:?}\n", path("openmvs"));
    write_result_of(
        (&path("workspace"), &config),
        &surface,
        &sequence,
        estimate,
        &path("result"),
    );
    let of_result = json(&mut eval(&[
        &path("result"),
        Path::new("--truth"),
        &path("truth"),
    ]));
    assert_eq!(&of_result["input"], errors);
}

#[test]
fn location_errors_are_those_of_evo() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name);
    let (surface, sequence, estimate) = rendered();
    spba_ceres::sequence::write(&sequence, &path("truth")).unwrap();
    write_result(&surface, &sequence, estimate.clone(), &path("perfect"));
    write_result(&surface, &sequence, shifted(estimate), &path("result"));
    let mut evo = std::process::Command::new("evo_ape");
    evo.arg("tum")
        .arg(path("perfect/cameras.txt"))
        .arg(path("result/cameras.txt"));
    let Ok(output) = evo.output() else {
        println!("skipped: evo_ape is not installed (pip install evo)");
        return;
    };
    let text = String::from_utf8(output.stdout).unwrap();
    let mean = text
        .lines()
        .find_map(|line| line.trim().strip_prefix("mean"))
        .unwrap();
    let mean: f64 = mean.trim().parse().unwrap();
    let errors = json(&mut eval(&[
        &path("result"),
        Path::new("--truth"),
        &path("truth"),
    ]));
    let ours = errors["result"]["location_error_percent"]["mean"]
        .as_f64()
        .unwrap()
        / 100.0;
    assert!(
        (mean - ours).abs() < 1e-6 && ours > 0.01,
        "evo {mean}, ours {ours}"
    );
}

#[test]
fn faults_are_one_line() {
    let home = tempfile::tempdir().unwrap();
    let fails = |arguments: &[&Path], part: &str| {
        let output = eval(arguments).assert().failure();
        let text = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        assert!(text.contains(part), "{text}");
        text
    };
    fails(&[home.path()], "--truth");
    let (surface, sequence, estimate) = rendered();
    let (truth, result) = (home.path().join("truth"), home.path().join("result"));
    spba_ceres::sequence::write(&sequence, &truth).unwrap();
    write_result(&surface, &sequence, estimate, &result);
    let (with_truth, with_depth) = (Path::new("--truth"), Path::new("--depth"));
    fails(
        &[&result, with_truth, &truth, with_depth, home.path()],
        "--depth: ",
    );
    let with_input = Path::new("--input");
    fails(
        &[&truth, with_truth, &truth, with_input, &truth],
        "is no result, so that it is measured itself; leave --input out",
    );
    std::fs::write(home.path().join("result.json"), "{\"schema\": 9}").unwrap();
    let text = fails(
        &[home.path(), Path::new("--truth"), home.path()],
        "schema must be 2, found 9",
    );
    assert_eq!(text.lines().count(), 1, "{text}");
}

#[test]
fn a_results_shape_against_masks() {
    let home = tempfile::tempdir().unwrap();
    let (masks, result) = (home.path().join("masks"), home.path().join("result"));
    let (surface, sequence, estimate) = rendered();
    write_result(&surface, &sequence, estimate, &result);
    std::fs::create_dir(&masks).unwrap();
    let write = |frame: usize, mask: &spba_ceres::image::Mask| {
        spba_ceres::image::write_mask(mask, &masks.join(format!("{frame:03}.png"))).unwrap();
    };
    for (l, frame) in sequence.frames.iter().enumerate() {
        // The last one lacks what is on the right.
        let lacking = Grid::from_fn(128, 96, |column, row| frame.mask[(column, row)] && column < 60);
        write(l, if l == 3 { &lacking } else { &frame.mask });
    }
    let rows = json(&mut eval(&[&result, Path::new("--masks"), &masks]));
    let of = |frame: usize, key: &str| rows[frame][key].as_f64().unwrap();
    assert_eq!(
        [of(0, "iou"), of(0, "outside_share"), of(0, "hole_share")],
        [1.0, 0.0, 0.0]
    );
    let right_of = |least: usize| -> f64 {
        let mask = &sequence.frames[3].mask;
        let count = |from: usize| {
            (0..96 * 128usize)
                .filter(|i| i % 128 >= from && mask.data()[*i])
                .count() as f64
        };
        count(least) / count(0)
    };
    assert!((of(3, "iou") - (1.0 - right_of(60))).abs() < 1e-12);
    // The last column inside is 59.
    let outside = of(3, "outside_share");
    assert!(
        (outside - right_of(63)).abs() < 0.01,
        "{outside} {}",
        right_of(63)
    );
    let table = eval(&[&result, Path::new("--masks"), &masks]).output().unwrap();
    let table = String::from_utf8(table.stdout).unwrap();
    assert!(
        table.contains("outside by > 3 px") && table.contains("mean"),
        "{table}"
    );

    write(2, &Grid::filled(10, 10, true));
    let refused = eval(&[&result, Path::new("--masks"), &masks]).assert().failure();
    let told = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(
        told.contains("002.png") && told.contains("give the masks"),
        "{told}"
    );
}
