//! Recorded pictures of one unknown, restored and predicted, for Python. Planes are grey levels (C, H, W), fields (H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{Array3, ArrayView3};
use numpy::{IntoPyArray, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::linear_operator::LinearOperator;
use unsmear::motion_operator::{MotionOperator, Taps};
use unsmear::motion_path::MotionPaths;
use unsmear::restoration::Walk;
use unsmear::{Control, Error, Result};

use crate::errors::to_python;
use crate::restoration::{Field, Planes, owned};
use crate::threads::run;

/// One recorded picture and the paths of its light.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Look<'py> {
    planes: PyReadonlyArray3<'py, f32>,
    weights: PyReadonlyArray2<'py, f32>,
    velocity: Field<'py>,
    acceleration: Field<'py>,
    offset: Option<Field<'py>>,
    exposure: f64,
    ceiling: Option<f32>,
    taps: String,
}

impl Look<'_> {
    fn taps(&self) -> Result<Taps> {
        match self.taps.as_str() {
            "cubic" => Ok(Taps::Cubic),
            "spline" => Ok(Taps::Spline),
            other => Err(Error::value("taps", "\"cubic\" or \"spline\"", format!("{other:?}"))),
        }
    }

    fn paths(&self) -> Result<MotionPaths> {
        let (velocity, acceleration) = (owned(&self.velocity)?, owned(&self.acceleration)?);
        let paths =
            MotionPaths::from_content_acceleration(&velocity, self.exposure, &acceleration)?;
        match &self.offset {
            Some(offset) => paths.with_offset(owned(offset)?),
            None => Ok(paths),
        }
    }
}

fn packed(shape: (usize, usize), channels: Vec<Vec<f32>>) -> Result<Array3<f32>> {
    let count = channels.len();
    Array3::from_shape_vec((count, shape.0, shape.1), channels.concat())
        .map_err(|_| Error::value("start", "channels of the unknown's shape", count))
}

/// The taps of all looks.
fn one_kind_of_taps(looks: &[Look<'_>]) -> Result<Taps> {
    let every = looks.iter().map(Look::taps).collect::<Result<Vec<_>>>()?;
    match every.first() {
        Some(&first) if every.iter().all(|&taps| taps == first) => Ok(first),
        _ => Err(Error::value(
            "looks",
            "at least one, all of one kind of taps",
            format!("{every:?}"),
        )),
    }
}

/// Padding that the paths of all looks need, px.
#[pyfunction]
pub(crate) fn looks_reach(looks: Vec<Look<'_>>) -> PyResult<usize> {
    let reaches = looks.iter().map(|look| Ok(look.paths()?.reach())).collect::<Result<Vec<_>>>();
    Ok(reaches.map_err(|e| to_python(&e))?.into_iter().max().unwrap_or(0))
}

/// The picture that all `looks` show, for each of `lambdas`, padded by `pad`; and the residuals.
#[pyfunction]
#[pyo3(signature = (looks, pad, lambdas, noise, robust, first, following, sharp=false, start=None, progress=None))]
pub(crate) fn restore_looks<'py>(
    py: Python<'py>,
    looks: Vec<Look<'py>>,
    pad: usize,
    lambdas: Vec<f64>,
    noise: f64,
    robust: f64,
    first: (usize, usize),
    following: (usize, usize),
    sharp: bool,
    start: Option<PyReadonlyArray3<'py, f32>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Vec<Planes<'py>>, Vec<f64>)> {
    let paths = looks.iter().map(Look::paths).collect::<Result<Vec<_>>>();
    let paths = paths.map_err(|e| to_python(&e))?;
    let taps = one_kind_of_taps(&looks).map_err(|e| to_python(&e))?;
    let walk = Walk { lambdas, noise, robust, sharp, taps, first, next: following };
    let recorded: Vec<ArrayView3<'_, f32>> =
        looks.iter().map(|look| look.planes.as_array()).collect();
    let pictures: Vec<_> = looks
        .iter()
        .zip(paths)
        .zip(&recorded)
        .map(|((look, paths), planes)| unsmear::deblur::Look {
            paths,
            planes: planes.outer_iter().collect(),
            weights: look.weights.as_array().to_owned(),
            ceiling: look.ceiling,
        })
        .collect();
    let start = start.as_ref().map(|start| {
        start.as_array().outer_iter().map(|plane| plane.iter().copied().collect()).collect()
    });
    let solutions = run(py, progress, |control: &Control| {
        let (height, width) = pictures.first().map_or((0, 0), |look| look.paths.dim());
        let shape = (height + 2 * pad, width + 2 * pad);
        let solutions = walk.restore(&pictures, pad, start, control)?;
        let unpacked = solutions
            .into_iter()
            .map(|solution| Ok((packed(shape, solution.channels)?, solution.residual)));
        unpacked.collect::<Result<Vec<_>>>()
    })?;
    let (pictures, residuals): (Vec<_>, Vec<_>) = solutions.into_iter().unzip();
    Ok((pictures.into_iter().map(|picture| picture.into_pyarray(py)).collect(), residuals))
}

/// What a look would have recorded of the padded picture `x` (C, H + 2 pad, W + 2 pad).
#[pyfunction]
pub(crate) fn record_look<'py>(
    py: Python<'py>,
    look: Look<'py>,
    x: PyReadonlyArray3<'py, f32>,
    pad: usize,
) -> PyResult<Planes<'py>> {
    let paths = look.paths().map_err(|e| to_python(&e))?;
    let taps = look.taps().map_err(|e| to_python(&e))?;
    let x = x.as_array();
    let recorded = run(py, None, |_: &Control| {
        let operator = MotionOperator::new(&paths, taps, pad)?;
        let shape = operator.unknown_shape();
        let (height, width) = operator.data_shape();
        let channels = x.outer_iter().map(|plane| {
            if plane.dim() != shape {
                return Err(Error::shape("x", format!("{shape:?}"), plane.shape()));
            }
            let plane: Vec<f32> = plane.iter().copied().collect();
            let mut out = vec![0.0; height * width];
            operator.apply(&plane, &mut out);
            Ok(out)
        });
        packed((height, width), channels.collect::<Result<_>>()?)
    })?;
    Ok(recorded.into_pyarray(py))
}
