//! A row-major raster of any pixel type.

/// A `width` × `height` raster, row-major; pixel (column, row) covers \[column, column + 1) × \[row, row + 1).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Grid<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

/// A colour image, RGB in \[0, 255\].
pub type RgbImage = Grid<[f32; 3]>;
/// A mask: true on the object.
pub type Mask = Grid<bool>;
/// A depth map: z in the units of the poses that belong to it; 0 = unknown.
pub type DepthMap = Grid<f32>;

impl DepthMap {
    /// The mask of the pixels with a depth.
    pub fn known(&self) -> Mask {
        Grid::from_fn(self.width(), self.height(), |column, row| {
            self[(column, row)] > 0.0
        })
    }
}

impl<T: Clone> Grid<T> {
    /// A raster of `width` × `height` pixels that all hold `value`.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self {
            width,
            height,
            data: vec![value; width * height],
        }
    }
}

impl<T> Grid<T> {
    /// `None` unless `data` holds `width * height` pixels.
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (data.len() == width * height).then_some(Self { width, height, data })
    }

    /// A raster of `width` × `height` pixels; `pixel` gives the value at (column, row).
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> T) -> Self {
        let data = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        Self { width, height, data }
    }

    /// The number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The size (width, height) in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The pixels, row after row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// The pixels, row after row, without a copy.
    pub fn into_data(self) -> Vec<T> {
        self.data
    }

    /// The pixels, row after row, to be changed in place.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The pixel at (`column`, `row`); `None` outside the raster.
    pub fn get(&self, column: usize, row: usize) -> Option<&T> {
        (column < self.width && row < self.height).then(|| &self.data[row * self.width + column])
    }

    /// The pixel that holds the image point (`u`, `v`), as (column, row); `None` outside the image.
    pub fn pixel_at(&self, u: f64, v: f64) -> Option<(usize, usize)> {
        (u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64)
            .then_some((u as usize, v as usize))
    }
}

impl<T> std::ops::Index<(usize, usize)> for Grid<T> {
    type Output = T;
    /// The pixel at (column, row); panics outside the raster.
    fn index(&self, (column, row): (usize, usize)) -> &T {
        &self.data[row * self.width + column]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Grid<T> {
    fn index_mut(&mut self, (column, row): (usize, usize)) -> &mut T {
        &mut self.data[row * self.width + column]
    }
}
