use super::super::load_source;
use super::super::scene::{Lighting, Scene, Via, film};
use super::super::synthetic::cuboid;
use super::super::{Material, Texture};
use super::*;
use crate::sequence::Sequence;
use nalgebra::Vector3;
use std::sync::Arc;

/// How far Blender's sequence is from ours.
#[derive(Debug)]
struct Difference {
    /// Least of the frames.
    mask_iou: f64,
    /// |z' − z| / z where both masks are, over all frames: median and 99 % quantile.
    depth: [f64; 2],
    /// Difference of the pictures likewise, grey levels: median and 90 % quantile.
    colour: [f64; 2],
}

fn installed() -> bool {
    let found = Command::new(PROGRAM).arg("--version").output().is_ok();
    if !found {
        eprintln!("skipped: blender is not installed");
    }
    found
}

/// Two frames without noise, a long way apart, with the principal point off the middle of an oblong picture.
fn scene(width: usize, height: usize) -> Scene {
    let text = format!(
        "seed = 5\nimage_noise = 0.0\ntruth_points = 100\n\
         model = {{ kind = 'torcs', path = 'unused' }}\n\
         camera = {{ width_px = {width}, height_px = {height}, focal_px = {focal}, principal_px = [{cx}, {cy}] }}\n\
         arc = {{ frames = 2, azimuth_deg = [35, -140], elevation_deg = 18, distance = 1.7, \
         jitter = {{ angle_deg = 3, aim = 0.02 }} }}\n",
        focal = 1.15 * width as f64,
        cx = 0.53 * width as f64,
        cy = 0.46 * height as f64,
    );
    toml::from_str(&text).unwrap()
}

fn compare(mut scene: Scene, mesh: &Mesh) -> Difference {
    let ours = film(&scene, mesh, "ours").unwrap();
    scene.via = Via::Blender;
    let theirs = film(&scene, mesh, "theirs").unwrap();
    let depth = |sequence: &Sequence| sequence.truth.as_ref().unwrap().depth.clone();
    let (mut mask_iou, mut errors, mut greys) = (1.0f64, Vec::new(), Vec::new());
    for (l, (our, their)) in ours.frames.iter().zip(&theirs.frames).enumerate() {
        let (our_z, their_z) = (&depth(&ours)[l], &depth(&theirs)[l]);
        let (mut both, mut either) = (0, 0);
        for (i, (&a, &b)) in our.mask.data().iter().zip(their.mask.data()).enumerate() {
            both += usize::from(a && b);
            either += usize::from(a || b);
            if a && b {
                let (a, b) = (f64::from(our_z.data()[i]), f64::from(their_z.data()[i]));
                errors.push((b - a).abs() / a);
                let (a, b) = (our.image.data()[i], their.image.data()[i]);
                greys.extend((0..3).map(|c| f64::from((a[c] - b[c]).abs())));
            }
        }
        mask_iou = mask_iou.min(both as f64 / either as f64);
    }
    Difference {
        mask_iou,
        depth: [quantile(&mut errors, 0.5), quantile(&mut errors, 0.99)],
        colour: [quantile(&mut greys, 0.5), quantile(&mut greys, 0.9)],
    }
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(share * (values.len() - 1) as f64) as usize]
}

/// A body with one texture, and above it a board whose texture has a hole; a part without a material.
fn painted() -> Mesh {
    let textured = |mut mesh: Mesh, texture: Texture| {
        for triangle in &mut mesh.triangles {
            for (uv, vertex) in triangle.texture_coordinates.iter_mut().zip(triangle.vertices) {
                let at = mesh.vertices[vertex as usize];
                *uv = [(3.0 * at.z) as f32, (3.0 * at.x + at.y) as f32];
            }
        }
        mesh.materials.push(Material {
            diffuse: [1.0, 0.9, 0.8],
            opacity: 1.0,
            texture: Some(Arc::new(texture)),
        });
        mesh
    };
    let gradient = Texture {
        image: Grid::from_fn(32, 16, |c, r| [8.0 * c as f32, 16.0 * r as f32, 90.0]),
        alpha: None,
    };
    let perforated = Texture {
        image: Grid::filled(8, 8, [30.0, 60.0, 220.0]),
        alpha: Some((0..64).map(|i| if i % 8 < 4 { 0.0 } else { 1.0 }).collect()),
    };
    let mut mesh = textured(cuboid(Vector3::zeros(), Vector3::new(0.36, 0.2, 0.85)), gradient);
    mesh.append(textured(
        cuboid(Vector3::new(0.05, 0.2, 0.1), Vector3::new(0.4, 0.02, 0.5)),
        perforated,
    ));
    let mut bare = cuboid(Vector3::new(0.0, 0.0, -0.45), Vector3::new(0.1, 0.1, 0.05));
    for triangle in &mut bare.triangles {
        triangle.material = 7;
    }
    mesh.append(bare);
    mesh
}

#[test]
fn blender_and_our_rasteriser_agree() {
    if !installed() {
        return;
    }
    let mut scene = scene(320, 240);
    scene.light = Lighting {
        turn_deg: [0.0, 70.0],
        brightness: [1.0, 0.6],
        ..Lighting::default()
    };
    let difference = compare(scene, &painted());
    assert!(difference.mask_iou > 0.99, "{difference:?}");
    assert!(
        difference.depth[0] < 1e-5 && difference.depth[1] < 1e-4,
        "{difference:?}"
    );
    assert!(
        difference.colour[0] <= 1.0 && difference.colour[1] <= 2.0,
        "{difference:?}"
    );
}

#[test]
fn blender_and_our_rasteriser_agree_on_a_car() {
    let text = include_str!("../../../data/sequences/car.toml");
    let model = toml::from_str::<Scene>(text).unwrap().model;
    if !model.path.exists() {
        eprintln!("skipped: {} is not there", model.path.display());
        return;
    }
    if !installed() {
        return;
    }
    let car = &load_source(&model).unwrap()[0].mesh;
    let difference = compare(scene(512, 512), car);
    assert!(difference.mask_iou >= 0.99, "{difference:?}");
    assert!(
        difference.depth[0] < 1e-4 && difference.depth[1] < 1e-3,
        "{difference:?}"
    );
    // Its roof's lining lies in the roof itself, where ours shows now one, now the other.
    assert!(
        difference.colour[0] <= 1.0 && difference.colour[1] <= 10.0,
        "{difference:?}"
    );
    println!("{difference:?}");
}

#[test]
fn a_missing_or_failing_blender_is_one_clear_line() {
    let folder = tempfile::tempdir().unwrap();
    let message = run("no-such-blender", folder.path()).unwrap_err().to_string();
    assert_eq!(message, "blender: not installed; apt-get install blender");
    if installed() {
        // No scene.json.
        let message = run(PROGRAM, folder.path()).unwrap_err().to_string();
        assert!(
            message.contains("scene.json") && !message.contains('\n'),
            "{message}"
        );
    }
}
