//! Phase-based optical flow and pixel-by-pixel removal of motion blur.
//!
//! The modules in pipeline order; each uses only modules of lower rank.
//!
//! | rank | modules | concept |
//! |---|---|---|
//! | 0 | [`error`], [`real`] | failures; `f32` and `f64` |
//! | 1 | [`border`], [`control`], [`flow_field`], `tasks` | picture edges; cancellation; a field of motion; work shared among threads |
//! | 2 | `array`, `awake`, [`fourier`] | shape checks, rows in parallel; threads that do not sleep; planned transforms |
//! | 3 | [`convolve`], `even_odd`, [`fft_convolve`] | separable correlation; pairs of filters; convolution with large kernels |
//! | 4 | `gabor::parameters`, `gabor::responses`, `gabor::taps`, [`phase_rate`] | parts of the bank; rates of phase |
//! | 4 | `smoothing`, `spline_filter`, `spline_values`, [`median`], [`immerkaer_noise`] | Gaussian; splines; median; noise |
//! | 4 | `sor::system`, `weighted_median::middle`, `weighted_median::parameters` | parts of the two below |
//! | 5 | `sor::layout`, `weighted_median::window` | |
//! | 6 | `sor::relax` | |
//! | 7 | [`sor`], [`weighted_median`] | solver of the default flow; median with weights |
//! | 5 | `halving` | half the size |
//! | 6 | [`pyramid`] | sizes of pictures |
//! | 5 | [`gabor`], [`interpolate`] | filters tuned to a wavevector, complex responses; pictures between pixels, warping |
//! | 6 | `gabor::stream` | its passes, row by row |
//! | 7 | `gabor::respond` | a whole picture |
//! | 6 | `demodulation`, [`spatiotemporal`], [`component_tests`] | derivative of responses; filters in space and time; what to believe |
//! | 7 | [`phase_gradient`] | phase in space |
//! | 8 | [`component_velocity`] | what one filter sees of the motion |
//! | 8 | `flow::coarse_to_fine::response_pair` | rows of responses to two frames |
//! | 8 | [`flow`], [`flow::thesis::bank`], `flow::coarse_to_fine::recorded`, `flow::coarse_to_fine::exponential`, `flow::coarse_to_fine::rows` | an estimate of flow, with confidence; the founding filters; frames as they come; parts of the default flow |
//! | 9 | `flow::affine`, `flow::constraint`, `flow::normal_equations`, [`flow::standardize`] | parts of the flow methods |
//! | 9 | `flow::coarse_to_fine::arctangent`, `flow::coarse_to_fine::parameters`, `flow::coarse_to_fine::contrast`, `flow::coarse_to_fine::slope`, `flow::coarse_to_fine::known`, `flow::coarse_to_fine::guide`, `flow::coarse_to_fine::evidence`, `flow::coarse_to_fine::visible`, `flow::coarse_to_fine::lighting` | parts of the default flow |
//! | 10 | `flow::coarse_to_fine::relight`, `flow::coarse_to_fine::phase_constraint`, `flow::coarse_to_fine::look`, `flow::coarse_to_fine::boundary`, `flow::coarse_to_fine::diffusivity` | |
//! | 11 | `flow::coarse_to_fine::constraints`, `flow::coarse_to_fine::choice`, `flow::coarse_to_fine::still`, `flow::coarse_to_fine::confidence`, `flow::coarse_to_fine::round_trip` | |
//! | 12 | `flow::coarse_to_fine::data_term`, `flow::coarse_to_fine::precision` | |
//! | 13 | `flow::coarse_to_fine::level` | one scale |
//! | 14 | `flow::coarse_to_fine::refine`, `flow::coarse_to_fine::frames`, `flow::coarse_to_fine::noise_rule` | |
//! | 15 | `flow::coarse_to_fine::schedule` | from coarse to fine |
//! | 16 | [`flow::coarse_to_fine`] | the default flow |
//! | 9 | [`flow::thesis::components`], [`flow::thesis::gated_mean`], [`flow::thesis::pruned`] | parts of the founding method |
//! | 10 | [`flow::least_squares`], [`flow::fleet_jepson`], [`flow::thesis`] | the flow methods |
//! | 11 | [`psf`], `streamline`, `local_spline`, [`noise`] | kernels and paths of motion; sampling; noise |
//! | 12 | [`blur`] | the forward operator |
//! | 11 | `exposure::waves` | parts of the search for the exposure |
//! | 12 | `exposure::frame`, `exposure::path_spectrum`, `exposure::random`, `exposure::scene` | |
//! | 13 | `exposure::tile`, `exposure::vote` | |
//! | 14 | `exposure::tile_choice`, `exposure::likelihood` | |
//! | 15 | `exposure::tile_likelihoods` | |
//! | 16 | `exposure::short_blur` | |
//! | 17 | `exposure::search` | |
//! | 18 | `exposure::direction` | |
//! | 19 | [`exposure`] | how long the shutter was open |
//! | 3 | [`linear_operator`] | a blur and its transpose, as solvers see it |
//! | 3 | `motion_operator::lanes`, `motion_operator::bands`, `motion_operator::spline_inverse`, `deblur::vectors` | arithmetic of pixels side by side, of pictures as vectors |
//! | 4 | `motion_operator::record`, `motion_operator::strands`, `motion_operator::stencil` | |
//! | 5 | `motion_operator::group`, `motion_operator::kept_stencils` | |
//! | 6 | `motion_operator::scatter` | |
//! | 12 | [`motion_path`], [`kernel_operator`] | paths; one kernel for the whole picture |
//! | 13 | `motion_operator::plan`, `motion_operator::short_paths` | |
//! | 14 | `motion_operator::expand` | |
//! | 15 | `motion_operator::sweep` | |
//! | 16 | [`motion_operator`] | blur along the path of every pixel |
//! | 13 | `deblur::inverse_kernel`, `deblur::detail`, `deblur::smoothness`, `deblur::half_size`, `deblur::grey_levels`, `deblur::occlusion`, `deblur::datum` | parts of the deblurring methods |
//! | 14 | `deblur::wiener`, `deblur::thesis` | two of the methods |
//! | 14 | `deblur::conjugate_gradient`, `deblur::structure`, `deblur::preparation` | |
//! | 15 | `deblur::variational` | data and prior, reweighted |
//! | 17 | `deblur::look` | |
//! | 18 | `deblur::total_variation` | the default method |
//! | 19 | `deblur::tikhonov`, `deblur::richardson_lucy` | |
//! | 20 | `deblur::motion_deblur` | any of these three on one picture |
//! | 21 | [`deblur`] | their names |
//! | 22 | `restoration::frame_motion`, `restoration::regions`, `restoration::walk` | parts of the restoration of clips |
//! | 23 | [`restoration`] | their names |
//! | 22 | [`metrics`] | how far an estimate is from the truth |
//!
//! Conventions: row-major frames (T, H, W); x to the right, y downwards; flow in px/frame; NaN = unknown; spatial
//! frequencies in cycles/px in parameters and rad/px inside.
#![deny(unsafe_code)]

