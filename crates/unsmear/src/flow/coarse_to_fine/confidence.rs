//! How far to trust a flow.
//!
//! Four signs of trouble, each in [0, 1] and 1 where all is well, are multiplied:
//!
//! ```text
//! coherence    = sqrt(max(0, G_1.5 * [ sum_j Re(conj(R_0) R_1) / (sum_j (a_0^2 + a_1^2)/2 + r^2) ]))
//! smoothness   = exp(-4 G_2 * |grad (u, v)|)
//! agreement    = exp(-5 G_2 * |U - U_c| / px)
//! resolution   = l/(l + 0.03),   l = smaller eigenvalue of G_3 * A
//! ```
//!
//! Coherence compares the responses once more, after the last warp: it falls where the frames do not
//! match (occlusion, wrong motion) and where there is no texture. Errors gather at motion
//! boundaries, where the flow is steep. `U_c` is the flow of the next coarser level, enlarged, in px
//! of the frames: scales that see one motion agree, at boundaries and on ambiguous patterns they do
//! not. `A` is the data term's matrix with pull to rest and precision: `l` is 0 where the picture
//! is flat and on straight edges, whose motion along themselves nobody sees. `G_s *` is a Gaussian
//! average of deviation s px of the level, `r` the amplitude floor.
//!
//! The form and its constants measured best by sparsification on Yosemite, four other scenes with
//! truth and two rotating spheres; halving or doubling a constant costs 1 to 2 % of the mean error.
//! Reference: O. Mac Aodha, A. Humayun, M. Pollefeys, G. J. Brostow 2013 (doi
//! 10.1109/TPAMI.2012.171) compares such signs.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use super::look::Look;
use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::pyramid::smooth;
use crate::tasks::filled_picture;

/// Deviations of the averages of coherence, of the flow's gradient and disagreement, and of `A`, px.
const SIGMA: [f64; 3] = [1.5, 2.0, 3.0];
/// Loss of confidence per px/frame per px.
const GRADIENT_LOSS: f32 = 4.0;
/// Loss of confidence per px of disagreement.
const DISAGREEMENT_LOSS: f32 = 5.0;
/// Eigenvalue that halves confidence.
const RESOLVED: f32 = 0.03;

/// What confidence is made of.
pub(super) struct Clues<'a> {
    pub(super) coherence: &'a Array2<f32>,
    pub(super) flow: &'a FlowField<f32>,
    /// The flow of the coarser level, enlarged; none at the only level.
    pub(super) coarser: Option<&'a FlowField<f32>>,
    /// Ratio of the frames' size to the level's.
    pub(super) zoom: f32,
    /// `a11, a12, a22` of the data term, (H, W) each.
    pub(super) matrix: [&'a [f32]; 3],
}

/// Adds one frame's coherence to `sum`, times `share`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn add_coherence(
    look: &Look<'_>,
    floor: f32,
    share: f32,
    sum: &mut Array2<f32>,
    control: &Control,
) -> Result<()> {
    let samples = sum.as_slice_mut().unwrap_or_default();
    let width = look.width;
    let scratch = || [vec![0.0f32; width], vec![0.0f32; width]];
    look.for_each_row([samples], [width], control, scratch, |_, pair, seen, [out], sums| {
        let [alike, power] = sums;
        alike.fill(0.0);
        power.fill(0.0);
        (0..pair.filters()).for_each(|j| compare(pair.here(j), alike, power));
        for x in 0..width {
            out[x] += share * seen[x] * alike[x] / (power[x] + floor);
        }
    })
}

/// Adds one filter's `Re(conj(R_0) R_1)` and `(a_0^2 + a_1^2)/2` on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn compare(responses: [(&[f32], &[f32]); 2], alike: &mut [f32], power: &mut [f32]) {
    let n = alike.len();
    let power = &mut power[..n];
    let [(a, b), (c, d)] = responses.map(|(re, im)| (&re[..n], &im[..n]));
    for x in 0..n {
        alike[x] += a[x] * c[x] + b[x] * d[x];
        power[x] += 0.5 * (a[x] * a[x] + b[x] * b[x] + c[x] * c[x] + d[x] * d[x]);
    }
}

