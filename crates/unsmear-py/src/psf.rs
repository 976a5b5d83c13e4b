//! Kernels of motion for Python.

use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::errors::to_python;

/// See `unsmear.motion_psf`.
#[pyfunction]
pub(crate) fn motion_psf(
    py: Python<'_>,
    velocity: [f64; 2],
    acceleration: [f64; 2],
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let psf = unsmear::psf::motion_psf(velocity, acceleration).map_err(|e| to_python(&e))?;
    Ok(psf.into_pyarray(py))
}

/// See `unsmear.fspecial_motion`.
#[pyfunction]
pub(crate) fn fspecial_motion(
    py: Python<'_>,
    length: f64,
    angle: f64,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let psf = unsmear::psf::fspecial_motion(length, angle).map_err(|e| to_python(&e))?;
    Ok(psf.into_pyarray(py))
}
