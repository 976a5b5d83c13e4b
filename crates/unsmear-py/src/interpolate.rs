//! Spline interpolation, double precision.

use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use unsmear::{Border, SplineDegree, SplineImage};

use crate::errors::to_python;
use crate::threads::run;

/// Values of the spline through a picture at positions `y`, `x` (px, of one shape).
#[pyfunction]
pub(crate) fn sample<'py>(
    py: Python<'py>,
    picture: PyReadonlyArray2<'py, f64>,
    y: PyReadonlyArray2<'py, f64>,
    x: PyReadonlyArray2<'py, f64>,
    degree: usize,
    border: &str,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let degree = SplineDegree::try_from(degree).map_err(|e| to_python(&e))?;
    let border: Border = border.parse().map_err(|e| to_python(&e))?;
    let (picture, y, x) = (picture.as_array(), y.as_array(), x.as_array());
    let values = run(py, None, |control| {
        SplineImage::new(&picture, degree, border, control)?.sample_at(&y, &x, control)
    })?;
    Ok(values.into_pyarray(py))
}