/// Confidence (H, W) in [0, 1].
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn confidence(clues: &Clues<'_>, control: &Control) -> Result<Array2<f32>> {
    let coherence = smooth(clues.coherence.view(), SIGMA[0], control)?;
    let loss = smooth(loss(clues, control)?.view(), SIGMA[1], control)?;
    let size = loss.dim();
    let averaged = |plane: &[f32]| match ArrayView2::from_shape(size, plane) {
        Ok(view) => smooth(view, SIGMA[2], control),
        Err(_) => Ok(Array2::zeros(size)),
    };
    let [a11, a12, a22] = clues.matrix;
    let (a11, a12, a22) = (averaged(a11)?, averaged(a12)?, averaged(a22)?);
    let planes = [&loss, &a11, &a12, &a22].map(|plane| plane.as_slice().unwrap_or_default());
    let mut trust = coherence;
    for_each_row(trust.as_slice_mut().unwrap_or_default(), size.1, control, |y, trust| {
        let [loss, a11, a12, a22] = planes.map(|plane| &plane[y * size.1..(y + 1) * size.1]);
        for (x, trust) in trust.iter_mut().enumerate() {
            let resolved = least_eigenvalue(a11[x], a12[x], a22[x]);
            *trust = trust.clamp(0.0, 1.0).sqrt() * (-loss[x]).exp();
            *trust *= resolved / (resolved + RESOLVED);
        }
    })?;
    Ok(trust)
}

/// The smaller eigenvalue, at least 0.
fn least_eigenvalue(a11: f32, a12: f32, a22: f32) -> f32 {
    let (mean, half) = (0.5 * (a11 + a22), 0.5 * (a11 - a22));
    (mean - (half * half + a12 * a12).sqrt()).max(0.0)
}

/// What steepness and disagreement take, before it is averaged.
fn loss(clues: &Clues<'_>, control: &Control) -> Result<Array2<f32>> {
    let mut loss = steepness(clues.flow, control)?;
    let (factor, width) = (DISAGREEMENT_LOSS * clues.zoom, loss.ncols());
    // Without a coarser level nothing disagrees.
    let flows = [clues.flow, clues.coarser.unwrap_or(clues.flow)];
    let planes = flows.map(|f| [&f.u, &f.v].map(|plane| plane.as_slice().unwrap_or_default()));
    for_each_row(loss.as_slice_mut().unwrap_or_default(), width, control, |y, loss| {
        let [here, there] = planes.map(|flow| flow.map(|c| &c[y * width..(y + 1) * width]));
        weigh_loss(here, there, factor, loss);
    })?;
    Ok(loss)
}

/// From steepness to the loss, with `factor` times the distance of two flows.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn weigh_loss(here: [&[f32]; 2], there: [&[f32]; 2], factor: f32, loss: &mut [f32]) {
    let n = loss.len();
    let ([u, v], [cu, cv]) = (here.map(|c| &c[..n]), there.map(|c| &c[..n]));
    for x in 0..n {
        let (du, dv) = (u[x] - cu[x], v[x] - cv[x]);
        loss[x] = GRADIENT_LOSS * loss[x] + factor * (du * du + dv * dv).sqrt();
    }
}

/// `|grad (u, v)|` by central differences, one-sided at the edge.
fn steepness(flow: &FlowField<f32>, control: &Control) -> Result<Array2<f32>> {
    let (height, width) = flow.dim();
    let planes = [&flow.u, &flow.v].map(|plane| plane.as_slice().unwrap_or_default());
    let mut out = filled_picture(0.0, (height, width));
    for_each_row(out.as_slice_mut().unwrap_or_default(), width, control, |y, out| {
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
        let down = 1.0 / (rows[2] - rows[0]).max(1) as f32;
        let [u, v] = planes.map(|plane| rows.map(|y| &plane[y * width..(y + 1) * width]));
        slopes(u, v, down, out);
    })?;
    Ok(out)
}

