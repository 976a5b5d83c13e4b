//! The search for the exposure, for Python. Pictures come as (N, H, W), fields as (N, H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{ArrayView3, ArrayView4, Axis};
use numpy::{PyReadonlyArray3, PyReadonlyArray4};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use unsmear::exposure::{ExposureFrame, ExposureSearch, ExposureStatus};
use unsmear::motion_path::MotionPaths;
use unsmear::{Control, FlowField, Result};

use crate::threads;

fn field(both: ArrayView3<'_, f32>) -> Result<FlowField<f32>> {
    FlowField::new(both.index_axis(Axis(2), 0).to_owned(), both.index_axis(Axis(2), 1).to_owned())
}

/// The turn of the velocities, degrees from right to down, that `unsmear.deblur` puts them right by; 0 for none.
#[pyfunction]
#[pyo3(signature = (images, velocities, accelerations, limits, noise, seed, progress=None))]
pub(crate) fn estimate_turn<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<'py, f32>,
    velocities: PyReadonlyArray4<'py, f32>,
    accelerations: Option<PyReadonlyArray4<'py, f32>>,
    limits: (f64, f64),
    noise: Option<f64>,
    seed: u64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<f64> {
    let (images, velocities) = (images.as_array(), velocities.as_array());
    let accelerations = accelerations.as_ref().map(|fields| fields.as_array());
    let turn = threads::run(py, progress, |control: &Control| {
        let paths = paths(&velocities, accelerations.as_ref(), false)?;
        let search = ExposureSearch { range: limits, noise, seed, turn: true };
        search.turn(&frames(&images, &paths), control)
    })?;
    Ok(turn.to_degrees())
}

/// Paths of an exposure as long as the frame interval.
fn paths(
    velocities: &ArrayView4<'_, f32>,
    accelerations: Option<&ArrayView4<'_, f32>>,
    of_content: bool,
) -> Result<Vec<MotionPaths>> {
    let of_frame = |(n, velocity)| {
        let velocity = field(velocity)?;
        let acceleration =
            accelerations.map(|fields| field(fields.index_axis(Axis(0), n))).transpose()?;
        match acceleration {
            Some(acceleration) if of_content => {
                MotionPaths::from_content_acceleration(&velocity, 1.0, &acceleration)
            }
            acceleration => MotionPaths::new(&velocity, 1.0, acceleration.as_ref()),
        }
    };
    velocities.outer_iter().enumerate().map(of_frame).collect()
}

fn frames<'a>(
    images: &ArrayView3<'a, f32>,
    paths: &'a [MotionPaths],
) -> Vec<ExposureFrame<'a, f32>> {
    (0..paths.len())
        .zip(paths)
        .map(|(n, paths)| ExposureFrame {
            image: (*images).index_axis_move(Axis(0), n),
            velocity: paths.velocity.view(),
            curvature: paths.curvature.view(),
        })
        .collect()
}

/// See `unsmear.estimate_exposure`; with `of_content` the accelerations are those that the moving content feels.
#[pyfunction]
#[pyo3(signature = (images, velocities, accelerations, limits, noise, seed, of_content=false, turn=false, progress=None))]
pub(crate) fn estimate_exposure<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<'py, f32>,
    velocities: PyReadonlyArray4<'py, f32>,
    accelerations: Option<PyReadonlyArray4<'py, f32>>,
    limits: (f64, f64),
    noise: Option<f64>,
    seed: u64,
    of_content: bool,
    turn: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (images, velocities) = (images.as_array(), velocities.as_array());
    let accelerations = accelerations.as_ref().map(|fields| fields.as_array());
    let found = threads::run(py, progress, |control: &Control| {
        let paths = paths(&velocities, accelerations.as_ref(), of_content)?;
        let search = ExposureSearch { range: limits, noise, seed, turn };
        search.estimate(&frames(&images, &paths), control)
    })?;
    let report = PyDict::new(py);
    report.set_item("value", found.value)?;
    report.set_item("turn", found.turn.to_degrees())?;
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
    report.set_item("noise", found.noise)?;
    Ok(report)
}
