//! Error maps and picture similarity, double precision.

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use unsmear::{FlowView, Result, metrics};

use crate::arrays::flow_view;
use crate::errors::to_python;
use crate::threads;

type ErrorMap = fn(FlowView<'_, f64>, FlowView<'_, f64>) -> Result<Array2<f64>>;

/// The map `name` ("angular", "direction", "endpoint" or "magnitude") of flow (H, W, 2).
#[pyfunction]
pub(crate) fn error_map<'py>(
    py: Python<'py>,
    name: &str,
    flow: PyReadonlyArray3<'py, f64>,
    truth: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let map: ErrorMap = match name {
        "angular" => metrics::angular_error,
        "direction" => metrics::direction_error,
        "endpoint" => metrics::endpoint_error,
        "magnitude" => metrics::magnitude_error,
        _ => return Err(PyValueError::new_err(format!("no error map is called {name:?}"))),
    };
    let errors = flow_view(&flow)
        .and_then(|flow| map(flow, flow_view(&truth)?))
        .map_err(|e| to_python(&e))?;
    Ok(errors.into_pyarray(py))
}

/// Peak signal-to-noise ratio in dB.
#[pyfunction]
pub(crate) fn psnr(
    a: PyReadonlyArray2<'_, f64>,
    b: PyReadonlyArray2<'_, f64>,
    data_range: f64,
) -> PyResult<f64> {
    metrics::psnr(a.as_array(), b.as_array(), data_range).map_err(|e| to_python(&e))
}

/// Mean structural similarity.
#[pyfunction]
pub(crate) fn ssim(
    a: PyReadonlyArray2<'_, f64>,
    b: PyReadonlyArray2<'_, f64>,
    data_range: f64,
) -> PyResult<f64> {
    metrics::ssim(a.as_array(), b.as_array(), data_range).map_err(|e| to_python(&e))
}

/// See `unsmear.noise.estimate_noise`; one channel.
#[pyfunction]
pub(crate) fn estimate_noise(
    py: Python<'_>,
    image: PyReadonlyArray2<'_, f64>,
    flow: PyReadonlyArray3<'_, f64>,
    exposure: f64,
) -> PyResult<f64> {
    let (image, flow) = (image.as_array(), flow_view(&flow).map_err(|e| to_python(&e))?);
    threads::run(py, None, |control| {
        unsmear::noise::estimate_noise(&image, &flow, exposure, control)
    })
}
