//! Parts of the restoration of clips: motion from flows, restorations of growing strength, moving regions.
//!
//! The order of the steps is that of the Python package's `sequence`; what touches every pixel is here.

mod frame_motion;
mod regions;
mod walk;

pub use frame_motion::{FrameMotion, frame_motion};
pub use regions::{dilated, regions};
pub use walk::Walk;
