use super::super::mesh::body_box;
use super::super::render::LightFrame;
use super::super::{Material, Triangle};
use super::*;
use crate::geometry::{Similarity, Vector2};

/// A box of the proportions of a car, with faces of different colours.
fn cuboid(half: [f64; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let base = mesh.vertices.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut corner = Vector3::zeros();
                corner[axis] = side * half[axis];
                corner[(axis + 1) % 3] = a * half[(axis + 1) % 3];
                corner[(axis + 2) % 3] = b * half[(axis + 2) % 3];
                mesh.vertices.push(corner);
            }
            let material = mesh.materials.len() as u32;
            mesh.materials.push(Material {
                diffuse: [0.2 + 0.3 * axis as f32, 0.5 + 0.4 * side as f32, 0.3],
                opacity: 1.0,
                texture: None,
            });
            for vertices in [[0, 1, 2], [0, 2, 3]] {
                mesh.triangles.push(Triangle {
                    vertices: vertices.map(|i| base + i),
                    texture_coordinates: [[0.0; 2]; 3],
                    material,
                });
            }
        }
    }
    mesh
}

const HALF: [f64; 3] = [0.18, 0.13, 0.44];

fn scene(extra: &str) -> Scene {
    toml::from_str(&format!(
        "seed = 7\nsamples_per_axis = 1\ntruth_points = 2000\n{extra}\n[model]\nkind = 'torcs'\npath = 'unused'\n[arc]\nframes = 3\n\
         azimuth_deg = [20, 50]\nelevation_deg = 15\ndistance = 1.7\njitter = {{ angle_deg = 1, distance = 0.02, aim = 0.01 }}\n"
    ))
    .unwrap()
}

#[test]
fn without_noise_the_input_is_the_truth_in_another_frame() {
    let mut scene = scene("");
    scene.input.rotation_noise_deg = 0.0;
    scene.input.translation_noise = 0.0;
    scene.depth = SimulatedDepth {
        min_gradient: 0.0,
        holes: 0.0,
        noise: 0.0,
        outliers: 0.0,
        background: 0.0,
    };
    let sequence = film(&scene, &cuboid(HALF), "box").unwrap();
    let truth = sequence.truth.as_ref().unwrap();
    let input_from_object = Similarity {
        scale: 2.7,
        rotation: Rotation3::from_scaled_axis(Vector3::new(20.0, -70.0, 35.0).map(f64::to_radians)),
        translation: Vector3::new(0.8, -1.7, 2.3),
    };
    for (l, frame) in sequence.frames.iter().enumerate() {
        let camera_from_input = frame.camera_from_input.unwrap();
        for point in &truth.shape[..50] {
            let point = Vector3::from(point.map(f64::from));
            let direct = truth.camera_from_object[l].transform(&point);
            let around = camera_from_input.transform(&input_from_object.transform(&point));
            // x_cam = α x'_cam with α = 1 / 2.7.
            assert!((direct - around / 2.7).norm() < 1e-12);
        }
        let depth = frame.depth.as_ref().unwrap();
        for (given, true_z) in depth.data().iter().zip(truth.depth[l].data()) {
            // The border has no gradient; the box does not reach it.
            assert!((given - 2.7 * true_z).abs() < 1e-5);
        }
    }
}

#[test]
fn true_depth_and_pose_put_every_pixel_on_the_box() {
    let scene = scene("");
    let sequence = film(&scene, &cuboid(HALF), "box").unwrap();
    let truth = sequence.truth.clone().unwrap();
    for (l, frame) in sequence.frames.iter().enumerate() {
        let (mut seen, map) = (0, &truth.depth[l]);
        for (i, &z) in map.data().iter().enumerate() {
            assert_eq!(z > 0.0, frame.mask.data()[i]);
            if z > 0.0 {
                let pixel = Vector2::new((i % 320) as f64 + 0.5, (i / 320) as f64 + 0.5);
                let point = truth.camera_from_object[l]
                    .inverse()
                    .transform(&frame.camera.unproject(&pixel, f64::from(z)));
                let excess = (0..3).map(|a| point[a].abs() - HALF[a]).fold(f64::MIN, f64::max);
                assert!(excess.abs() < 1e-6, "{point}");
                seen += 1;
            }
        }
        assert!(seen > 10_000);
    }
}

