//! Phase-based optical flow and pixel-by-pixel removal of motion blur.
//!
//! The modules in pipeline order; each uses only those above it.
//!
//! | module | concept |
//! |---|---|
//! | [`error`], [`real`], [`border`], [`control`] | failures, scalars, picture edges, cancellation |
//! | [`flow_field`] | a field of motion |
//!
//! Conventions: row-major frames (T, H, W); x to the right, y downwards; flow in px/frame; NaN = unknown; spatial
//! frequencies in cycles/px in parameters and rad/px inside.
#![deny(unsafe_code)]

mod array;
pub mod border;
pub mod component_velocity;
pub mod control;
pub mod convolve;
pub mod error;
pub mod fft_convolve;
pub mod flow;
pub mod flow_field;
pub mod fourier;
pub mod gabor;
pub mod immerkaer_noise;
pub mod interpolate;
pub mod median;
pub mod metrics;
pub mod phase_gradient;
pub mod pyramid;
pub mod real;
pub mod sor;
pub mod spatiotemporal;
mod spline_filter;
pub mod weighted_median;

pub use border::Border;
pub use control::Control;
pub use convolve::{correlate_axis, correlate_separable, gaussian_taps};
pub use error::{Error, Result};
pub use flow_field::{FlowField, FlowView};
pub use real::Real;
