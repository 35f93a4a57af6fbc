//! Our own sequence folder: `sequence.toml` beside images, masks, depth and, for rendered sequences, truth.
//!
//! ```toml
//! schema = 1
//! motion_deviation = 0.001     # optional: how well the poses below are known, in diagonals of the object
//! focal_deviation = 0.1        # optional: how well the focal lengths below are known, as a share of them
//!
//! [[frames]]
//! name = "000"                 # unique
//! image = "images/000.png"     # relative to the folder; PNG or JPEG
//! mask = "masks/000.png"       # brighter than 127 = object; size of the image
//! timestamp_s = 0.0            # optional
//! camera = { fx = 500.0, fy = 500.0, cx = 160.0, cy = 120.0 }   # px; top-left pixel's centre is (0.5, 0.5)
//! camera_from_input = { rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation = [0, 0, 2] }  # optional
//! depth = "depth/000.exr"      # optional; one f32 channel Z, z in input units, 0 = unknown
//! depth_deviation = "deviation/000.exr"   # optional; one f32 channel `deviation`, of z as a share of z
//!
//! [truth]                      # optional
//! shape = "truth/shape.ply"    # binary little-endian, float x y z, object frame
//! depth = ["truth/000.exr"]    # z in object units, one per frame
//! camera_from_object = [{ rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation = [0, 0, 2] }]
//! ```

mod points;
mod read;
mod schema;
mod write;

pub(super) use read::draft;
#[cfg(feature = "vision")]
pub(crate) use write::fill;
pub use write::write;

/// The file that makes a folder a sequence folder.
pub(super) const MANIFEST: &str = "sequence.toml";
