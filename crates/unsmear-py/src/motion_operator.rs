//! The motion operator for Python, single precision.

use ndarray::{Array2, ArrayView2};
use numpy::{PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::motion_operator::{MotionOperator as Core, Taps};
use unsmear::motion_path::MotionPaths;
use unsmear::{Error, FlowField, LinearOperator, Result};

use crate::arrays::{flow_view, picture_to_python};
use crate::errors::to_python;
use crate::threads::run;

/// See `unsmear.MotionOperator`.
#[pyclass(frozen)]
pub(crate) struct MotionOperator {
    core: Core,
}

#[pymethods]
impl MotionOperator {
    #[new]
    fn new(
        py: Python<'_>,
        velocity: PyReadonlyArray3<'_, f32>,
        exposure: f64,
        acceleration: Option<PyReadonlyArray3<'_, f32>>,
        offset: Option<PyReadonlyArray3<'_, f32>>,
        taps: &str,
        pad: Option<usize>,
    ) -> PyResult<Self> {
        let taps = match taps {
            "cubic" => Taps::Cubic,
            "linear" => Taps::Linear,
            _ => {
                let error = Error::value("taps", "\"cubic\" or \"linear\"", format!("{taps:?}"));
                return Err(to_python(&error));
            }
        };
        let field = |flow: &PyReadonlyArray3<'_, f32>| {
            let view = flow_view(flow)?;
            FlowField::new(view.u.to_owned(), view.v.to_owned())
        };
        let fields = || {
            let acceleration = acceleration.as_ref().map(field).transpose()?;
            let offset = offset.as_ref().map(field).transpose()?;
            Ok((field(&velocity)?, acceleration, offset))
        };
        let (velocity, acceleration, offset) = fields().map_err(|e: Error| to_python(&e))?;
        let core = run(py, None, |_| {
            let mut paths = MotionPaths::new(&velocity, exposure, acceleration.as_ref())?;
            if let Some(offset) = offset {
                paths = paths.with_offset(offset)?;
            }
            Core::new(&paths, taps, pad.unwrap_or_else(|| paths.reach()))
        })?;
        Ok(Self { core })
    }

    /// Shape of the unknown picture.
    #[getter]
    fn unknown_shape(&self) -> (usize, usize) {
        self.core.unknown_shape()
    }

    /// Shape of the data.
    #[getter]
    fn data_shape(&self) -> (usize, usize) {
        self.core.data_shape()
    }

    /// Pixels of the unknown on each side beyond the data.
    #[getter]
    fn pad(&self) -> usize {
        self.core.pad()
    }

    /// A x.
    fn forward<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let x = packed("x", &x.as_array(), self.core.unknown_shape()).map_err(|e| to_python(&e))?;
        let b = run(py, None, |_| {
            let mut b = Array2::zeros(self.core.data_shape());
            self.core.apply(&x, b.as_slice_mut().unwrap_or_default());
            Ok(b)
        })?;
        Ok(picture_to_python(py, b))
    }

    /// A^T b.
    fn adjoint<'py>(
        &self,
        py: Python<'py>,
        b: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let b = packed("b", &b.as_array(), self.core.data_shape()).map_err(|e| to_python(&e))?;
        let x = run(py, None, |_| {
            let mut x = Array2::zeros(self.core.unknown_shape());
            self.core.adjoint(&b, x.as_slice_mut().unwrap_or_default());
            Ok(x)
        })?;
        Ok(picture_to_python(py, x))
    }
}

/// The samples of a picture of the given shape, by rows.
fn packed(
    argument: &'static str,
    picture: &ArrayView2<'_, f32>,
    shape: (usize, usize),
) -> Result<Vec<f32>> {
    if picture.dim() != shape {
        return Err(Error::shape(argument, format!("{shape:?}"), picture.shape()));
    }
    Ok(picture.iter().copied().collect())
}
