//! From a host's pictures, masks, depths and poses to the frames of a sequence.

use crate::fault::Fault;
use spba_ceres::geometry::{Pinhole, Pose, Quaternion, UnitQuaternion, Vector3};
use spba_ceres::image::{DepthMap, Grid, Mask, RgbImage};
use spba_ceres::sequence::{Frame, Sequence, SequenceContent, SequenceError};
use std::path::PathBuf;

/// No side of a raster may be longer: 2¹⁶ pixels.
const LONGEST_SIDE: u32 = 1 << 16;
/// The norm of a quaternion may be this far from 1: hand-written ones have four decimals.
const UNIT_TOLERANCE: f64 = 1e-3;

/// `spba_format`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Three interleaved bytes a pixel, red first, 0 to 255.
    RgbU8,
    /// Three interleaved bytes a pixel, blue first, as OpenCV has them.
    BgrU8,
    /// Three interleaved floats a pixel, red first, 0 to 255.
    RgbF32,
    /// One byte a pixel.
    GreyU8,
    /// One float a pixel.
    GreyF32,
}

impl Format {
    /// The format of C's number; `None` where there is none.
    pub fn of(number: u32) -> Option<Self> {
        [
            Self::RgbU8,
            Self::BgrU8,
            Self::RgbF32,
            Self::GreyU8,
            Self::GreyF32,
        ]
        .into_iter()
        .nth(number as usize)
    }

    /// The bytes of one pixel.
    pub fn pixel_bytes(self) -> usize {
        match self {
            Self::RgbU8 | Self::BgrU8 => 3,
            Self::RgbF32 => 12,
            Self::GreyU8 => 1,
            Self::GreyF32 => 4,
        }
    }
}

/// A host's picture: rows of pixels, `row_stride` bytes apart.
#[derive(Clone, Copy, Debug)]
pub struct Raster<'a> {
    /// How a pixel is laid out.
    pub format: Format,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bytes from the start of one row to that of the next.
    pub row_stride: usize,
    /// (height − 1) · row_stride + width · pixel_bytes of them.
    pub bytes: &'a [u8],
}

/// How many bytes a raster takes.
///
/// # Errors
/// No pixel, too many of them, or rows that overlap.
pub fn byte_count(
    (width, height): (u32, u32),
    format: Format,
    row_stride: usize,
    what: &str,
) -> Result<usize, Fault> {
    if width == 0 || height == 0 || width > LONGEST_SIDE || height > LONGEST_SIDE {
        return Err(Fault::input(
            what,
            format!("{width} x {height} pixels"),
            "give 1 to 65536 pixels a side",
        ));
    }
    let row = width as usize * format.pixel_bytes();
    if row_stride < row {
        return Err(Fault::input(
            what,
            format!("row_stride is {row_stride}, a row takes {row} bytes"),
            "give the bytes from one row to the next",
        ));
    }
    let rows = (height as usize - 1).checked_mul(row_stride);
    let bytes = rows.and_then(|rows| rows.checked_add(row));
    bytes
        .filter(|&bytes| isize::try_from(bytes).is_ok())
        .ok_or_else(|| {
            Fault::input(
                what,
                format!("row_stride is {row_stride}"),
                "give the bytes from one row to the next",
            )
        })
}

impl Raster<'_> {
    fn map<T>(&self, pixel: impl Fn(&[u8]) -> T) -> Grid<T> {
        let size = self.format.pixel_bytes();
        Grid::from_fn(self.width, self.height, |column, row| {
            let at = row * self.row_stride + column * size;
            pixel(&self.bytes[at..at + size])
        })
    }

    fn image(&self, what: &str) -> Result<RgbImage, Fault> {
        match self.format {
            Format::RgbU8 => Ok(self.map(|p| [p[0], p[1], p[2]].map(f32::from))),
            Format::BgrU8 => Ok(self.map(|p| [p[2], p[1], p[0]].map(f32::from))),
            Format::RgbF32 => Ok(self.map(|p| [0, 4, 8].map(|at| float(&p[at..])))),
            Format::GreyU8 | Format::GreyF32 => Err(Fault::input(
                what,
                "its format has one channel",
                "give RGB or BGR",
            )),
        }
    }

    fn mask(&self, what: &str) -> Result<Mask, Fault> {
        match self.format {
            Format::GreyU8 => Ok(self.map(|p| p[0] > 127)),
            Format::GreyF32 => Ok(self.map(|p| float(p) > 0.5)),
            Format::RgbU8 | Format::BgrU8 | Format::RgbF32 => Err(Fault::input(
                what,
                "its format has three channels",
                "give one: above 127 (u8) or above 0.5 (f32) is the object",
            )),
        }
    }

    fn depth(&self, what: &str) -> Result<DepthMap, Fault> {
        match self.format {
            Format::GreyF32 => Ok(self.map(float)),
            _ => Err(Fault::input(
                what,
                "its format is not one channel of f32",
                "give z in units of the poses, 0 where it is unknown",
            )),
        }
    }
}

