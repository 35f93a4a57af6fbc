//! The bundled sequence in the files that the samples read.

use super::ROOT;
use nalgebra::{Quaternion, UnitQuaternion};
use spba_ceres::image::{Mask, RgbImage};
use spba_ceres::sequence::{self, LoadOptions, Sequence};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// The sequence with rotations as those of their quaternions, and these, so that files with either hold the same bits.
fn with_quaternions(sequence: Sequence) -> (Sequence, Vec<Quaternion<f64>>) {
    let frames = sequence.frames.iter();
    let rotations = frames.map(|frame| frame.camera_from_input.unwrap().rotation);
    let quaternions: Vec<_> = rotations
        .map(|rotation| UnitQuaternion::from_rotation_matrix(&rotation).into_inner())
        .collect();
    let turned = sequence.edited(|content| {
        for (frame, quaternion) in content.frames.iter_mut().zip(&quaternions) {
            let pose = frame.camera_from_input.as_mut().unwrap();
            pose.rotation = UnitQuaternion::new_normalize(*quaternion).to_rotation_matrix();
        }
    });
    (turned.unwrap(), quaternions)
}

/// The frames as `cpp/samples/frames.h` reads them.
fn write_frames(sequence: &Sequence, quaternions: &[Quaternion<f64>], folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let mut list = String::new();
    for (frame, q) in sequence.frames.iter().zip(quaternions) {
        let camera = &frame.camera;
        let t = frame.camera_from_input.unwrap().translation;
        let numbers = [
            camera.fx, camera.fy, camera.cx, camera.cy, q.w, q.i, q.j, q.k, t.x, t.y, t.z,
        ];
        write!(list, "{}", frame.name).unwrap();
        numbers.iter().for_each(|x| write!(list, " {x:?}").unwrap());
        list.push('\n');
        let file = |ending: &str| folder.join(format!("{}{ending}", frame.name));
        fs::write(file(".ppm"), ppm(&frame.image)).unwrap();
        fs::write(file("_mask.pgm"), pgm(&frame.mask)).unwrap();
        let depth = frame.depth.as_ref().unwrap();
        let mut pfm = format!("Pf {} {} -1\n", depth.width(), depth.height()).into_bytes();
        for row in depth.data().chunks_exact(depth.width()).rev() {
            pfm.extend(row.iter().flat_map(|z| z.to_le_bytes()));
        }
        fs::write(file("_depth.pfm"), pfm).unwrap();
    }
    fs::write(folder.join("frames.txt"), list).unwrap();
}

fn ppm(image: &RgbImage) -> Vec<u8> {
    let header = format!("P6 {} {} 255\n", image.width(), image.height());
    let colours = image.data().as_flattened().iter().map(|&x| x as u8);
    header.into_bytes().into_iter().chain(colours).collect()
}

fn pgm(mask: &Mask) -> Vec<u8> {
    let header = format!("P5 {} {} 255\n", mask.width(), mask.height());
    let values = mask.data().iter().map(|&inside| if inside { 255 } else { 0 });
    header.into_bytes().into_iter().chain(values).collect()
}

/// The bundled car, and the folder in `home` that holds it as the samples read it.
pub fn car(home: &Path) -> (Sequence, PathBuf) {
    let bundled = Path::new(ROOT).join("data/sequences/car");
    let read = sequence::load(&bundled, &LoadOptions::default()).unwrap();
    let (sequence, quaternions) = with_quaternions(read);
    let frames = home.join("frames");
    write_frames(&sequence, &quaternions, &frames);
    (sequence, frames)
}
