//! Parts of the restoration of clips beside the solver, for Python. Fields are (H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::Axis;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::deblur::occlusion_weights;
use unsmear::restoration;
use unsmear::{Control, FlowField, Result};

use crate::arrays::interleaved;
use crate::errors::to_python;
use crate::threads::run;

/// A field (H, W, 2).
pub(crate) type Field<'py> = PyReadonlyArray3<'py, f32>;

/// Planes (C, H, W), or a field.
pub(crate) type Planes<'py> = Bound<'py, PyArray3<f32>>;

/// A field of the core's own.
pub(crate) fn owned(field: &Field<'_>) -> Result<FlowField<f32>> {
    let field = field.as_array();
    FlowField::new(field.index_axis(Axis(2), 0).to_owned(), field.index_axis(Axis(2), 1).to_owned())
}

/// Velocity and acceleration (H, W, 2) from the flows to the next frame and to the one before.
#[pyfunction]
#[pyo3(signature = (forward=None, backward=None, acceleration=None))]
pub(crate) fn frame_motion<'py>(
    py: Python<'py>,
    forward: Option<Field<'py>>,
    backward: Option<Field<'py>>,
    acceleration: Option<Field<'py>>,
) -> PyResult<(Planes<'py>, Planes<'py>)> {
    let fields =
        [forward, backward, acceleration].map(|field| field.as_ref().map(owned).transpose());
    let motion = run(py, None, |control: &Control| {
        let [forward, backward, acceleration] = fields;
        let (forward, backward, acceleration) = (forward?, backward?, acceleration?);
        let acceleration = acceleration.as_ref();
        let (forward, backward) = (forward.as_ref(), backward.as_ref());
        let motion = restoration::frame_motion(forward, backward, acceleration, control)?;
        Ok([motion.velocity, motion.acceleration].map(|field| interleaved(&field)))
    })?;
    let [velocity, acceleration] = motion.map(|field| field.into_pyarray(py));
    Ok((velocity, acceleration))
}

/// 1 (H, W) where the light of a pixel comes from one motion, 0 where its path crosses a jump of the flow.
#[pyfunction]
pub(crate) fn visibility<'py>(
    py: Python<'py>,
    velocity: Field<'py>,
    exposure: f64,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let velocity = owned(&velocity).map_err(|e| to_python(&e))?;
    let weights = run(py, None, |control| occlusion_weights(&velocity, exposure, control))?;
    Ok(weights.into_pyarray(py))
}

/// Number of the connected region of every pixel, 0 outside the mask, and how many there are.
#[pyfunction]
pub(crate) fn regions<'py>(
    py: Python<'py>,
    mask: PyReadonlyArray2<'py, bool>,
) -> (Bound<'py, PyArray2<u32>>, u32) {
    let (labels, count) = restoration::regions(&mask.as_array());
    (labels.into_pyarray(py), count)
}

/// Pixels within `radius` px, in both axes, of a pixel of the mask.
#[pyfunction]
pub(crate) fn dilated<'py>(
    py: Python<'py>,
    mask: PyReadonlyArray2<'py, bool>,
    radius: usize,
) -> Bound<'py, PyArray2<bool>> {
    restoration::dilated(&mask.as_array(), radius).into_pyarray(py)
}
