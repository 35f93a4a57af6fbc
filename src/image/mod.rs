//! Rasters: colour images, masks and depth maps, their files, pyramids and measures.

mod blur;
mod depth;
mod distance;
mod error;
mod files;
mod grid;
mod mask;
mod pyramid;
mod remap;

pub use blur::blur;
pub use depth::{read_depth, read_deviation, write_depth, write_deviation};
pub use distance::NearestPixel;
pub use error::ImageError;
pub use files::{mask_of, read_mask, read_rgb, read_rgb_covering, write_mask, write_rgb};
pub use grid::{DepthMap, Grid, Mask, RgbImage};
pub use pyramid::{halve_depth, halve_image, halve_mask, pyramid};

pub(crate) use files::one_line;
pub(crate) use remap::PixelMap;
