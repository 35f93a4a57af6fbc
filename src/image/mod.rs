//! Rasters: colour images, masks and depth maps, their pyramids and measures.

mod grid;

pub use grid::{DepthMap, Grid, Mask, RgbImage};
