//! Restoration of one picture for Python. Channels come as (C, H, W), flow as (H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{Array2, Array3, ArrayView2, Axis};
use numpy::{Element, IntoPyArray, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use unsmear::deblur::{Blurred, Effort, MotionDeblur, MotionMethod, MotionResult};
use unsmear::{Control, Error, Real, Result};

use crate::arrays::flow_view;
use crate::errors::to_python;
use crate::threads;

type Outcome<'py, T> = (Bound<'py, PyArray3<T>>, Bound<'py, PyDict>);

/// The method called `name` in Python.
fn method_called(name: &str) -> PyResult<MotionMethod> {
    match name {
        "tv" => Ok(MotionMethod::TotalVariation(Effort::QUALITY)),
        "fast" => Ok(MotionMethod::TotalVariation(Effort::FAST)),
        "tikhonov" => Ok(MotionMethod::Tikhonov),
        "richardson-lucy" => Ok(MotionMethod::RichardsonLucy),
        _ => Err(PyValueError::new_err(format!("no method is called {name:?}"))),
    }
}

/// Stacks restored channels to (C, H, W).
fn stack<T: Real>(images: &[Array2<T>]) -> Result<Array3<T>> {
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    ndarray::stack(Axis(0), &views)
        .map_err(|_| Error::value("image", "channels of one shape", views.len()))
}

fn report_of<'py, T>(py: Python<'py>, result: &MotionResult<T>) -> PyResult<Bound<'py, PyDict>> {
    let report = PyDict::new(py);
    report.set_item("noise", result.noise)?;
    report.set_item("regularization", result.regularization)?;
    report.set_item("iterations", result.iterations)?;
    report.set_item("residual", result.residual)?;
    report.set_item("mismatch", result.mismatch)?;
    let [unknown, still, too_long] = result.copied;
    report.set_item("unknown_pixels", unknown)?;
    report.set_item("still_pixels", still)?;
    report.set_item("too_long_pixels", too_long)?;
    report.set_item("occluded_pixels", result.occluded)?;
    Ok(report)
}

fn deblur<'py, T: Real + Element>(
    py: Python<'py>,
    image: &PyReadonlyArray3<'py, T>,
    flow: &PyReadonlyArray3<'py, T>,
    acceleration: Option<&PyReadonlyArray3<'py, T>>,
    weights: Option<&PyReadonlyArray2<'py, f32>>,
    method: MotionDeblur,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, T>> {
    let image = image.as_array();
    let channels: Vec<ArrayView2<'_, T>> = image.outer_iter().collect();
    let weights = weights.map(PyReadonlyArray2::as_array);
    let acceleration = acceleration.map(flow_view).transpose().map_err(|e| to_python(&e))?;
    let flow = flow_view(flow).map_err(|e| to_python(&e))?;
    let (restored, result) = threads::run(py, progress, |control: &Control| {
        let blurred = Blurred { channels: &channels, flow, acceleration, weights };
        let result = method.apply(&blurred, control)?;
        Ok((stack(&result.images)?, result))
    })?;
    let report = report_of(py, &result)?;
    Ok((restored.into_pyarray(py), report))
}

/// See `unsmear.deblur`, methods "tv", "fast", "tikhonov" and "richardson-lucy"; `float32`.
#[pyfunction]
#[pyo3(signature = (image, flow, method, exposure, *, acceleration=None, weights=None, noise=None,
                    regularization=None, ceiling=None, progress=None))]
pub(crate) fn motion_deblur_f32<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f32>,
    flow: PyReadonlyArray3<'py, f32>,
    method: &str,
    exposure: f64,
    acceleration: Option<PyReadonlyArray3<'py, f32>>,
    weights: Option<PyReadonlyArray2<'py, f32>>,
    noise: Option<f64>,
    regularization: Option<f64>,
    ceiling: Option<f64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, f32>> {
    let method =
        MotionDeblur { method: method_called(method)?, exposure, noise, regularization, ceiling };
    deblur(py, &image, &flow, acceleration.as_ref(), weights.as_ref(), method, progress)
}

/// See `unsmear.deblur`, methods "tv", "fast", "tikhonov" and "richardson-lucy"; `float64`.
#[pyfunction]
#[pyo3(signature = (image, flow, method, exposure, *, acceleration=None, weights=None, noise=None,
                    regularization=None, ceiling=None, progress=None))]
pub(crate) fn motion_deblur_f64<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f64>,
    flow: PyReadonlyArray3<'py, f64>,
    method: &str,
    exposure: f64,
    acceleration: Option<PyReadonlyArray3<'py, f64>>,
    weights: Option<PyReadonlyArray2<'py, f32>>,
    noise: Option<f64>,
    regularization: Option<f64>,
    ceiling: Option<f64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, f64>> {
    let method =
        MotionDeblur { method: method_called(method)?, exposure, noise, regularization, ceiling };
    deblur(py, &image, &flow, acceleration.as_ref(), weights.as_ref(), method, progress)
}
