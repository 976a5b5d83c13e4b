//! Component velocities and the bank behind them.

use ndarray::Array3;
use numpy::{Element, IntoPyArray, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use unsmear::Real;
use unsmear::component_velocity::ComponentVelocities;
use unsmear::fourier::Complex;
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

/// Responses complex (N, H, W) of the corrected bank and their gradients phi_x, phi_y (N, H, W), in
/// the precision of the picture.
#[pyfunction]
pub(crate) fn gabor_phase_gradient<'py>(
    py: Python<'py>,
    picture: &Bound<'py, PyAny>,
    parameters: parameters::Bank,
) -> PyResult<ResponsesAndGradient> {
    if let Ok(single) = picture.extract::<PyReadonlyArray2<'py, f32>>() {
        return respond(py, &single, &parameters);
    }
    respond(py, &picture.extract::<PyReadonlyArray2<'py, f64>>()?, &parameters)
}

/// Complex responses, `phi_x`, `phi_y`.
type ResponsesAndGradient = (Py<PyAny>, Py<PyAny>, Py<PyAny>);

fn respond<T>(
    py: Python<'_>,
    picture: &PyReadonlyArray2<'_, T>,
    parameters: &parameters::Bank,
) -> PyResult<ResponsesAndGradient>
where
    T: Real + Element,
    Complex<T>: Element,
{
    let border = parameters.border()?;
    let bank = GaborBank::<T>::new(&parameters.gabor()).map_err(|e| to_python(&e))?;
    let picture = picture.as_array();
    let (filters, (height, width)) = (bank.wavevectors().len(), picture.dim());
    let planes = run(py, None, |control| {
        let responses = bank.respond(picture, border, control)?;
        let gradient = PhaseGradient::new(&responses, bank.wavevectors(), control)?;
        let length = filters * height * width;
        let mut complex = Vec::with_capacity(length);
        let [mut phi_x, mut phi_y] = [(); 2].map(|()| Vec::with_capacity(length));
        for (filter, y) in (0..filters).flat_map(|f| (0..height).map(move |y| (f, y))) {
            let (re, im) = responses.row(filter, y);
            complex.extend(re.iter().zip(im).map(|(&re, &im)| Complex::new(re, im)));
            let row = gradient.row(filter, y);
            phi_x.extend_from_slice(row.phi_x);
            phi_y.extend_from_slice(row.phi_y);
        }
        Ok((complex, phi_x, phi_y))
    })?;
    let shape = (filters, height, width);
    Ok((
        cube_to_python(py, shape, planes.0)?,
        cube_to_python(py, shape, planes.1)?,
        cube_to_python(py, shape, planes.2)?,
    ))
}

/// What the bank makes of a picture, without a copy: real and imaginary parts (2, N, H, W); `phi_x`,
/// `phi_y` and squared amplitude (3, N, H, W), in the precision of the picture.
#[pyfunction]
pub(crate) fn gabor_planes<'py>(
    py: Python<'py>,
    picture: &Bound<'py, PyAny>,
    parameters: parameters::Bank,
) -> PyResult<(Py<PyAny>, Py<PyAny>)> {
    if let Ok(single) = picture.extract::<PyReadonlyArray2<'py, f32>>() {
        return planes(py, &single, &parameters);
    }
    planes(py, &picture.extract::<PyReadonlyArray2<'py, f64>>()?, &parameters)
}

fn planes<T: Real + Element>(
    py: Python<'_>,
    picture: &PyReadonlyArray2<'_, T>,
    parameters: &parameters::Bank,
) -> PyResult<(Py<PyAny>, Py<PyAny>)> {
    let border = parameters.border()?;
    let bank = GaborBank::<T>::new(&parameters.gabor()).map_err(|e| to_python(&e))?;
    let picture = picture.as_array();
    let (responses, gradient) = run(py, None, |control| {
        let responses = bank.respond(picture, border, control)?;
        let gradient = PhaseGradient::new(&responses, bank.wavevectors(), control)?;
        Ok((responses.into_array(), gradient.into_array()))
    })?;
    let [responses, gradient] =
        [responses, gradient].map(|planes| planes.into_pyarray(py).into_any().unbind());
    Ok((responses, gradient))
}

fn cube_to_python<T: Element>(
    py: Python<'_>,
    shape: (usize, usize, usize),
    samples: Vec<T>,
) -> PyResult<Py<PyAny>> {
    let cube = Array3::from_shape_vec(shape, samples)
        .map_err(|error| PyValueError::new_err(format!("picture: {error}")))?;
    Ok(cube.into_pyarray(py).into_any().unbind())
}
