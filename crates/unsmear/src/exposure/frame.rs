//! A blurred picture and the motion that blurred it.

use ndarray::ArrayView2;

use crate::flow_field::FlowView;

/// One blurred picture and what moved in it.
#[derive(Debug, Clone, Copy)]
pub struct ExposureFrame<'a, T> {
    /// The picture (H, W); NaN = unknown.
    pub image: ArrayView2<'a, T>,
    /// Velocity at mid-exposure, px/frame; NaN = unknown.
    pub velocity: FlowView<'a, T>,
    /// q of D(t) = -t V + t^2/2 q at s = 1, px/frame^2; zero for straight, uniform motion.
    pub curvature: FlowView<'a, T>,
}