#[test]
fn depth_noise_is_as_asked() {
    let mut scene = scene("");
    scene.depth.min_gradient = 0.0;
    let sequence = film(&scene, &cuboid(HALF), "box").unwrap();
    let truth = sequence.truth.clone().unwrap();
    let (mut object, mut given, mut wrong, mut off, mut squares) = (0, 0, 0, 0, 0.0);
    for (l, frame) in sequence.frames.iter().enumerate() {
        for (&z, &true_z) in frame
            .depth
            .as_ref()
            .unwrap()
            .data()
            .iter()
            .zip(truth.depth[l].data())
        {
            if true_z == 0.0 {
                off += usize::from(z > 0.0);
                continue;
            }
            object += 1;
            if z > 0.0 {
                given += 1;
                let error = f64::from(z / (2.7 * true_z)) - 1.0;
                if error.abs() > 0.03 {
                    wrong += 1;
                } else {
                    squares += error * error;
                }
            }
        }
    }
    let share = |a: usize, b: usize| a as f64 / b as f64;
    assert!(
        share(given, object) > 0.55 && share(given, object) < 0.95,
        "{}",
        share(given, object)
    );
    assert!(
        (share(wrong, given) - 0.045).abs() < 0.02,
        "{}",
        share(wrong, given)
    );
    let deviation = (squares / (given - wrong) as f64).sqrt();
    assert!((deviation - 0.005).abs() < 0.002, "{deviation}");
    assert!(off > 1000);
}

#[test]
fn outside_points_lie_on_the_outside_only() {
    let mut mesh = cuboid(HALF);
    mesh.append(cuboid([0.1, 0.05, 0.2]));
    let points = outside_points(&mesh, 3000);
    assert!(points.len() > 2000 && points.len() <= 3000, "{}", points.len());
    let mut faces = [0; 6];
    for point in points {
        let excess: [f64; 3] = std::array::from_fn(|a| f64::from(point[a].abs()) - HALF[a]);
        let axis = (0..3).max_by(|&a, &b| excess[a].total_cmp(&excess[b])).unwrap();
        assert!(excess[axis].abs() < 1e-4, "{point:?}");
        faces[2 * axis + usize::from(point[axis] > 0.0)] += 1;
    }
    assert!(faces.iter().all(|&count| count > 100), "{faces:?}");
}

#[test]
fn same_seed_same_bytes_and_other_seed_other_noise() {
    let first = film(&scene(""), &cuboid(HALF), "box").unwrap();
    let again = film(&scene(""), &cuboid(HALF), "box").unwrap();
    let mut reseeded = scene("");
    reseeded.seed = 8;
    let other = film(&reseeded, &cuboid(HALF), "box").unwrap();
    for l in 0..3 {
        assert_eq!(first.frames[l].image, again.frames[l].image);
        assert_eq!(first.frames[l].depth, again.frames[l].depth);
        assert_eq!(
            first.frames[l].camera_from_input,
            again.frames[l].camera_from_input
        );
        assert_ne!(first.frames[l].image, other.frames[l].image);
    }
    assert_eq!(
        first.truth.as_ref().unwrap().shape,
        again.truth.as_ref().unwrap().shape
    );
}

/// The frames of the box before black, without noise or jitter.
fn plainly(extra: &str) -> Vec<Frame> {
    let mut scene = scene(extra);
    scene.arc.jitter = Jitter::default();
    scene.image_noise = 0.0;
    scene.background.contrast = 0.0;
    scene.background.colour = [0.0; 3];
    film(&scene, &cuboid(HALF), "box").unwrap().into_content().frames
}

#[test]
fn the_light_turns_and_dims_from_the_first_frame_to_the_last() {
    let ahead = "light = { direction = [0, 0, -1], ambient = 0, diffuse = 1, FIELD }";
    // The red of the middle of the front face.
    let front = |field: &str| -> Vec<f32> {
        let frames = plainly(&ahead.replace("FIELD", field));
        let red = |(l, frame): (usize, &Frame)| {
            let middle = Vector3::new(0.0, 0.0, -HALF[2]);
            let in_camera = orbit(20.0 + 15.0 * l as f64, 15.0, 1.7).transform(&middle);
            let pixel = frame.camera.project(&in_camera).unwrap();
            frame.image[frame.image.pixel_at(pixel.x, pixel.y).unwrap()][0]
        };
        frames.iter().enumerate().map(red).collect()
    };
    let steady = front("turn_deg = [0, 0]");
    assert!(
        steady[0] > 100.0 && steady[0] == steady[1] && steady[0] == steady[2],
        "{steady:?}"
    );
    let dimming = front("brightness = [1.0, 0.5]");
    let turning = front("turn_deg = [0, 60]");
    for (l, share) in [1.0f32, 0.75, 0.5].into_iter().enumerate() {
        assert!((dimming[l] - share * steady[0]).abs() < 1.0, "{dimming:?}");
        let cosine = (30.0 * l as f32).to_radians().cos();
        assert!((turning[l] - cosine * steady[0]).abs() < 1.0, "{turning:?}");
    }
}

