//! Flow methods, single precision and, for proofs, double.

use numpy::{Element, IntoPyArray, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::flow::Estimate;
use unsmear::{Control, Real, Result};

use crate::arrays::{interleaved, picture_to_python};
use crate::parameters;
use crate::threads::run;

/// Flow (H, W, 2) and confidence (H, W), of the precision asked for.
type FlowAndConfidence = (Py<PyAny>, Py<PyAny>);

/// Flow and confidence of frames (T, H, W) at `index`.
#[pyfunction]
#[pyo3(signature = (frames, index, parameters, *, double=false, progress=None))]
pub(crate) fn least_squares(
    py: Python<'_>,
    frames: PyReadonlyArray3<'_, f64>,
    index: usize,
    parameters: &Bound<'_, PyAny>,
    double: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FlowAndConfidence> {
    let method = parameters::least_squares(parameters)?;
    let frames = frames.as_array();
    if double {
        return estimate::<f64>(py, progress, |go| method.estimate(frames, index, go));
    }
    estimate::<f32>(py, progress, |go| method.estimate(frames, index, go))
}

/// Flow and confidence of frames (T, H, W) at `index`.
#[pyfunction]
#[pyo3(signature = (frames, index, parameters, *, double=false, progress=None))]
pub(crate) fn fleet_jepson(
    py: Python<'_>,
    frames: PyReadonlyArray3<'_, f64>,
    index: usize,
    parameters: &Bound<'_, PyAny>,
    double: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FlowAndConfidence> {
    let method = parameters::fleet_jepson(parameters)?;
    let frames = frames.as_array();
    if double {
        return estimate::<f64>(py, progress, |go| method.estimate(frames, index, go));
    }
    estimate::<f32>(py, progress, |go| method.estimate(frames, index, go))
}

fn estimate<T: Real + Element>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Control) -> Result<Estimate<T>> + Send,
) -> PyResult<FlowAndConfidence> {
    let (flow, confidence) = run(py, progress, |control| {
        let Estimate { flow, confidence } = work(control)?;
        Ok((interleaved(&flow), confidence))
    })?;
    let flow = flow.into_pyarray(py).into_any().unbind();
    Ok((flow, picture_to_python(py, confidence).into_any().unbind()))
}
