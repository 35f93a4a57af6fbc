//! Shape priors.

use crate::arrays::numbers;
use crate::raised;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use spba_ceres::prior::{LearnedPrior, LinearPrior, ShapePrior, check_unit, load};
use spba_host::fault::Fault;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Points, and their derivative by the style.
type Evaluated<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// A shape prior: a style of `style_count` numbers, standard normal, gives `point_count` points in the object frame.
#[pyclass(frozen)]
pub struct Prior(pub Arc<LearnedPrior>);

#[pymethods]
impl Prior {
    /// Reads a prior file (.safetensors).
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let loaded = load(&path).map_err(|error| raised(error.into()))?;
        Ok(Self(Arc::new(loaded)))
    }

    /// X(s) = mean + basis s: `mean` N x 3, `basis` N x 3 x S, `normals` N x 3, points in farthest-point order.
    #[staticmethod]
    fn linear(
        mean: PyReadonlyArrayDyn<'_, f64>,
        basis: PyReadonlyArrayDyn<'_, f64>,
        normals: PyReadonlyArrayDyn<'_, f64>,
    ) -> PyResult<Self> {
        let styles = basis.shape().last().copied().unwrap_or(0);
        let normals = numbers(&normals);
        let normals = normals.as_chunks::<3>().0.iter();
        let linear = LinearPrior::new(
            numbers(&mean),
            numbers(&basis),
            styles,
            normals.map(|normal| normal.map(|x| x as f32)).collect(),
        );
        let linear = linear.map_err(|error| raised(Fault::from(error)))?;
        check_unit(&linear, Path::new("the linear prior")).map_err(|error| raised(error.into()))?;
        Ok(Self(Arc::new(linear.into())))
    }

    #[getter]
    fn style_count(&self) -> usize {
        self.0.style_len()
    }

    #[getter]
    fn point_count(&self) -> usize {
        self.0.point_count()
    }

    /// X(s), N x 3, and its derivative by s, N x 3 x S, of the first `point_count` points.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        style: PyReadonlyArrayDyn<'_, f64>,
        point_count: usize,
    ) -> PyResult<Evaluated<'py>> {
        let (style, styles) = (numbers(&style), self.0.style_len());
        if style.len() != styles || point_count > self.0.point_count() {
            return Err(PyValueError::new_err(format!(
                "give {styles} styles and at most {} points",
                self.0.point_count()
            )));
        }
        let mut points = vec![0.0; 3 * point_count];
        let mut jacobian = vec![0.0; 3 * point_count * styles];
        self.0.points(&style, &mut points);
        self.0.jacobian(&style, &mut jacobian);
        let shaped = |error: numpy::ndarray::ShapeError| PyValueError::new_err(error.to_string());
        Ok((
            Array2::from_shape_vec((point_count, 3), points)
                .map_err(shaped)?
                .into_pyarray(py),
            Array3::from_shape_vec((point_count, 3, styles), jacobian)
                .map_err(shaped)?
                .into_pyarray(py),
        ))
    }
}
