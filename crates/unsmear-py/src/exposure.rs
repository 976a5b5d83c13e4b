//! The search for the exposure, for Python. Pictures come as (N, H, W), fields as (N, H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{ArrayView3, Axis};
use numpy::{PyReadonlyArray3, PyReadonlyArray4};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use unsmear::exposure::{ExposureFrame, ExposureSearch, ExposureStatus};
use unsmear::{Control, FlowView, Result};

use crate::threads;

fn field<'a>(field: ArrayView3<'a, f32>) -> Result<FlowView<'a, f32>> {
    let part = |part| {
        let mut view = field;
        view.collapse_axis(Axis(2), part);
        view.index_axis_move(Axis(2), 0)
    };
    FlowView::new(part(0), part(1))
}

/// See `unsmear.estimate_exposure`.
#[pyfunction]
#[pyo3(signature = (images, velocities, curvatures, range, noise, seed, progress=None))]
pub(crate) fn estimate_exposure<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<'py, f32>,
    velocities: PyReadonlyArray4<'py, f32>,
    curvatures: PyReadonlyArray4<'py, f32>,
    range: (f64, f64),
    noise: f64,
    seed: u64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (images, velocities) = (images.as_array(), velocities.as_array());
    let curvatures = curvatures.as_array();
    let found = threads::run(py, progress, |control: &Control| {
        let fields = velocities.outer_iter().zip(curvatures.outer_iter());
        let frames = images
            .outer_iter()
            .zip(fields)
            .map(|(image, (velocity, curvature))| {
                let (velocity, curvature) = (field(velocity)?, field(curvature)?);
                Ok(ExposureFrame { image, velocity, curvature })
            })
            .collect::<Result<Vec<_>>>()?;
        ExposureSearch { range, noise, seed }.estimate(&frames, control)
    })?;
    let report = PyDict::new(py);
    report.set_item("value", found.value)?;
    let status = match found.status {
        ExposureStatus::Ok => "ok",
        ExposureStatus::Unsure => "unsure",
        ExposureStatus::Small => "small",
    };
    report.set_item("status", status)?;
    report.set_item("vote", found.vote)?;
    report.set_item("spread", found.spread)?;
    report.set_item("tiles", found.tiles)?;
    report.set_item("likeliest", found.likeliest)?;
    Ok(report)
}
