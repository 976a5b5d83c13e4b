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
pub(super) fn add_coherence(
    reference: &Responses<f32>,
    warped: &Responses<f32>,
    visible: &[f32],
    floor: f32,
    share: f32,
    sum: &mut Array2<f32>,
) {
    let (filters, height, width) = reference.dim();
    for (y, mut out) in sum.rows_mut().into_iter().enumerate().take(height) {
        let (mut alike, mut power) = (vec![0.0; width], vec![0.0; width]);
        for j in 0..filters {
            let ((a, b), (c, d)) = (reference.row(j, y), warped.row(j, y));
            for x in 0..width {
                alike[x] += a[x] * c[x] + b[x] * d[x];
                power[x] += 0.5 * (a[x] * a[x] + b[x] * b[x] + c[x] * c[x] + d[x] * d[x]);
            }
        }
        for x in 0..width {
            out[x] += share * visible[y * width + x] * alike[x] / (power[x] + floor);
        }
    }
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
    let steep =
        Array2::from_shape_fn(flow.dim(), |at| (slope(&flow.u, at) + slope(&flow.v, at)).sqrt());
    let steep = smooth(steep.view(), GRADIENT_SIGMA, control)?;
    Ok(Zip::from(&coherence)
        .and(&steep)
        .map_collect(|c, s| c.clamp(0.0, 1.0) * (-GRADIENT_LOSS * s).exp()))
}

/// `|grad|^2` by central differences, one-sided at the edge.
fn slope(plane: &Array2<f32>, (y, x): (usize, usize)) -> f32 {
    let (height, width) = plane.dim();
    let span = |i: usize, n: usize| (i.saturating_sub(1), (i + 1).min(n - 1));
    let ((y0, y1), (x0, x1)) = (span(y, height), span(x, width));
    let gx = (plane[(y, x1)] - plane[(y, x0)]) / (x1 - x0).max(1) as f32;
    let gy = (plane[(y1, x)] - plane[(y0, x)]) / (y1 - y0).max(1) as f32;
    gx * gx + gy * gy
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
