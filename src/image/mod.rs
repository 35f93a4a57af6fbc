//! Rasters: colour images, masks and depth maps, their pyramids and measures.

mod distance;
mod grid;
mod pyramid;

pub use distance::NearestPixel;
pub use grid::{DepthMap, Grid, Mask, RgbImage};
pub use pyramid::{depth_pyramid, halve_depth, halve_image, halve_mask, mask_pyramid, pyramid};
