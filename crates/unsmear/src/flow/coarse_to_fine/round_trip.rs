//! There and back: a check of the flow by that of the reversed frames.
//!
//! What moves by `w` to the next frame comes back by the flow `w_b` of that frame to this one,
//!
//! ```text
//! d(p) = |w(p) + w_b(p + w(p))|   px,      confidence <- confidence exp(-3 d)
//! ```
//!
//! unless it is hidden in between or one of the two is wrong. `w_b` is interpolated linearly; where it
//! is unknown or `p + w` outside the picture, nothing comes back: `d = 1 px`.
//!
//! Reference: N. Sundaram, T. Brox, K. Keutzer 2010 (doi 10.1007/978-3-642-15549-9_32).

use ndarray::Array2;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::flow::Estimate;
use crate::flow_field::FlowField;

/// Loss of confidence per px.
const LOSS: f32 = 3.0;
/// Distance where nothing comes back, px.
const LOST: f32 = 1.0;

/// Lowers the confidence of `there` where `back` does not lead back.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn check_round_trip(
    there: &mut Estimate<f32>,
    back: &FlowField<f32>,
    control: &Control,
) -> Result<()> {
    let Estimate { flow, confidence } = there;
    let width = confidence.ncols();
    let samples = confidence.as_slice_mut().unwrap_or_default();
    for_each_row(samples, width, control, |y, row| {
        for (x, confidence) in row.iter_mut().enumerate() {
            let (u, v) = (flow.u[(y, x)], flow.v[(y, x)]);
            let (to_y, to_x) = (y as f32 + v, x as f32 + u);
            let returned = [&back.u, &back.v].map(|plane| between(plane, to_y, to_x));
            let distance = match returned {
                [Some(ub), Some(vb)] => (u + ub).hypot(v + vb),
                _ => LOST,
            };
            *confidence *= (-LOSS * distance).exp();
        }
    })
}

/// The plane between its samples, none outside or where a sample is unknown.
fn between(plane: &Array2<f32>, y: f32, x: f32) -> Option<f32> {
    let (bottom, right) = (plane.nrows() - 1, plane.ncols() - 1);
    let inside = y >= 0.0 && x >= 0.0 && y <= bottom as f32 && x <= right as f32;
    if !inside {
        return None;
    }
    let (top, left) = (y as usize, x as usize);
    let (fy, fx) = (y - top as f32, x - left as f32);
    let (below, after) = ((top + 1).min(bottom), (left + 1).min(right));
    let mix = |row: usize| (1.0 - fx) * plane[(row, left)] + fx * plane[(row, after)];
    let value = (1.0 - fy) * mix(top) + fy * mix(below);
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(u: f32) -> FlowField<f32> {
        FlowField { u: Array2::from_elem((6, 10), u), v: Array2::zeros((6, 10)) }
    }

    fn after(u: f32, back: &FlowField<f32>) -> Array2<f32> {
        let mut there = Estimate { flow: constant(u), confidence: Array2::ones((6, 10)) };
        check_round_trip(&mut there, back, &Control::new()).unwrap();
        there.confidence
    }

    #[test]
    fn what_comes_back_is_believed() {
        let there_and_back = after(1.5, &constant(-1.5));
        assert!((0..8).all(|x| there_and_back[(2, x)] == 1.0));
        // Half a pixel off: exp(-1.5). Beyond the last column nothing comes back: exp(-3).
        let off = after(1.5, &constant(-1.0));
        assert!((off[(2, 4)] - (-1.5f32).exp()).abs() < 1e-6);
        assert!((off[(2, 9)] - (-3.0f32).exp()).abs() < 1e-6);
        let unknown = after(1.0, &constant(f32::NAN));
        assert!((unknown[(2, 4)] - (-3.0f32).exp()).abs() < 1e-6);
    }
}
