//! Forward blur and its inverses for Python. Pictures come as channels (C, H, W), flow as (H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{ArrayView2, ArrayView3, Axis};
use numpy::{Element, IntoPyArray, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use unsmear::deblur::{ThesisDeblur, WienerDeblur};
use unsmear::{Control, FlowView, Real, Result};

use crate::threads;

/// Channels as views; their order is kept.
fn channels<'a, T>(image: &'a ArrayView3<'_, T>) -> Vec<ArrayView2<'a, T>> {
    image.outer_iter().collect()
}

fn flow_view<'a, T: Real>(flow: &'a ArrayView3<'_, T>) -> Result<FlowView<'a, T>> {
    FlowView::new(flow.index_axis(Axis(2), 0), flow.index_axis(Axis(2), 1))
}

/// Stacks restored channels to (C, H, W).
fn stack<T: Real>(images: &[ndarray::Array2<T>]) -> Result<ndarray::Array3<T>> {
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    ndarray::stack(Axis(0), &views)
        .map_err(|_| unsmear::Error::value("image", "channels of one shape", views.len()))
}

fn blur_channels<'py, T: Real + Element>(
    py: Python<'py>,
    image: &PyReadonlyArray3<'py, T>,
    flow: &PyReadonlyArray3<'py, T>,
    exposure: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let (image, flow) = (image.as_array(), flow.as_array());
    let blurred = threads::run(py, progress, |control: &Control| {
        let flow = flow_view(&flow)?;
        let blur = |channel| unsmear::blur::blur(channel, &flow, exposure, control);
        stack(&channels(&image).iter().map(blur).collect::<Result<Vec<_>>>()?)
    })?;
    Ok(blurred.into_pyarray(py))
}

/// See `unsmear.blur`; `float32`.
#[pyfunction]
#[pyo3(signature = (image, flow, exposure, progress=None))]
pub(crate) fn blur_f32<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f32>,
    flow: PyReadonlyArray3<'py, f32>,
    exposure: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    blur_channels(py, &image, &flow, exposure, progress)
}

/// See `unsmear.blur`; `float64`.
#[pyfunction]
#[pyo3(signature = (image, flow, exposure, progress=None))]
pub(crate) fn blur_f64<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f64>,
    flow: PyReadonlyArray3<'py, f64>,
    exposure: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    blur_channels(py, &image, &flow, exposure, progress)
}

type Outcome<'py, T> = (Bound<'py, PyArray3<T>>, Bound<'py, PyDict>);

fn wiener_channels<'py, T: Real + Element>(
    py: Python<'py>,
    image: &PyReadonlyArray3<'py, T>,
    flow: &PyReadonlyArray3<'py, T>,
    method: WienerDeblur,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, T>> {
    let (image, flow) = (image.as_array(), flow.as_array());
    let (restored, result) = threads::run(py, progress, |control: &Control| {
        let result = method.apply(&channels(&image), &flow_view(&flow)?, control)?;
        Ok((stack(&result.images)?, result))
    })?;
    let report = PyDict::new(py);
    report.set_item("noise", result.noise)?;
    report.set_item("reach", result.reach)?;
    report.set_item("unknown_pixels", result.unknown)?;
    report.set_item("still_pixels", result.still)?;
    report.set_item("too_long_pixels", result.too_long)?;
    Ok((restored.into_pyarray(py), report))
}

/// See `unsmear.deblur`, method "wiener"; `float32`.
#[pyfunction]
#[pyo3(signature = (image, flow, exposure, noise=None, regularization=None, progress=None))]
pub(crate) fn wiener_f32<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f32>,
    flow: PyReadonlyArray3<'py, f32>,
    exposure: f64,
    noise: Option<f64>,
    regularization: Option<f64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, f32>> {
    let method = WienerDeblur { exposure, noise, regularization };
    wiener_channels(py, &image, &flow, method, progress)
}

/// See `unsmear.deblur`, method "wiener"; `float64`.
#[pyfunction]
#[pyo3(signature = (image, flow, exposure, noise=None, regularization=None, progress=None))]
pub(crate) fn wiener_f64<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f64>,
    flow: PyReadonlyArray3<'py, f64>,
    exposure: f64,
    noise: Option<f64>,
    regularization: Option<f64>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Outcome<'py, f64>> {
    let method = WienerDeblur { exposure, noise, regularization };
    wiener_channels(py, &image, &flow, method, progress)
}

/// See `unsmear.deblur`, method "thesis". One channel (H, W); returns the picture and the count of unknown pixels.
#[pyfunction]
#[pyo3(signature = (image, flow, degree, regularization, progress=None))]
pub(crate) fn thesis_deblur<'py>(
    py: Python<'py>,
    image: PyReadonlyArray2<'py, f64>,
    flow: PyReadonlyArray3<'py, f64>,
    degree: usize,
    regularization: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, numpy::PyArray2<f64>>, usize)> {
    let (image, flow) = (image.as_array(), flow.as_array());
    let result = threads::run(py, progress, |control: &Control| {
        ThesisDeblur { degree, regularization }.apply(&image, &flow_view(&flow)?, control)
    })?;
    Ok((result.image.into_pyarray(py), result.unknown))
}
