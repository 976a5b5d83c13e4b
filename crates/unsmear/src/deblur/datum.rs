//! What was recorded of one unknown picture: an operator, its data, and how far each pixel is to be believed.

use ndarray::ArrayView2;

use crate::array::require_same;
use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;

/// One recorded picture b = A x + noise, of one or several channels that share A and the weights.
///
/// Several data with one unknown shape are several looks at the same picture.
pub struct Datum<'a> {
    operator: &'a dyn LinearOperator,
    planes: Vec<Vec<f32>>,
    weights: Vec<f32>,
}

impl<'a> Datum<'a> {
    /// Channels `planes` (grey levels, each of the operator's data shape) and `weights` in [0, 1] (None: 1).
    /// Samples that are unknown (NaN or infinite in any channel) weigh nothing.
    ///
    /// # Errors
    /// [`Error::Shape`] when a shape is not the operator's; [`Error::Value`] without channels or for weights outside
    /// [0, 1].
    pub fn new(
        operator: &'a dyn LinearOperator,
        planes: &[ArrayView2<'_, f32>],
        weights: Option<ArrayView2<'_, f32>>,
    ) -> Result<Self> {
        let shape = operator.data_shape();
        if planes.is_empty() {
            return Err(Error::value("planes", "at least one channel", 0));
        }
        planes.iter().try_for_each(|plane| require_same("planes", plane, shape))?;
        let mut weights: Vec<f32> = match weights {
            Some(weights) => {
                require_same("weights", &weights, shape)?;
                weights.iter().copied().collect()
            }
            None => vec![1.0; shape.0 * shape.1],
        };
        if let Some(bad) = weights.iter().find(|w| !(0.0..=1.0).contains(*w)) {
            return Err(Error::value("weights", "in [0, 1]", bad));
        }
        let mut planes: Vec<Vec<f32>> =
            planes.iter().map(|plane| plane.iter().copied().collect()).collect();
        for (i, weight) in weights.iter_mut().enumerate() {
            if planes.iter().any(|plane| !plane[i].is_finite()) {
                *weight = 0.0;
                planes.iter_mut().for_each(|plane| plane[i] = 0.0);
            }
        }
        Ok(Self { operator, planes, weights })
    }

    /// The operator A.
    #[must_use]
    pub fn operator(&self) -> &'a dyn LinearOperator {
        self.operator
    }

    /// The channels, packed rows of the data shape; 0 where unknown.
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }

    /// The weights, packed; 0 where unknown.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }
}
