//! Optical flow: one method per module.
//!
//! | module | method |
//! |---|---|
//! | [`thesis`] | the founding mean of normal velocities, as published |
//! | [`least_squares`] | phase differences of frame pairs, local least squares, one scale |
//! | [`fleet_jepson`] | velocity-tuned filters over many frames, local affine least squares |
//! | [`coarse_to_fine`] | phase differences over a pyramid, edge-preserving smoothness: the default |

use ndarray::Array2;

use crate::flow_field::FlowField;

pub(crate) mod affine;
pub mod coarse_to_fine;
pub(crate) mod constraint;
pub mod fleet_jepson;
pub mod least_squares;
mod normal_equations;
pub mod standardize;
pub mod thesis;

/// Eigenvalues below this share of their scale are rounding of single precision sums.
pub(crate) const RESULT_FLOOR: f64 = 1e-6;

/// A flow field and how far to trust it.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate<T> {
    /// px/frame; NaN = unknown.
    pub flow: FlowField<T>,
    /// In [0, 1]; 0 where the flow is unknown.
    pub confidence: Array2<T>,
}
