//! Resampling an image through a map of source pixels: OpenCV's remap, behind the feature `vision`.

use super::{DepthMap, Grid, Mask, RgbImage};

/// Where the centre of every target pixel lies in the source, row-major. Source and target have one size.
pub(crate) struct PixelMap {
    width: usize,
    height: usize,
    /// OpenCV's pixels: the top-left centre is (0, 0).
    x: Vec<f32>,
    y: Vec<f32>,
}

impl PixelMap {
    /// `source_from_target(u, v)` takes and gives our pixels, the top-left centre being (0.5, 0.5).
    pub fn new(width: usize, height: usize, source_from_target: impl Fn(f64, f64) -> [f64; 2]) -> Self {
        let (x, y) = (0..width * height)
            .map(|i| source_from_target((i % width) as f64 + 0.5, (i / width) as f64 + 0.5))
            .map(|[u, v]| ((u - 0.5) as f32, (v - 0.5) as f32))
            .unzip();
        Self { width, height, x, y }
    }

    /// Bilinear; beyond the source, its border's colour.
    pub fn rgb(&self, image: &RgbImage) -> Result<RgbImage, String> {
        let flat: Vec<f32> = image.data().iter().flatten().copied().collect();
        let flat = self.sample(&flat, 3, true)?;
        let pixel = |values: &[f32]| [values[0], values[1], values[2]];
        self.grid(flat.chunks_exact(3).map(pixel).collect())
    }

    /// Nearest pixel; false beyond the source.
    pub fn mask(&self, mask: &Mask) -> Result<Mask, String> {
        let flat: Vec<f32> = mask
            .data()
            .iter()
            .map(|&inside| f32::from(u8::from(inside)))
            .collect();
        self.grid(
            self.sample(&flat, 1, false)?
                .into_iter()
                .map(|value| value > 0.5)
                .collect(),
        )
    }

    /// Nearest pixel; 0 (unknown) beyond the source. z does not change with the pixel.
    pub fn depth(&self, depth: &DepthMap) -> Result<DepthMap, String> {
        self.grid(self.sample(depth.data(), 1, false)?)
    }

    fn grid<T>(&self, data: Vec<T>) -> Result<Grid<T>, String> {
        Grid::from_vec(self.width, self.height, data).ok_or_else(|| "image and map differ in size".to_owned())
    }

    #[cfg(feature = "vision")]
    fn sample(&self, source: &[f32], channels: usize, smooth: bool) -> Result<Vec<f32>, String> {
        use crate::bridge::vision::ffi::{Sampling, remap};
        let sampling = if smooth {
            Sampling::Linear
        } else {
            Sampling::Nearest
        };
        let mut target = vec![0.0; source.len()];
        remap(
            source,
            self.width,
            self.height,
            channels,
            &self.x,
            &self.y,
            sampling,
            &mut target,
        )
        .map_err(|error| super::one_line(error.what()))?;
        Ok(target)
    }

    #[cfg(not(feature = "vision"))]
    fn sample(&self, _source: &[f32], _channels: usize, _smooth: bool) -> Result<Vec<f32>, String> {
        let _ = (&self.x, &self.y);
        Err("this program was built without the feature `vision`; build with it".into())
    }
}

#[cfg(all(test, feature = "vision"))]
mod tests {
    use super::*;

    #[test]
    fn a_shift_by_whole_pixels_moves_pixels_exactly() {
        let map = PixelMap::new(5, 4, |u, v| [u + 2.0, v - 1.0]);
        let depth = Grid::from_fn(5, 4, |c, r| (10 * r + c + 1) as f32);
        let moved = map.depth(&depth).unwrap();
        assert_eq!(moved[(0, 1)], depth[(2, 0)]);
        assert_eq!(moved[(2, 3)], depth[(4, 2)]);
        assert_eq!((moved[(3, 1)], moved[(0, 0)]), (0.0, 0.0), "outside");
        let mask = Grid::from_fn(5, 4, |c, _| c >= 3);
        assert_eq!(
            map.mask(&mask).unwrap().data()[5..10],
            [false, true, true, false, false]
        );
        let image = Grid::from_fn(5, 4, |c, r| [(50 * c) as f32, (50 * r) as f32, 7.0]);
        assert_eq!(map.rgb(&image).unwrap()[(1, 2)], image[(3, 1)]);
    }

    #[test]
    fn opencvs_refusal_is_an_error() {
        let map = PixelMap::new(40_000, 1, |u, v| [u, v]);
        let message = map.depth(&Grid::filled(40_000, 1, 1.0)).unwrap_err();
        assert!(message.contains("size"), "{message}");
        let map = PixelMap::new(2, 2, |u, v| [u, v]);
        assert!(map.depth(&Grid::filled(3, 2, 1.0)).is_err());
    }
}
