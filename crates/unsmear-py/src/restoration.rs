//! Parts of the restoration of clips, for Python. Planes are grey levels (C, H, W), fields (H, W, 2).

#![allow(clippy::needless_pass_by_value, reason = "PyO3 extracts arguments by value")]

use ndarray::{Array3, ArrayView3, Axis};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::deblur::occlusion_weights;
use unsmear::linear_operator::LinearOperator;
use unsmear::motion_operator::{MotionOperator, Taps};
use unsmear::motion_path::MotionPaths;
use unsmear::restoration::{self, Walk};
use unsmear::{Control, Error, FlowField, Result};

use crate::arrays::interleaved;
use crate::errors::to_python;
use crate::threads::run;

type Field<'py> = PyReadonlyArray3<'py, f32>;
type Planes<'py> = Bound<'py, PyArray3<f32>>;

fn owned(field: &Field<'_>) -> Result<FlowField<f32>> {
    let field = field.as_array();
    FlowField::new(field.index_axis(Axis(2), 0).to_owned(), field.index_axis(Axis(2), 1).to_owned())
}

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
}

impl Look<'_> {
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
    let walk = Walk { lambdas, noise, robust, sharp, first, next: following };
    let paths = looks.iter().map(Look::paths).collect::<Result<Vec<_>>>();
    let paths = paths.map_err(|e| to_python(&e))?;
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
    let x = x.as_array();
    let recorded = run(py, None, |_: &Control| {
        let operator = MotionOperator::new(&paths, Taps::Cubic, pad)?;
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
