//! The solution as a COLMAP text model: `cameras.txt`, `images.txt`, `points3D.txt`; world = object frame.

use super::{ReportError, Surface, ZBuffer, trajectory::quaternion};
use crate::geometry::{Pinhole, Pose};
use std::fmt::Write;
use std::path::Path;

/// Grows frame by frame.
pub(super) struct ColmapModel {
    cameras: Vec<(Pinhole, (usize, usize))>,
    images: String,
    /// Per point: (image id, index among that image's 2D points).
    tracks: Vec<Vec<(usize, usize)>>,
    image_count: usize,
}

impl ColmapModel {
    pub(super) fn new(point_count: usize) -> Self {
        Self {
            cameras: Vec::new(),
            images: "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME: camera_from_object\n\
                     # POINTS2D[] as (X, Y, POINT3D_ID): where the visible points project\n"
                .to_owned(),
            tracks: vec![Vec::new(); point_count],
            image_count: 0,
        }
    }

    /// Frames with equal intrinsics and size share a camera; ids count from 1.
    pub(super) fn add(
        &mut self,
        name: &str,
        camera: &Pinhole,
        camera_from_object: &Pose,
        surface: &Surface,
        view: &ZBuffer,
    ) {
        let key = (*camera, view.depth.size());
        let known = self.cameras.iter().position(|other| *other == key);
        let camera_id = 1 + known.unwrap_or_else(|| {
            self.cameras.push(key);
            self.cameras.len() - 1
        });
        self.image_count += 1;
        let ([w, x, y, z], t) = (quaternion(camera_from_object), camera_from_object.translation);
        // Writing to a string cannot fail.
        let _ = writeln!(
            self.images,
            "{} {w} {x} {y} {z} {} {} {} {camera_id} {name}",
            self.image_count, t.x, t.y, t.z
        );
        let mut observations = Vec::new();
        for &point in &view.visible {
            let i = point as usize;
            if let Some(pixel) = camera.project(&camera_from_object.transform(&surface.points()[i])) {
                self.tracks[i].push((self.image_count, observations.len()));
                observations.push(format!("{:.3} {:.3} {}", pixel.x, pixel.y, i + 1));
            }
        }
        let _ = writeln!(self.images, "{}", observations.join(" "));
    }

    pub(super) fn write(
        &self,
        folder: &Path,
        surface: &Surface,
        colours: &[[u8; 3]],
    ) -> Result<(), ReportError> {
        let mut cameras = "# CAMERA_ID MODEL WIDTH HEIGHT FX FY CX CY\n".to_owned();
        for (i, (k, (width, height))) in self.cameras.iter().enumerate() {
            let _ = writeln!(
                cameras,
                "{} PINHOLE {width} {height} {} {} {} {}",
                i + 1,
                k.fx,
                k.fy,
                k.cx,
                k.cy
            );
        }
        let mut points = "# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID, POINT2D_IDX)\n".to_owned();
        for (i, ((p, [r, g, b]), track)) in surface.points().iter().zip(colours).zip(&self.tracks).enumerate()
        {
            let _ = write!(points, "{} {} {} {} {r} {g} {b} 0", i + 1, p.x, p.y, p.z);
            for (image, index) in track {
                let _ = write!(points, " {image} {index}");
            }
            points.push('\n');
        }
        for (name, text) in [
            ("cameras.txt", &cameras),
            ("images.txt", &self.images),
            ("points3D.txt", &points),
        ] {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(ReportError::io(&path))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{UnitQuaternion, Vector3};
    use crate::report::fixture::{box_car, solved};

    #[test]
    fn observations_are_reprojections_and_tracks_point_back() {
        let surface = Surface::from_points(box_car(300));
        let (sequence, solution) = solved(&surface, 2);
        let mut model = ColmapModel::new(300);
        for (l, frame) in sequence.frames.iter().enumerate() {
            let pose = solution.estimate.camera_from_object[l];
            let view = surface.render(&frame.camera, &pose, frame.image.size());
            model.add(&frame.name, &frame.camera, &pose, &surface, &view);
        }
        assert_eq!(model.cameras.len(), 1);
        let folder = tempfile::tempdir().unwrap();
        model.write(folder.path(), &surface, &[[1, 2, 3]; 300]).unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let images = read("images.txt");
        let lines: Vec<_> = images.lines().filter(|line| !line.starts_with('#')).collect();
        let numbers = |line: &str| -> Vec<f64> { line.split(' ').map_while(|v| v.parse().ok()).collect() };
        // The second image, as any reader of the format takes it.
        let (head, observations) = (numbers(lines[2]), numbers(lines[3]));
        let rotation =
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(head[1], head[2], head[3], head[4]));
        let camera = sequence.frames[1].camera;
        for observation in observations.chunks(3) {
            let point = surface.points()[observation[2] as usize - 1];
            let pixel = camera
                .project(&(rotation * point + Vector3::new(head[5], head[6], head[7])))
                .unwrap();
            assert!(
                (pixel.x - observation[0])
                    .abs()
                    .max((pixel.y - observation[1]).abs())
                    < 1e-3
            );
        }
        let tracked = read("points3D.txt")
            .lines()
            .filter(|line| !line.starts_with('#'))
            .fold(0, |count, line| {
                let values = numbers(line);
                let seen = values[8..].chunks(2).filter(|track| track[0] == 2.0);
                count
                    + seen
                        .inspect(|track| assert_eq!(observations[3 * track[1] as usize + 2], values[0]))
                        .count()
            });
        assert_eq!(tracked, observations.len() / 3);
    }
}
