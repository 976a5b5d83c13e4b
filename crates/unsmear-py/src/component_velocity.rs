//! Component velocities and the bank behind them.

use ndarray::Array3;
use numpy::{Complex64, Element, IntoPyArray, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::Real;
use unsmear::component_velocity::ComponentVelocities;
use unsmear::gabor::GaborBank;
use unsmear::phase_gradient::PhaseGradient;

use crate::errors::to_python;
use crate::parameters;
use crate::threads::run;

/// Planes (6, N, H, W): phi_x, phi_y, phi_t, v_x, v_y, amplitude; and the wavevectors.
#[pyfunction]
#[pyo3(signature = (frames, index, parameters, *, progress=None))]
pub(crate) fn component_velocities(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    index: usize,
    parameters: &Bound<'_, PyAny>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Py<PyAny>, Vec<[f64; 2]>)> {
    let method = parameters::component_velocities(parameters)?;
    if let Ok(single) = frames.extract::<PyReadonlyArray3<'_, f32>>() {
        return estimate(py, &method, &single, index, progress);
    }
    estimate(py, &method, &frames.extract::<PyReadonlyArray3<'_, f64>>()?, index, progress)
}

fn estimate<T: Real + Element>(
    py: Python<'_>,
    method: &ComponentVelocities,
    frames: &PyReadonlyArray3<'_, T>,
    index: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Py<PyAny>, Vec<[f64; 2]>)> {
    let frames = frames.as_array();
    let field = run(py, progress, |control| method.estimate(frames, index, control))?;
    Ok((field.planes.into_pyarray(py).into_any().unbind(), field.wavevectors))
}

/// Responses complex (N, H, W) of the corrected bank and their gradients phi_x, phi_y (N, H, W).
#[pyfunction]
pub(crate) fn gabor_phase_gradient(
    py: Python<'_>,
    picture: PyReadonlyArray2<'_, f64>,
    parameters: parameters::Bank,
) -> PyResult<(Py<PyAny>, Py<PyAny>, Py<PyAny>)> {
    let border = parameters.border()?;
    let bank = GaborBank::<f64>::new(&parameters.gabor()).map_err(|e| to_python(&e))?;
    let picture = picture.as_array();
    let (responses, gradient) = run(py, None, |control| {
        let responses = bank.respond(picture, border, control)?;
        let gradient = PhaseGradient::new(&responses, bank.wavevectors(), control)?;
        Ok((responses, gradient))
    })?;
    let shape = responses.dim();
    let complex = Array3::from_shape_fn(shape, |(n, y, x)| {
        let (re, im) = responses.row(n, y);
        Complex64::new(re[x], im[x])
    });
    let phi_x = Array3::from_shape_fn(shape, |(n, y, x)| gradient.row(n, y).phi_x[x]);
    let phi_y = Array3::from_shape_fn(shape, |(n, y, x)| gradient.row(n, y).phi_y[x]);
    let [phi_x, phi_y] = [phi_x, phi_y].map(|phi| phi.into_pyarray(py).into_any().unbind());
    Ok((complex.into_pyarray(py).into_any().unbind(), phi_x, phi_y))
}
