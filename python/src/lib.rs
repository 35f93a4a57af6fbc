//! `spba._spba`: the solver for Python. Arrays are numpy's; a solve releases the interpreter.

#![warn(missing_docs)]

mod arrays;
mod prior;
mod sequence;
mod solve;

use pyo3::prelude::*;
use spba_host::fault::Fault;

pyo3::create_exception!(
    spba,
    SpbaError,
    pyo3::exceptions::PyException,
    "What the library refuses, or cannot do: one line that names it and how to mend it."
);

fn raised(fault: Fault) -> PyErr {
    SpbaError::new_err(fault.to_string())
}

#[pymodule]
mod _spba {
    #[pymodule_export]
    use super::SpbaError;
    #[pymodule_export]
    use super::prior::Prior;
    #[pymodule_export]
    use super::sequence::Sequence;
    #[pymodule_export]
    use super::solve::{Solution, solve};
}
