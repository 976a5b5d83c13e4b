//! The default flow.

use numpy::{Element, IntoPyArray, PyReadonlyArray2, PyReadonlyArray4};
use pyo3::prelude::*;
use unsmear::flow::coarse_to_fine::{CoarseToFine, Sample, Sequence};

use crate::arrays::{interleaved, picture_to_python};
use crate::threads::run;

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
#[allow(clippy::struct_excessive_bools, reason = "as the core's")]
pub(crate) struct Items {
    pyramid_factor: f64,
    coarsest_side: f64,
    finest_level: usize,
    warps: usize,
    finest_warps: usize,
    passes: usize,
    sweeps: usize,
    smoothness: f64,
    edge_sensitivity: f64,
    strongest_channel: bool,
    residual_scale: f64,
    precision_scale: f64,
    tau: f64,
    amplitude_fraction: f64,
    amplitude_floor: f64,
    median_radius: usize,
    guide_sigma: f64,
    frames_each_side: usize,
    static_evidence: bool,
    forward_backward: bool,
    adapt_to_noise: bool,
    choose_frames: bool,
}

/// A level's record: frames, height, width, changes, evidence, rest.
type Level = (usize, usize, usize, Vec<f64>, f64, f64);

/// Frames (T, H, W, C) of the types that are read as they are.
#[derive(FromPyObject)]
pub(crate) enum Frames<'py> {
    Bytes(PyReadonlyArray4<'py, u8>),
    Words(PyReadonlyArray4<'py, u16>),
    Single(PyReadonlyArray4<'py, f32>),
    Double(PyReadonlyArray4<'py, f64>),
}

/// Flow (H, W, 2), confidence (H, W) and the records of the levels.
type Found = (Py<PyAny>, Py<PyAny>, Vec<Level>);

/// The flow of frames (T, H, W, C) at `index`.
#[pyfunction]
#[pyo3(signature = (frames, index, parameters, *, mask=None, progress=None))]
pub(crate) fn coarse_to_fine(
    py: Python<'_>,
    frames: Frames<'_>,
    index: usize,
    parameters: Items,
    mask: Option<PyReadonlyArray2<'_, bool>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let method = method(&parameters);
    let mask = mask.as_ref();
    match &frames {
        Frames::Bytes(frames) => estimate(py, &method, frames, index, mask, progress),
        Frames::Words(frames) => estimate(py, &method, frames, index, mask, progress),
        Frames::Single(frames) => estimate(py, &method, frames, index, mask, progress),
        Frames::Double(frames) => estimate(py, &method, frames, index, mask, progress),
    }
}

fn method(parameters: &Items) -> CoarseToFine {
    let &Items { pyramid_factor, coarsest_side, finest_level, .. } = parameters;
    CoarseToFine {
        pyramid_factor,
        coarsest_side,
        finest_level,
        warps: parameters.warps,
        finest_warps: parameters.finest_warps,
        passes: parameters.passes,
        sweeps: parameters.sweeps,
        smoothness: parameters.smoothness,
        edge_sensitivity: parameters.edge_sensitivity,
        strongest_channel: parameters.strongest_channel,
        residual_scale: parameters.residual_scale,
        precision_scale: parameters.precision_scale,
        tau: parameters.tau,
        amplitude_fraction: parameters.amplitude_fraction,
        amplitude_floor: parameters.amplitude_floor,
        median_radius: parameters.median_radius,
        guide_sigma: parameters.guide_sigma,
        frames_each_side: parameters.frames_each_side,
        static_evidence: parameters.static_evidence,
        forward_backward: parameters.forward_backward,
        adapt_to_noise: parameters.adapt_to_noise,
        choose_frames: parameters.choose_frames,
    }
}

fn estimate<T: Sample + Element>(
    py: Python<'_>,
    method: &CoarseToFine,
    frames: &PyReadonlyArray4<'_, T>,
    index: usize,
    mask: Option<&PyReadonlyArray2<'_, bool>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let sequence =
        Sequence { frames: frames.as_array(), index, mask: mask.map(PyReadonlyArray2::as_array) };
    let (flow, confidence, levels) = run(py, progress, |control| {
        let (estimate, levels) = method.trace(&sequence, control)?;
        Ok((interleaved(&estimate.flow), estimate.confidence, levels))
    })?;
    let flow = flow.into_pyarray(py).into_any().unbind();
    let levels = levels.into_iter().map(|level| {
        let (height, width) = level.size;
        (level.frames, height, width, level.changes, level.evidence, level.rest)
    });
    let confidence = picture_to_python(py, confidence).into_any().unbind();
    Ok((flow, confidence, levels.collect()))
}
