//! Removal of known motion blur, pixel by pixel; one method per file.
//!
//! | method | file | what it is |
//! |---|---|---|
//! | [`WienerDeblur`] | `wiener.rs` | the best finite inverse of each pixel's own blur, along its streamline |
//! | [`ThesisDeblur`] | `thesis.rs` | the founding method exactly; for reference, it makes pictures worse |
//!
//! Both take the flow as the velocity at the middle of the exposure, in px/frame, NaN where unknown. A displacement
//! from one frame to the next is that velocity where motion is uniform; in a field that turns by an angle a within a
//! frame it deviates by a/2 in direction.

mod detail;
mod inverse_kernel;
mod thesis;
mod wiener;

pub use inverse_kernel::{COPIED_BLUR, LONGEST_BLUR};
pub use thesis::{ThesisDeblur, ThesisResult};
pub use wiener::{WienerDeblur, WienerResult};
