//! The solution as a COLMAP text model: `cameras.txt`, `images.txt`, `points3D.txt`; world = object frame.

use super::{ReportError, Surface, View, trajectory::quaternion};
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
        view: &View,
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
