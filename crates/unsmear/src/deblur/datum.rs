//! What was recorded of one unknown picture: an operator, its data, and how far each pixel is to be believed.

use ndarray::ArrayView2;

use crate::array::require_same;
use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;

/// Pixels at the edge of the data that do not count in the residual: there the padding can explain anything.
const MARGIN: usize = 8;

/// One recorded picture b = A x + noise, of one or several channels that share A and the weights.
///
/// Several data with one unknown shape are several looks at the same picture.
pub struct Datum<'a> {
    operator: &'a dyn LinearOperator,
    planes: Vec<Vec<f32>>,
    weights: Vec<f32>,
    ceiling: f32,
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
        Ok(Self { operator, planes, weights, ceiling: f32::INFINITY })
    }

    /// Samples of at least `ceiling` were clipped: there the picture is that bright or brighter.
    #[must_use]
    pub fn with_ceiling(self, ceiling: f32) -> Self {
        Self { ceiling, ..self }
    }

    /// Least value of a clipped sample; infinite when there are none.
    #[must_use]
    pub fn ceiling(&self) -> f32 {
        self.ceiling
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

/// The shape of the unknown that all looks share.
///
/// # Errors
/// [`Error::Value`] when there is none, or they differ in it or in their number of channels.
pub(super) fn check_looks(data: &[Datum<'_>]) -> Result<(usize, usize)> {
    let Some(first) = data.first() else {
        return Err(Error::value("data", "at least one datum", 0));
    };
    let (shape, channels) = (first.operator().unknown_shape(), first.planes().len());
    if data.iter().any(|d| d.operator().unknown_shape() != shape) {
        return Err(Error::value("data", "operators with one unknown shape", "several"));
    }
    if data.iter().any(|d| d.planes().len() != channels) {
        return Err(Error::value("data", "looks of the same number of channels", "others"));
    }
    Ok(shape)
}

/// The data of a look continued over the padding by their edge samples; unknown samples take the last known of their row.
pub(super) fn first_guess(datum: &Datum<'_>) -> Vec<Vec<f32>> {
    let operator = datum.operator();
    let ((rows, columns), pad) = (operator.unknown_shape(), operator.pad());
    let (height, width) = operator.data_shape();
    let guess = |plane: &Vec<f32>| {
        let mut out = Vec::with_capacity(rows * columns);
        let mut line = vec![0.0; width];
        for y in 0..rows {
            let from = y.saturating_sub(pad).min(height - 1) * width;
            let weights = &datum.weights()[from..from + width];
            let mut last = weights.iter().position(|&w| w > 0.0).map_or(0.0, |i| plane[from + i]);
            for x in 0..width {
                if weights[x] > 0.0 {
                    last = plane[from + x];
                }
                line[x] = last;
            }
            out.extend((0..columns).map(|x| line[x.saturating_sub(pad).min(width - 1)]));
        }
        out
    };
    datum.planes().iter().map(guess).collect()
}

/// Root mean square of A x - b over the believed samples, clipped ones apart, inside a margin; NaN if there are none.
pub(super) fn residual_rms(data: &[Datum<'_>], channels: &[Vec<f32>], blurred: &mut [f32]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for datum in data {
        let (height, width) = datum.operator().data_shape();
        let margin = MARGIN.min((height.min(width).saturating_sub(1)) / 2);
        let blurred = &mut blurred[..height * width];
        for (x, plane) in channels.iter().zip(datum.planes()) {
            datum.operator().apply(x, blurred);
            for y in margin..height - margin {
                let inside = y * width + margin..(y + 1) * width - margin;
                let weights = &datum.weights()[inside.clone()];
                let samples = blurred[inside.clone()].iter().zip(&plane[inside]).zip(weights);
                for ((a, &b), &w) in samples.filter(|((_, b), _)| **b < datum.ceiling) {
                    sum += f64::from(w) * f64::from(a - b).powi(2);
                    count += f64::from(w);
                }
            }
        }
    }
    (sum / count).sqrt()
}