mod array;
mod awake;
pub mod blur;
pub mod border;
pub mod component_tests;
pub mod component_velocity;
pub mod control;
pub mod convolve;
pub mod deblur;
mod demodulation;
pub mod error;
mod even_odd;
pub mod exposure;
pub mod fft_convolve;
pub mod flow;
pub mod flow_field;
pub mod fourier;
pub mod gabor;
mod halving;
pub mod immerkaer_noise;
pub mod interpolate;
pub mod kernel_operator;
pub mod linear_operator;
mod local_spline;
pub mod median;
pub mod metrics;
pub mod motion_operator;
pub mod motion_path;
pub mod noise;
pub mod phase_gradient;
pub mod phase_rate;
pub mod psf;
pub mod pyramid;
pub mod real;
pub mod restoration;
mod smoothing;
pub mod sor;
pub mod spatiotemporal;
mod spline_filter;
mod spline_values;
mod streamline;
mod tasks;
pub mod weighted_median;

pub use border::Border;
pub use control::Control;
pub use convolve::{correlate_axis, correlate_separable, gaussian_taps};
pub use error::{Error, Result};
pub use flow_field::{FlowField, FlowView};
pub use interpolate::{SplineDegree, SplineImage};
pub use linear_operator::LinearOperator;
pub use real::Real;
