//! Separable correlation, double precision: for proofs.

use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;

use unsmear::Border;

use crate::errors::to_python;
use crate::threads::run;

/// Correlates a volume (T, H, W) with taps along t, y and x.
#[pyfunction]
pub(crate) fn correlate_separable<'py>(
    py: Python<'py>,
    volume: PyReadonlyArray3<'py, f64>,
    taps: [Vec<f64>; 3],
    border: &str,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let border: Border = border.parse().map_err(|e| to_python(&e))?;
    let volume = volume.as_array();
    let out = run(py, None, |control| {
        unsmear::correlate_separable(volume, [&taps[0], &taps[1], &taps[2]], border, control)
    })?;
    Ok(out.into_pyarray(py))
}
