//! Removal of known motion blur, pixel by pixel; one method per file.
//!
//! | method | file | what it is |
//! |---|---|---|
//! | [`TotalVariation`] | `total_variation.rs` | the default: exact operator, edge-keeping prior, strength from the noise |
//! | [`Tikhonov`] | `tikhonov.rs` | the same operator with a quadratic prior |
//! | [`RichardsonLucy`] | `richardson_lucy.rs` | the likeliest non-negative picture under Poisson noise |
//! | [`WienerDeblur`] | `wiener.rs` | the best finite inverse of each pixel's own blur, along its streamline |
//! | [`ThesisDeblur`] | `thesis.rs` | the founding method exactly; for reference, it makes pictures worse |
//!
//! [`MotionDeblur`] runs the first three on a picture of any type; [`Variational`] solves for several [`Datum`] of one
//! unknown. All take the flow as the velocity at the middle of the exposure, in px/frame, NaN where unknown. A displacement
//! from one frame to the next is that velocity where motion is uniform; in a field that turns by an angle a within a
//! frame it deviates by a/2 in direction.

mod conjugate_gradient;
mod datum;
mod detail;
mod grey_levels;
mod half_size;
mod inverse_kernel;
mod look;
mod motion_deblur;
mod occlusion;
mod preparation;
mod richardson_lucy;
mod smoothness;
mod structure;
mod thesis;
mod tikhonov;
mod total_variation;
mod variational;
mod vectors;
mod wiener;

pub use datum::Datum;
pub use inverse_kernel::{COPIED_BLUR, LONGEST_BLUR};
pub use look::Look;
pub use motion_deblur::{Blurred, MotionDeblur, MotionMethod, MotionResult};
pub use occlusion::occlusion_weights;
pub use richardson_lucy::RichardsonLucy;
pub use structure::{Power, Prior};
pub use thesis::{ThesisDeblur, ThesisResult};
pub use tikhonov::Tikhonov;
pub use total_variation::{Effort, Restored, TotalVariation};
pub use variational::{Solution, Variational};
pub use wiener::{WienerDeblur, WienerResult};
