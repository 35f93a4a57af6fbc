//! Frames.

use crate::arrays::Pixels;
use crate::raised;
use pyo3::prelude::*;
use spba_ceres::geometry::Pinhole;
use spba_host::frames::{CPose, Frames, Given};

/// A pose as Python has it: quaternion (real part first) and translation.
pub type Pose = ([f64; 4], [f64; 3]);

/// The frames, copied.
#[pyclass]
#[derive(Default)]
pub struct Sequence(pub Frames);

#[pymethods]
impl Sequence {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Adds a frame. `image`: height x width x 3, RGB from 0 to 255 (uint8 or float32), undistorted. `mask`: height x width; the
    /// object is True, above 127 (uint8) or above 0.5 (float32). `camera`: fx, fy, cx, cy in pixels, the centre of the top-left
    /// pixel being (0.5, 0.5). `cam_from_world`: (quaternion, real part first; translation), as COLMAP has it, or None.
    /// `depth`: float32, z in units of the poses, 0 where it is unknown, or None.
    #[pyo3(signature = (name, image, mask, camera, cam_from_world=None, depth=None))]
    fn add(
        &mut self,
        name: &str,
        image: &Bound<'_, PyAny>,
        mask: &Bound<'_, PyAny>,
        camera: [f64; 4],
        cam_from_world: Option<Pose>,
        depth: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let own = self.0.next_name(Some(name));
        let fields = ["image", "mask", "depth"].map(|field| format!("{own}.{field}"));
        let image = Pixels::of(image, &fields[0])?;
        let mask = Pixels::of(mask, &fields[1])?;
        let depth = depth.map(|depth| Pixels::of(depth, &fields[2])).transpose()?;
        let [fx, fy, cx, cy] = camera;
        let given = Given {
            name: Some(name),
            image: Some(image.raster(&fields[0])?),
            mask: Some(mask.raster(&fields[1])?),
            depth: depth.as_ref().map(|depth| depth.raster(&fields[2])).transpose()?,
            camera: Pinhole { fx, fy, cx, cy },
            cam_from_world: cam_from_world.map(|(quaternion_wxyz, translation)| CPose {
                quaternion_wxyz,
                translation,
            }),
        };
        self.0.add(&given).map_err(raised)
    }
}
