use super::*;
use crate::image::read_depth;
use crate::report::fixture::{box_car, solved};
use crate::report::read_shape;
use crate::sequence::SequenceContent;

fn input<'a>(sequence: &'a Sequence, solution: &'a Solution, surface: &'a Surface) -> ReportInput<'a> {
    ReportInput {
        sequence,
        solution,
        surface,
        input: "data/box",
        length_m: Some(4.2),
        prior: "box 1",
        masks_anew: &[],
        config: "[solver]\n",
        focal_deviation: 0.0,
        peak_memory_mb: Some(12.5),
    }
}

fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn the_folder_is_complete_and_reads_back() {
    let surface = Surface::from_points(box_car(3000));
    let (sequence, solution) = solved(&surface, 3);
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let written = write(&input(&sequence, &solution, &surface), &out).unwrap();
    let expected = [
        "cameras.txt",
        "colmap",
        "config.toml",
        "depth",
        "overlay",
        "overlay.png",
        "report.html",
        "result.json",
        "shape.ply",
        "shape_input.ply",
        "trace.csv",
    ];
    assert_eq!(listing(&out), expected);
    assert_eq!(
        listing(&out.join("depth")),
        ["frame_000.exr", "frame_001.exr", "frame_002.exr"]
    );
    assert_eq!(listing(home.path()), ["out"], "nothing beside the result");
    let read = RunResult::load(&out).unwrap();
    for (l, frame) in read.frames.iter().enumerate() {
        let (pose, truth) = (
            frame.camera_from_object().unwrap(),
            solution.estimate.camera_from_object[l],
        );
        assert!((pose.to_twist() - truth.to_twist()).norm() < 1e-12);
    }
    assert_eq!(
        (read.alpha, read.hypotheses),
        (Some(0.4), written.result.hypotheses)
    );
    // The sequence was rendered from the very shape and poses that the solution has.
    assert_eq!(
        (written.result.silhouette_iou_mean, written.result.density_mean),
        (1.0, 1.0)
    );
    assert_eq!(written.result.seconds["solve"], 2.0);
    let truth = sequence.truth.as_ref().unwrap();
    assert_eq!(
        read_depth(&out.join("depth/frame_001.exr")).unwrap(),
        truth.depth[1]
    );
    let shape = read_shape(&out.join("shape.ply")).unwrap();
    assert_eq!(shape.len(), 3000);
    // Both frames are offered, and object_from_input joins them.
    let join = solution.estimate.object_from_input(&sequence).unwrap();
    for (object, input) in shape
        .iter()
        .zip(read_shape(&out.join("shape_input.ply")).unwrap())
    {
        assert!((join.transform(&input) - object).norm() < 1e-6);
    }
    let error = write(&input(&sequence, &solution, &surface), &out).unwrap_err();
    assert!(error.to_string().contains("exists already"), "{error}");
}

#[test]
fn result_json_has_exactly_the_documented_keys() {
    let surface = Surface::from_points(box_car(800));
    let (sequence, solution) = solved(&surface, 2);
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    write(&input(&sequence, &solution, &surface), &out).unwrap();
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("result.json")).unwrap()).unwrap();
    let keys = |value: &serde_json::Value| -> Vec<String> {
        let mut keys: Vec<_> = value.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys
    };
    let top = "alpha canonical_from_shape density_mean evaluations focal_factor frames free_form hypotheses input iterations masks_anew metres_per_unit object_from_input objective \
               peak_memory_mb prior schema seconds shape_deviation_median silhouette_iou_mean style termination version";
    assert_eq!(keys(&json).join(" "), top);
    let frame = "center density deviation name rotation silhouette_iou translation";
    assert_eq!(keys(&json["frames"][0]).join(" "), frame);
    assert_eq!(
        keys(&json["object_from_input"]).join(" "),
        "rotation scale translation"
    );
    assert_eq!(keys(&json["objective"]).join(" "), "end start");
    let terms = "focal inverse_depth motion photometric silhouette style total";
    assert_eq!(keys(&json["objective"]["end"]).join(" "), terms);
    assert_eq!(keys(&json["evaluations"]).join(" "), "jacobian residual");
    assert_eq!(json["termination"], "converged");
    let along = surface.points().iter().map(|point| point.z);
    let length = along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min);
    let metres = json["metres_per_unit"].as_f64().unwrap();
    assert!((metres * length - 4.2).abs() < 1e-12);
}

#[test]
fn object_from_input_obeys_eq_10() {
    let surface = Surface::from_points(box_car(300));
    let (sequence, solution) = solved(&surface, 3);
    let join = solution.estimate.object_from_input(&sequence).unwrap();
    assert!((join.scale - 0.4).abs() < 1e-12);
    for (l, frame) in sequence.frames.iter().enumerate() {
        let x_input = crate::geometry::Vector3::new(0.3, -0.7, 1.1);
        let direct = solution.estimate.camera_from_object[l].transform(&join.transform(&x_input));
        let through_input = solution.estimate.alpha * frame.camera_from_input.unwrap().transform(&x_input);
        assert!((direct - through_input).norm() < 1e-9);
    }
}

#[test]
fn what_is_not_finite_leaves_nothing_behind() {
    let surface = Surface::from_points(box_car(300));
    let (sequence, solution) = solved(&surface, 2);
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let refused = |sequence: &Sequence, change: fn(&mut Solution), field: &str| {
        let mut changed = solution.clone();
        change(&mut changed);
        let error = write(&input(sequence, &changed, &surface), &out)
            .unwrap_err()
            .to_string();
        assert!(error.contains(field), "{error}");
        assert!(listing(home.path()).is_empty());
    };
    refused(&sequence, |s| s.estimate.style[0] = f64::NAN, "style");
    refused(&sequence, |s| s.estimate.alpha = 0.0, "alpha");
    refused(&sequence, |s| s.estimate.alpha = 1e177, "alpha is 1e177");
    refused(
        &sequence,
        |s| s.estimate.camera_from_object[1].translation.z = 1e30,
        "the camera of frame frame_001.png is 1e30 diagonals away",
    );
    refused(
        &sequence,
        |s| s.estimate.camera_from_object[0].translation.x = f64::INFINITY,
        "frame_000",
    );
    refused(
        &sequence,
        |s| s.hypotheses[0].objective_end = f64::NAN,
        "hypotheses[0]",
    );
    let without_last = |content: &mut SequenceContent| {
        content.frames.pop();
        content.truth = None;
    };
    refused(
        &sequence.clone().edited(without_last).unwrap(),
        |_| (),
        "2 camera poses for 1 frames",
    );
}

#[test]
fn two_writes_are_equal_byte_for_byte() {
    let surface = Surface::from_points(box_car(1000));
    let (sequence, solution) = solved(&surface, 2);
    let home = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| home.path().join(name));
    for out in [&a, &b] {
        write(&input(&sequence, &solution, &surface), out).unwrap();
    }
    for file in [
        "shape.ply",
        "result.json",
        "depth/frame_001.exr",
        "overlay.png",
        "report.html",
        "colmap/points3D.txt",
    ] {
        assert_eq!(
            std::fs::read(a.join(file)).unwrap(),
            std::fs::read(b.join(file)).unwrap(),
            "{file}"
        );
    }
}