#[test]
fn a_turned_light_shines_from_a_greater_azimuth_whatever_it_is_fixed_to() {
    let ahead = |fixed_to, direction| Lighting {
        fixed_to,
        direction,
        turn_deg: [0.0, 90.0],
        ..Lighting::default()
    };
    // From ahead of the object to its right side; from behind a camera before it to the camera's left: the same place.
    let camera_from_object = orbit(0.0, 0.0, 2.0).rotation;
    let of_object = ahead(LightFrame::Object, [0.0, 0.0, -1.0]).at(1.0).direction;
    let of_camera = ahead(LightFrame::Camera, [0.0, 0.0, -1.0]).at(1.0).direction;
    assert!((Vector3::from(of_object) - Vector3::x()).norm() < 1e-12);
    assert!((camera_from_object * Vector3::from(of_object) - Vector3::from(of_camera)).norm() < 1e-12);
}

#[test]
fn blur_softens_edges_and_leaves_truth_alone() {
    let (sharp, soft) = (plainly(""), plainly("blur_px = 2.0"));
    let steepest = |frame: &Frame| {
        (1..320)
            .map(|column| frame.image[(column, 120)][0] - frame.image[(column - 1, 120)][0])
            .fold(f32::MIN, f32::max)
    };
    // An edge blurred with deviation σ rises by at most its height / (σ √(2π)) a pixel.
    let (before, after) = (steepest(&sharp[0]), steepest(&soft[0]));
    assert!((after / before - 0.2).abs() < 0.05, "{before} {after}");
    assert_eq!(sharp[0].mask, soft[0].mask);
}

#[test]
fn a_photograph_stands_behind_the_object_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("wall.png");
    crate::image::write_rgb(&Grid::filled(50, 40, [10.0, 200.0, 30.0]), &file).unwrap();
    let image = format!("background.image = '{}'", file.display());
    let (plain, photograph) = (&plainly("")[1], &plainly(&image)[1]);
    let mut seen = 0;
    for (i, &colour) in photograph.image.data().iter().enumerate() {
        if plain.image.data()[i] == [0.0; 3] {
            assert_eq!(colour, [10.0, 200.0, 30.0]);
        } else if plain.mask.data()[i] {
            seen += usize::from(colour == plain.image.data()[i]);
        }
    }
    assert!(seen > 10_000, "{seen}");

    let missing = folder.path().join("none.png");
    let scene = scene(&format!("background.image = '{}'", missing.display()));
    let message = film(&scene, &cuboid(HALF), "box").unwrap_err().to_string();
    let expected = format!("background.image: {}: file is missing", missing.display());
    assert!(
        message.starts_with(&expected) && !message.contains('\n'),
        "{message}"
    );
}

#[test]
fn options_out_of_range_are_named() {
    let mut bad = scene("");
    bad.camera.focal_px = f64::NAN;
    let message = synthesise(&bad, "box").unwrap_err().to_string();
    assert_eq!(message, "camera.focal_px: give more than 0");
    for (extra, expected) in [
        ("blur_px = -1.0", "blur_px: give 0 to 20"),
        (
            "light.turn_deg = [0.0, inf]",
            "light.turn_deg: give two finite angles",
        ),
        (
            "light.brightness = [1.0, -0.1]",
            "light.brightness: give two factors of 0 or more",
        ),
    ] {
        let message = synthesise(&scene(extra), "box").unwrap_err().to_string();
        assert_eq!(message, expected);
    }
    let unknown = toml::from_str::<Scene>("seed = 1\nsead = 2\n")
        .unwrap_err()
        .to_string();
    assert!(unknown.contains("sead"), "{unknown}");
}

#[test]
fn the_bundled_sequence_is_whole() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/data/sequences/car");
    let sequence = crate::sequence::load(folder.as_ref(), &Default::default()).unwrap();
    let truth = sequence.truth.clone().unwrap();
    assert_eq!((sequence.frames.len(), truth.camera_from_object.len()), (10, 10));
    let shape: Vec<_> = truth
        .shape
        .iter()
        .map(|p| Vector3::from(p.map(f64::from)))
        .collect();
    let (low, high) = body_box(&shape).unwrap();
    assert!(
        ((high - low).norm() - 1.0).abs() < 0.01 && (low + high).norm() < 0.01,
        "{low} {high}"
    );
    for (frame, pose) in sequence.frames.iter().zip(&truth.camera_from_object) {
        // The shape projects into the mask, but for what thinning and the pixel grid leave.
        let inside = truth.shape.iter().filter(|point| {
            let point = Vector3::from(point.map(f64::from));
            let pixel = frame.camera.project(&pose.transform(&point)).unwrap();
            let cell = frame.mask.pixel_at(pixel.x, pixel.y);
            cell.is_some_and(|cell| frame.mask[cell])
        });
        assert!(inside.count() as f64 > 0.98 * truth.shape.len() as f64);
        assert!(frame.depth.is_some() && frame.camera_from_input.is_some());
    }
}
