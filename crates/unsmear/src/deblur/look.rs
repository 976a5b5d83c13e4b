//! A recorded picture and the paths of its light, from which operators and data are made.

use ndarray::{Array2, ArrayView2};

use super::datum::Datum;
use crate::error::Result;
use crate::motion_operator::{MotionOperator, Taps};
use crate::motion_path::MotionPaths;

/// One recorded picture, in grey levels, and the paths of its light.
#[derive(Debug, Clone)]
pub struct Look<'a> {
    /// Paths of all pixels; all looks have one shape.
    pub paths: MotionPaths,
    /// Channels; NaN = unknown.
    pub planes: Vec<ArrayView2<'a, f32>>,
    /// How far each sample is believed, in [0, 1]; 0 for unknown samples and unknown motion.
    pub weights: Array2<f32>,
    /// Least value of a clipped sample, grey levels; None: none is clipped.
    pub ceiling: Option<f32>,
}

/// The operators of all looks, padded alike.
pub(super) fn operators(looks: &[Look<'_>], taps: Taps) -> Result<(Vec<MotionOperator>, usize)> {
    let pad = looks.iter().map(|look| look.paths.reach()).max().unwrap_or_default();
    let operator = |look: &Look<'_>| MotionOperator::new(&look.paths, taps, pad);
    Ok((looks.iter().map(operator).collect::<Result<_>>()?, pad))
}

/// The data of all looks.
pub(super) fn data<'a>(
    looks: &[Look<'_>],
    operators: &'a [MotionOperator],
) -> Result<Vec<Datum<'a>>> {
    let datum = |(look, operator): (&Look<'_>, &'a MotionOperator)| {
        let datum = Datum::new(operator, &look.planes, Some(look.weights.view()))?;
        Ok(datum.with_ceiling(look.ceiling.unwrap_or(f32::INFINITY)))
    };
    looks.iter().zip(operators).map(datum).collect()
}
