//! numpy arrays as rasters.

use numpy::{Element, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use spba_host::frames::{Format, Raster};

/// An array that a raster borrows.
pub enum Pixels<'py> {
    RgbU8(PyReadonlyArray3<'py, u8>),
    RgbF32(PyReadonlyArray3<'py, f32>),
    GreyU8(PyReadonlyArray2<'py, u8>),
    GreyF32(PyReadonlyArray2<'py, f32>),
    /// A mask of bool, as 0 and 255.
    Marked {
        height: usize,
        width: usize,
        bytes: Vec<u8>,
    },
}

impl<'py> Pixels<'py> {
    /// # Errors
    /// `what` is none of the arrays that [`Pixels`] names.
    pub fn of(array: &Bound<'py, PyAny>, what: &str) -> PyResult<Self> {
        if let Ok(found) = array.extract() {
            return Ok(Self::RgbU8(found));
        }
        if let Ok(found) = array.extract() {
            return Ok(Self::RgbF32(found));
        }
        if let Ok(found) = array.extract() {
            return Ok(Self::GreyU8(found));
        }
        if let Ok(found) = array.extract() {
            return Ok(Self::GreyF32(found));
        }
        if let Ok(found) = array.extract::<PyReadonlyArray2<'py, bool>>() {
            let [height, width] = [found.shape()[0], found.shape()[1]];
            let bytes = found
                .as_array()
                .iter()
                .map(|&inside| if inside { 255 } else { 0 })
                .collect();
            return Ok(Self::Marked { height, width, bytes });
        }
        Err(PyTypeError::new_err(format!(
            "{what}: give a numpy array of height x width x 3 (uint8 or float32) or height x width (uint8, float32 or bool)"
        )))
    }

    /// # Errors
    /// An array whose rows have gaps.
    pub fn raster(&self, what: &str) -> PyResult<Raster<'_>> {
        let of = |format: Format, shape: &[usize], bytes| Raster {
            format,
            width: shape[1],
            height: shape[0],
            row_stride: shape[1] * format.pixel_bytes(),
            bytes,
        };
        match self {
            Self::RgbU8(array) => Ok(of(Format::RgbU8, array.shape(), whole(array, what)?)),
            Self::GreyU8(array) => Ok(of(Format::GreyU8, array.shape(), whole(array, what)?)),
            Self::RgbF32(array) => Ok(of(Format::RgbF32, array.shape(), bytes(whole(array, what)?))),
            Self::GreyF32(array) => Ok(of(Format::GreyF32, array.shape(), bytes(whole(array, what)?))),
            Self::Marked { height, width, bytes } => Ok(of(Format::GreyU8, &[*height, *width], bytes)),
        }
    }
}

fn bytes(values: &[f32]) -> &[u8] {
    bytemuck::cast_slice(values)
}

fn whole<'a, T: Element, D: numpy::ndarray::Dimension>(
    array: &'a numpy::PyReadonlyArray<'_, T, D>,
    what: &str,
) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| {
        PyValueError::new_err(format!(
            "{what}: its rows have gaps; give numpy.ascontiguousarray of it"
        ))
    })
}

/// All numbers of an array, row by row.
pub fn numbers(array: &PyReadonlyArrayDyn<'_, f64>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}
