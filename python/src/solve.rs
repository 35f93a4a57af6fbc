//! The solve and what it finds.

use crate::prior::Prior;
use crate::raised;
use crate::sequence::{Pose, Sequence};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use spba_ceres::config::Config;
use spba_ceres::solver::Termination;
use spba_host::frames::CPose;
use spba_host::log::Severity;
use spba_host::observer::{LogSink, Observer, Progress};
use spba_host::solve::{self as core, Solved};
use std::sync::{Arc, Mutex, PoisonError};

/// What a solve found.
#[pyclass(frozen)]
pub struct Solution(Solved);

#[pymethods]
impl Solution {
    /// `below_threshold`, `converged`, `step_limit`, or `stopped` by the observer.
    #[getter]
    fn status(&self) -> &'static str {
        match self.0.solution.termination {
            Termination::BelowThreshold => "below_threshold",
            Termination::Converged => "converged",
            Termination::StepLimit => "step_limit",
            Termination::Interrupted => "stopped",
        }
    }

    /// One (quaternion, real part first; translation in object diagonals) a frame.
    #[getter]
    fn cam_from_object(&self) -> Vec<Pose> {
        let poses = self.0.solution.estimate.camera_from_object.iter();
        poses
            .map(|pose| {
                let pose = CPose::from(pose);
                (pose.quaternion_wxyz, pose.translation)
            })
            .collect()
    }

    /// (scale, quaternion, translation) of x_object = scale R x_world + t; None without poses.
    #[getter]
    fn object_from_world(&self) -> Option<(f64, [f64; 4], [f64; 3])> {
        let found = self.0.object_from_world?;
        let rigid = CPose::from(&spba_ceres::geometry::Pose {
            rotation: found.rotation,
            translation: found.translation,
        });
        Some((found.scale, rigid.quaternion_wxyz, rigid.translation))
    }

    /// One in [0, 1] a frame.
    #[getter]
    fn silhouette_iou<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.silhouette_iou.clone().into_pyarray(py)
    }

    #[getter]
    fn style<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.solution.estimate.style.clone().into_pyarray(py)
    }

    /// N x 3, object frame.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.0.points)
    }

    /// N x 3.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.0.normals)
    }

    /// F x 3 indices of points.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, &self.0.faces)
    }

    #[getter]
    fn objective(&self) -> f64 {
        self.0.solution.objective_end.total
    }

    /// Object diagonals a unit of the poses and depths.
    #[getter]
    fn alpha(&self) -> f64 {
        self.0.solution.estimate.alpha
    }
}

fn rows<'py, T: numpy::Element + Clone>(py: Python<'py>, values: &[T]) -> PyResult<Bound<'py, PyArray2<T>>> {
    Array2::from_shape_vec((values.len() / 3, 3), values.to_vec())
        .map(|array| array.into_pyarray(py))
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// What a callback raised first.
type Raised = Arc<Mutex<Option<PyErr>>>;

fn keep(raised: &Raised, error: PyErr) {
    let mut kept = raised.lock().unwrap_or_else(PoisonError::into_inner);
    kept.get_or_insert(error);
}

fn has_raised(raised: &Raised) -> bool {
    raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
}

/// Solves, without holding the interpreter. `options`: TOML, the keys of `spba-ceres solve --print-config`. `observer` gets a dict with
/// stage, step, iteration, objective and seconds; False stops the solve. `log` gets (level, message). Both are called from threads of
/// the library, one at a time; what they raise ends the solve and is raised here.
#[pyfunction]
#[pyo3(signature = (sequence, prior, options="", observer=None, log=None))]
pub fn solve(
    py: Python<'_>,
    sequence: &Sequence,
    prior: &Prior,
    options: &str,
    observer: Option<Py<PyAny>>,
    log: Option<Py<PyAny>>,
) -> PyResult<Solution> {
    let config: Config = core::options(options).map_err(raised)?;
    let raised_there = Raised::default();
    let observer: Option<Box<Observer>> = match (observer, &log) {
        (None, None) => None,
        // Also there for a log that raises.
        (observer, _) => Some(observing(observer, raised_there.clone())),
    };
    let log = log.map(|log| logging(log, raised_there.clone()));
    let outcome = py.detach(|| core::solve(&sequence.0, &prior.0, &config, observer.as_deref(), log));
    let first = raised_there.lock().unwrap_or_else(PoisonError::into_inner).take();
    match first {
        Some(error) => Err(error),
        None => outcome.map(Solution).map_err(raised),
    }
}

fn observing(observer: Option<Py<PyAny>>, raised: Raised) -> Box<Observer> {
    Box::new(move |progress: &Progress| {
        if has_raised(&raised) {
            return false;
        }
        let Some(observer) = &observer else { return true };
        Python::attach(|py| {
            let call = || -> PyResult<bool> {
                let told = PyDict::new(py);
                told.set_item("stage", progress.stage)?;
                told.set_item("step", progress.step)?;
                told.set_item("iteration", progress.iteration)?;
                told.set_item("objective", progress.objective)?;
                told.set_item("seconds", progress.seconds)?;
                let answer = observer.call1(py, (told,))?;
                // None goes on.
                Ok(answer.is_none(py) || answer.is_truthy(py)?)
            };
            call().unwrap_or_else(|error| {
                keep(&raised, error);
                false
            })
        })
    })
}

fn logging(log: Py<PyAny>, raised: Raised) -> Arc<LogSink> {
    Arc::new(move |severity: Severity, message: &str| {
        let level = match severity {
            Severity::Debug => "debug",
            Severity::Info => "info",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        Python::attach(|py| {
            if let Err(error) = log.call1(py, (level, message)) {
                keep(&raised, error);
            }
        });
    })
}
