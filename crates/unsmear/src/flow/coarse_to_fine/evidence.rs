//! How far to trust a flow, and where there was nothing to go on.
//!
//! Confidence compares the responses once more, after the last warp:
//!
//! ```text
//! coherence  = G_1.5 * [ sum_j Re(conj(R_0) R_1) / (sum_j (a_0^2 + a_1^2)/2 + r^2) ]   in [-1, 1]
//! confidence = max(coherence, 0) exp(-2 G_2 * |grad (u, v)|)
//! ```
//!
//! `G_s *` a Gaussian average of deviation s px, `r` the amplitude floor, in [0, 1]. It falls where
//! the frames do not match (occlusion, wrong motion), where there is no texture, and at motion
//! boundaries, where errors gather.
//!
//! *Evidence* is the trace of the data term, the largest over the levels of its average over
//! [`REACH`] px of the level: below [`LEAST_EVIDENCE`] no filter that looked here saw anything and
//! the flow is only what its surroundings suggest. It is about 1 on texture, 1e-2 where the picture
//! is smooth, and 0 where it is flat.

use ndarray::{Array2, Zip};

use crate::array::{for_each_row, for_each_row_with};
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::gabor::Responses;
use crate::pyramid::{Resampling, resample, smooth};

/// Deviation of the average of the evidence, px of the level.
pub(super) const REACH: f64 = 2.0;
/// Trace of the data term below which the flow is unknown.
pub(super) const LEAST_EVIDENCE: f32 = 1e-3;
/// Deviation of the average of the coherence, px.
const COHERENCE_SIGMA: f64 = 1.5;
/// Deviation of the average of the flow's gradient, px.
const GRADIENT_SIGMA: f64 = 2.0;
/// Loss of confidence per px/frame per px.
const GRADIENT_LOSS: f32 = 2.0;

/// Adds one frame's coherence to `sum`, times `share`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn add_coherence(
    responses: [&Responses<f32>; 2],
    visible: &[f32],
    floor: f32,
    share: f32,
    sum: &mut Array2<f32>,
    control: &Control,
) -> Result<()> {
    let (filters, _, width) = responses[0].dim();
    let samples = sum.as_slice_mut().unwrap_or_default();
    let scratch = || (vec![0.0f32; width], vec![0.0f32; width]);
    for_each_row_with(samples, width, control, scratch, |y, out, (alike, power)| {
        alike.fill(0.0);
        power.fill(0.0);
        for j in 0..filters {
            let [(a, b), (c, d)] = responses.map(|r| r.row(j, y));
            for x in 0..width {
                alike[x] += a[x] * c[x] + b[x] * d[x];
                power[x] += 0.5 * (a[x] * a[x] + b[x] * b[x] + c[x] * c[x] + d[x] * d[x]);
            }
        }
        let seen = &visible[y * width..(y + 1) * width];
        for x in 0..width {
            out[x] += share * seen[x] * alike[x] / (power[x] + floor);
        }
    })
}

/// Confidence from the coherence and the flow.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn confidence(
    coherence: &Array2<f32>,
    flow: &FlowField<f32>,
    control: &Control,
) -> Result<Array2<f32>> {
    let coherence = smooth(coherence.view(), COHERENCE_SIGMA, control)?;
    let steep = steepness(flow, control)?;
    let steep = smooth(steep.view(), GRADIENT_SIGMA, control)?;
    Ok(Zip::from(&coherence)
        .and(&steep)
        .map_collect(|c, s| c.clamp(0.0, 1.0) * (-GRADIENT_LOSS * s).exp()))
}

/// `|grad (u, v)|` by central differences, one-sided at the edge.
fn steepness(flow: &FlowField<f32>, control: &Control) -> Result<Array2<f32>> {
    let (height, width) = flow.dim();
    let planes = [&flow.u, &flow.v].map(|plane| plane.as_slice().unwrap_or_default());
    let span = |i: usize, n: usize| (i.saturating_sub(1), (i + 1).min(n - 1));
    let mut out = Array2::zeros((height, width));
    for_each_row(out.as_slice_mut().unwrap_or_default(), width, control, |y, out| {
        let (y0, y1) = span(y, height);
        let down = 1.0 / (y1 - y0).max(1) as f32;
        for plane in planes {
            let row = |y: usize| &plane[y * width..(y + 1) * width];
            let (above, here, below) = (row(y0), row(y), row(y1));
            for (x, out) in out.iter_mut().enumerate() {
                let (x0, x1) = span(x, width);
                let gx = (here[x1] - here[x0]) / (x1 - x0).max(1) as f32;
                let gy = (below[x] - above[x]) * down;
                *out += gx * gx + gy * gy;
            }
        }
        out.iter_mut().for_each(|square: &mut f32| *square = square.sqrt());
    })?;
    Ok(out)
}

/// The greater of the evidence of the coarser levels and of this level's trace of the data term.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn gather(
    coarser: Option<Array2<f32>>,
    trace: &Array2<f32>,
    control: &Control,
) -> Result<Array2<f32>> {
    let here = smooth(trace.view(), REACH, control)?;
    let Some(coarser) = coarser else { return Ok(here) };
    let coarser = resample(coarser.view(), here.dim(), Resampling::Linear, control)?;
    Ok(Zip::from(&here).and(&coarser).map_collect(|a, b| a.max(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn responses(value: f32) -> Responses<f32> {
        let mut responses = Responses::zeros(2, 24, 24);
        for (y, j) in (0..24).flat_map(|y| [(y, 0), (y, 1)]) {
            responses.row_mut(j, y).1.fill(value);
        }
        responses
    }

    fn coherence(one: f32, other: f32) -> Array2<f32> {
        let mut sum = Array2::zeros((24, 24));
        let pair = [&responses(one), &responses(other)];
        add_coherence(pair, &[1.0; 576], 2.0, 1.0, &mut sum, &Control::new()).unwrap();
        sum
    }

    #[test]
    fn equal_responses_are_coherent_and_opposite_ones_are_not() {
        // Two filters of amplitude 3: 18/(18 + 2).
        assert!(coherence(3.0, 3.0).iter().all(|c| (c - 0.9).abs() < 1e-6));
        assert!(coherence(3.0, -3.0).iter().all(|c| (c + 0.9).abs() < 1e-6));
        let flow = FlowField { u: Array2::zeros((24, 24)), v: Array2::zeros((24, 24)) };
        let trust = |c: Array2<f32>| confidence(&c, &flow, &Control::new()).unwrap()[(12, 12)];
        assert!((trust(coherence(3.0, 3.0)) - 0.9).abs() < 1e-5);
        assert_eq!(trust(coherence(3.0, -3.0)), 0.0);
    }

    #[test]
    fn confidence_falls_where_the_flow_changes() {
        let u = Array2::from_shape_fn((24, 24), |(_, x)| 0.3 * x as f32);
        let v = Array2::from_shape_fn((24, 24), |(y, _)| 0.4 * y as f32);
        let sheared = FlowField { u, v };
        let trust = confidence(&Array2::ones((24, 24)), &sheared, &Control::new()).unwrap();
        // |grad| = 0.5 everywhere: exp(-1).
        assert!(trust.iter().all(|c| (c - (-1.0f32).exp()).abs() < 1e-4));
    }

    #[test]
    fn evidence_of_any_level_counts() {
        let coarse = Array2::from_shape_fn((6, 6), |(_, x)| if x < 3 { 1.0 } else { 0.0 });
        let both = gather(Some(coarse), &Array2::zeros((12, 12)), &Control::new()).unwrap();
        assert_eq!((both[(6, 0)], both[(6, 11)]), (1.0, 0.0));
    }
}