fn float(bytes: &[u8]) -> f32 {
    f32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// A pose as C has it.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CPose {
    /// The rotation as a unit quaternion, the real part first.
    pub quaternion_wxyz: [f64; 4],
    /// The translation, in units of the frame that the pose leads to.
    pub translation: [f64; 3],
}

impl From<&Pose> for CPose {
    fn from(pose: &Pose) -> Self {
        let quaternion = UnitQuaternion::from_rotation_matrix(&pose.rotation);
        Self {
            quaternion_wxyz: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
            translation: pose.translation.into(),
        }
    }
}

impl CPose {
    /// # Errors
    /// A quaternion that is not finite or not of unit length. Translations are checked with the sequence.
    pub fn checked(&self, what: &str) -> Result<Pose, Fault> {
        let [w, x, y, z] = self.quaternion_wxyz;
        let quaternion = Quaternion::new(w, x, y, z);
        let norm = quaternion.norm();
        if norm.is_nan() || (norm - 1.0).abs() > UNIT_TOLERANCE {
            return Err(Fault::input(
                format!("{what}.quaternion_wxyz"),
                format!("its norm is {norm}"),
                "give a unit quaternion, the real part first",
            ));
        }
        Ok(Pose {
            rotation: UnitQuaternion::new_normalize(quaternion).to_rotation_matrix(),
            translation: Vector3::from(self.translation),
        })
    }
}

/// One frame as a host gives it.
pub struct Given<'a> {
    /// The frame's name; `None` numbers it.
    pub name: Option<&'a str>,
    /// The colour image; every frame must have one.
    pub image: Option<Raster<'a>>,
    /// The mask, white on the object; every frame must have one.
    pub mask: Option<Raster<'a>>,
    /// z in world units, 0 = unknown; `None` without depth.
    pub depth: Option<Raster<'a>>,
    /// The intrinsics, pixels; the centre of the top-left pixel is (0.5, 0.5).
    pub camera: Pinhole,
    /// The off-the-shelf pose: x_cam = R x_world + t; `None` without one.
    pub cam_from_world: Option<CPose>,
}

/// Frames in the order in which they were added, each converted; together they are checked as a [`Sequence`].
#[derive(Default)]
pub struct Frames(Vec<Frame>);

impl Frames {
    /// What messages call the frame that is added next.
    pub fn next_name(&self, given: Option<&str>) -> String {
        match given {
            Some(name) => format!("frames[{}] `{}`", self.0.len(), name.escape_debug()),
            None => format!("frames[{}]", self.0.len()),
        }
    }

    /// # Errors
    /// No image or mask, a format that does not fit, a quaternion that is none, a mask of everything.
    pub fn add(&mut self, given: &Given) -> Result<(), Fault> {
        let own = self.next_name(given.name);
        let field = |name: &str| format!("{own}.{name}");
        let missing = |name: &str| Fault::input(field(name), "it is null", "give one for every frame");
        let image = given
            .image
            .ok_or_else(|| missing("image"))?
            .image(&field("image"))?;
        let mask = given.mask.ok_or_else(|| missing("mask"))?.mask(&field("mask"))?;
        if !mask.data().contains(&true) {
            return Err(Fault::input(
                field("mask"),
                "it is empty (nothing above 127, or above 0.5 in f32)",
                "mark the object, or leave the frame out",
            ));
        }
        if let Some(problem) = mask.covers_all() {
            return Err(Fault::input(
                field("mask"),
                problem,
                "mark the object and nothing else",
            ));
        }
        let depth = given
            .depth
            .map(|depth| depth.depth(&field("depth")))
            .transpose()?;
        let pose = given
            .cam_from_world
            .map(|pose| pose.checked(&field("cam_from_world")))
            .transpose()?;
        self.0.push(Frame {
            name: given
                .name
                .map_or_else(|| format!("{:06}", self.0.len()), str::to_owned),
            image: image.into(),
            mask,
            camera: given.camera,
            timestamp_s: None,
            camera_from_input: pose,
            depth,
            depth_deviation: None,
        });
        Ok(())
    }

    /// The checked sequence; pictures are shared with it.
    ///
    /// # Errors
    /// As for files: fewer than two frames, and what [`Sequence::new`] refuses.
    pub fn sequence(&self) -> Result<Sequence, SequenceError> {
        if self.0.len() < 2 {
            return Err(SequenceError::TooFewFrames {
                file: PathBuf::from("sequence"),
                count: self.0.len(),
                mend: "add frames".into(),
            });
        }
        Sequence::new(SequenceContent {
            name: "sequence".to_owned(),
            frames: self.0.clone(),
            motion_deviation: None,
            focal_deviation: None,
            truth: None,
        })
    }
}
