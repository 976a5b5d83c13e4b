//! The founding flow method and its stages, double precision.

use ndarray::{Array2, Array3, Array4, ArrayView2, Axis};
use numpy::Complex64;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use unsmear::flow::thesis::bank::Bank;
use unsmear::flow::thesis::components::phase_gradient;
use unsmear::flow::thesis::gated_mean::GatedMean;
use unsmear::flow::thesis::moving_pixels;
use unsmear::fourier::Fft2;

use crate::arrays::interleaved;
use crate::errors::to_python;
use crate::parameters;
use crate::threads::run;

/// Flow (H, W, 2) float64 of frames (T, H, W).
#[pyfunction]
#[pyo3(signature = (frames, parameters, *, progress=None))]
pub(crate) fn thesis_flow<'py>(
    py: Python<'py>,
    frames: PyReadonlyArray3<'py, f64>,
    parameters: &Bound<'py, PyAny>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let method = parameters::thesis_flow(parameters)?;
    let frames = frames.as_array();
    let flow = run(py, progress, |go| Ok(interleaved(&method.estimate(frames, go)?)))?;
    Ok(flow.into_pyarray(py))
}

/// The parts of the founding bank: sigma, angles, temporal taps, and of each filter the window,
/// the kept bins (zero frequency in the middle) and the kernel, each (N, H, W).
#[pyfunction]
pub(crate) fn thesis_bank(
    py: Python<'_>,
    shape: (usize, usize, usize),
    tuning_frequency: f64,
    bandwidth_octaves: f64,
) -> PyResult<Bound<'_, PyDict>> {
    let (frames, height, width) = shape;
    let bank =
        Bank::new(height, width, tuning_frequency, bandwidth_octaves).map_err(|e| to_python(&e))?;
    let angles = bank.angles();
    let plan = Fft2::new(height, width);
    let each = |filter: &dyn Fn(f64) -> Vec<Complex64>| {
        let samples = angles.iter().flat_map(|&angle| filter(angle)).collect();
        Array3::from_shape_vec((angles.len(), height, width), samples).unwrap_or_default()
    };
    let windows = each(&|angle| bank.window(angle));
    let kernels = each(&|angle| bank.kernel(angle, &plan, &mut Vec::new()));
    let kept = Array3::from_shape_fn((angles.len(), height, width), |(n, row, column)| {
        bank.keeps(angles[n], row, column)
    });
    let parts = PyDict::new(py);
    parts.set_item("sigma", bank.sigma())?;
    parts.set_item("temporal_taps", PyArray1::from_vec(py, bank.temporal_taps(frames)))?;
    parts.set_item("windows", windows.into_pyarray(py))?;
    parts.set_item("kernels", kernels.into_pyarray(py))?;
    parts.set_item("kept", kept.into_pyarray(py))?;
    parts.set_item("angles", PyArray1::from_vec(py, angles))?;
    Ok(parts)
}

/// The stages between frames and components, over all filters: moving (H, W); responses complex,
/// phi_x, phi_y, phi_t, un, vn, each (N, T, H, W).
#[pyfunction]
pub(crate) fn thesis_stages<'py>(
    py: Python<'py>,
    frames: PyReadonlyArray3<'py, f64>,
    parameters: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let method = parameters::thesis_flow(parameters)?;
    let frames = frames.as_array();
    let moving = moving_pixels(frames);
    let (filtered, components) = run(py, None, |control| {
        let filtered = method.for_each_filter(frames, &moving, control, |response| {
            let complex = ndarray::Zip::from(&response.re)
                .and(&response.im)
                .map_collect(|&re, &im| Complex64::new(re, im));
            Ok((complex, phase_gradient(response, control)?))
        })?;
        Ok((filtered, method.components(frames, control)?))
    })?;
    let stages = PyDict::new(py);
    let (responses, gradients): (Vec<_>, Vec<_>) = filtered.into_iter().unzip();
    stages.set_item("responses", stacked(py, responses)?)?;
    let names = ["phi_x", "phi_y", "phi_t"];
    for (part, name) in names.into_iter().enumerate() {
        let arrays = gradients.iter().map(|gradient| gradient[part].clone()).collect();
        stages.set_item(name, stacked(py, arrays)?)?;
    }
    for (part, name) in ["un", "vn"].into_iter().enumerate() {
        let arrays = components.iter().map(|component| component[part].clone()).collect();
        stages.set_item(name, stacked(py, arrays)?)?;
    }
    stages.set_item("moving", moving.into_pyarray(py))?;
    Ok(stages)
}

fn stacked<T: numpy::Element + Clone>(
    py: Python<'_>,
    arrays: Vec<Array3<T>>,
) -> PyResult<Bound<'_, PyArray4<T>>> {
    let views: Vec<_> = arrays.iter().map(|array| array.view()).collect();
    let stacked: Array4<T> = ndarray::stack(Axis(0), &views)
        .map_err(|e| PyValueError::new_err(format!("frames: {e}")))?;
    Ok(stacked.into_pyarray(py))
}

type GatedAndMean<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Gated values (K, P) and the mean of the rest (P,), over the first axis of values (K, P).
#[pyfunction]
pub(crate) fn thesis_gated_mean<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    std_limit: f64,
    distance_limit: f64,
    least_fraction: f64,
) -> PyResult<GatedAndMean<'py>> {
    let gate = GatedMean { std_limit, distance_limit, least_fraction };
    gate.check().map_err(|e| to_python(&e))?;
    let values: ArrayView2<'_, f64> = values.as_array();
    let mut gated: Array2<f64> = values.to_owned();
    let means = gated
        .columns_mut()
        .into_iter()
        .map(|mut column| {
            let mut samples = column.to_vec();
            let mean = gate.of(&mut samples);
            column.iter_mut().zip(samples).for_each(|(out, sample)| *out = sample);
            mean
        })
        .collect();
    Ok((gated.into_pyarray(py), PyArray1::from_vec(py, means)))
}