/// `|grad (u, v)|` of a row from the rows above, here and below.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn slopes(u: [&[f32]; 3], v: [&[f32]; 3], down: f32, out: &mut [f32]) {
    let n = out.len();
    let ([u0, u1, u2], [v0, v1, v2]) = (u.map(|row| &row[..n]), v.map(|row| &row[..n]));
    for x in 1..n.saturating_sub(1) {
        let (ux, vx) = (0.5 * (u1[x + 1] - u1[x - 1]), 0.5 * (v1[x + 1] - v1[x - 1]));
        out[x] = ux * ux + vx * vx;
    }
    let last = n - 1;
    for (x, from, to) in [(0, 0, 1.min(last)), (last, last.saturating_sub(1), last)] {
        let (ux, vx) = (u1[to] - u1[from], v1[to] - v1[from]);
        out[x] = ux * ux + vx * vx;
    }
    for x in 0..n {
        let (uy, vy) = ((u2[x] - u0[x]) * down, (v2[x] - v0[x]) * down);
        out[x] = (out[x] + (uy * uy + vy * vy)).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coherence of two filters of the given imaginary responses, all the picture alike.
    fn coherence(one: f32, other: f32) -> Array2<f32> {
        let (re, one, other) = ([0.0; 24], [one; 24], [other; 24]);
        let (mut alike, mut power) = ([0.0; 24], [0.0; 24]);
        for _ in 0..2 {
            compare([(&re, &one), (&re, &other)], &mut alike, &mut power);
        }
        Array2::from_shape_fn((24, 24), |(_, x)| alike[x] / (power[x] + 2.0))
    }

    #[test]
    fn equal_responses_are_coherent_and_opposite_ones_are_not() {
        // Two filters of amplitude 3: 18/(18 + 2).
        assert!(coherence(3.0, 3.0).iter().all(|c| (c - 0.9).abs() < 1e-6));
        assert!(coherence(3.0, -3.0).iter().all(|c| (c + 0.9).abs() < 1e-6));
        let flow = constant(0.0);
        let trust = |c: &Array2<f32>| trust(c, &flow, None, [1e6, 0.0, 1e6]);
        assert!((trust(&coherence(3.0, 3.0)) - 0.9f32.sqrt()).abs() < 1e-5);
        assert_eq!(trust(&coherence(3.0, -3.0)), 0.0);
    }

    fn constant(u: f32) -> FlowField<f32> {
        FlowField { u: Array2::from_elem((24, 24), u), v: Array2::zeros((24, 24)) }
    }

    /// Confidence in the middle, of a level at half the size, for one matrix `[a11, a12, a22]`.
    fn trust(
        coherence: &Array2<f32>,
        flow: &FlowField<f32>,
        coarser: Option<&FlowField<f32>>,
        matrix: [f32; 3],
    ) -> f32 {
        let planes = matrix.map(|entry| vec![entry; 576]);
        let matrix = planes.each_ref().map(|plane| &plane[..]);
        let clues = Clues { coherence, flow, coarser, zoom: 2.0, matrix };
        confidence(&clues, &Control::new()).unwrap()[(12, 12)]
    }

    const SEEN: [f32; 3] = [1e6, 0.0, 1e6];

    #[test]
    fn confidence_falls_where_the_flow_changes() {
        let u = Array2::from_shape_fn((24, 24), |(_, x)| 0.3 * x as f32);
        let v = Array2::from_shape_fn((24, 24), |(y, _)| 0.4 * y as f32);
        let found = trust(&Array2::ones((24, 24)), &FlowField { u, v }, None, SEEN);
        // |grad| = 0.5: exp(-2).
        assert!((found - (-2.0f32).exp()).abs() < 1e-4);
    }

    #[test]
    fn confidence_falls_where_scales_disagree() {
        let (here, there) = (constant(1.0), constant(1.1));
        let found = trust(&Array2::ones((24, 24)), &here, Some(&there), SEEN);
        // 0.1 px of a level at half the size are 0.2 px: exp(-1).
        assert!((found - (-1.0f32).exp()).abs() < 1e-4);
    }

    #[test]
    fn a_straight_edge_and_a_flat_place_are_not_resolved() {
        let of = |matrix| trust(&Array2::ones((24, 24)), &constant(1.0), None, matrix);
        // G G' of one direction has one eigenvalue, up to the rounding of its square root.
        assert!(of([0.5, 0.5, 0.5]) < 1e-5 && of([0.0; 3]) < 1e-5);
        assert!((of([0.09, 0.0, 0.5]) - 0.75).abs() < 1e-4);
    }
}
