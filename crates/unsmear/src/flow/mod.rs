//! Optical flow: one method per module.

pub mod thesis;
