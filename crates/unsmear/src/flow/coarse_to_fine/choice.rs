//! Whether more frames than two help: constant motion tested, not assumed.
//!
//! Let `w_2` be the flow from two frames and `w_S` that from several. Both must explain the next
//! frame, which only `w_2` was made for:
//!
//! ```text
//! E(w)  = G_3 * sum W_0 (1 - q cos D) / (G_3 * sum W_0 + 0.05)
//! W_0   = w a_0^2/(a_0^2 + r^2),   q cos D = 2 Re(conj(R_0) R_1)/(a_0^2 + a_1^2)
//! delta = -(G_8 * s sum w G G' + 0.01 I)^-1 (G_8 * s sum w G D),  w = W/(1 + (D/r_s)^2)      px/frame, at w_S
//! ```
//!
//! `w_2` wins everywhere when the mean of `E(w_S)` exceeds that of `E(w_2)` by more than
//! [`WORST_RATIO`] (objects that turn, occlusion), or when the mean `|delta|` exceeds
//! [`WORST_BIAS`] (acceleration: small errors that all point the same way). Else `w_S` holds wherever
//! `E(w_S) < 2 E(w_2) + 0.02`, and where it leads out of the next frame, which then cannot judge. `G_s *` is a Gaussian average of deviation s px.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2, Zip};

use super::look::Look;
use super::phase_constraint::{Filters, TERMS};
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::pyramid::smooth;
use crate::tasks::filled;

/// Ratio of the mean mismatches above which several frames are given up.
const WORST_RATIO: f64 = 1.15;
/// Mean bias above which several frames are given up, px/frame.
const WORST_BIAS: f64 = 0.045;
/// Deviation of the average of the mismatch and of the bias, px.
const SIGMA: [f64; 2] = [3.0, 8.0];
/// Mismatch by which several frames may always be worse: what noise does to the fit of one frame.
const SLACK: f32 = 0.02;
/// Share of the weight under `w_2` that `w_S` must leave in view for the next frame to judge it.
const JUDGING: f32 = 0.7;
/// Mismatch of which nobody is to be blamed.
const SMALL: f64 = 1e-3;

/// How badly a flow explains the next frame.
pub(super) struct Mismatch {
    /// `E`, (H, W).
    pub(super) map: Array2<f32>,
    /// `G_3 * sum W_0`: how much of the next frame could judge.
    pub(super) weight: Array2<f32>,
    /// Mean of `|delta|`, px/frame.
    pub(super) bias: f64,
}

/// Constants of [`mismatch`].
#[derive(Clone, Copy)]
pub(super) struct Yardstick {
    /// `r^2`.
    pub(super) floor: f32,
    /// `s`.
    pub(super) scale: f32,
    /// `r_s`, rad.
    pub(super) residual: f32,
}

/// Planes that are summed over the filters: `W_0`, `W_0 (1 - q cos D)`, and the sums of `delta`: `a11, a12, a22, b1, b2`.
const SUMS: usize = 7;

/// Measures `E` and the bias in a look at the next frame.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn mismatch(
    look: &Look<'_>,
    filters: &Filters,
    yardstick: Yardstick,
    control: &Control,
) -> Result<Mismatch> {
    let (count, width) = (look.filters(), look.width);
    let mut sums = [(); SUMS].map(|()| filled(0.0, look.height * width));
    let planes = sums.each_mut().map(|plane| &mut plane[..]);
    let scratch = || vec![0.0; count * TERMS * width];
    look.for_each_row(planes, [width; SUMS], control, scratch, |y, pair, seen, rows, terms| {
        filters.constrain(y, pair, seen, terms);
        let [weight, lost, a11, a12, a22, b1, b2] = rows;
        for (j, terms) in terms.chunks_exact(TERMS * width).enumerate() {
            add_loss(pair.here(j), seen, yardstick.floor, weight, lost);
            add_bias(terms, yardstick, a11, a12, a22, b1, b2);
        }
    })?;
    judge(sums, width, control)
}

/// Adds one filter's `W_0` and `W_0 (1 - q cos D)` on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_loss(
    responses: [(&[f32], &[f32]); 2],
    seen: &[f32],
    floor: f32,
    weight: &mut [f32],
    lost: &mut [f32],
) {
    let n = weight.len();
    let (seen, lost) = (&seen[..n], &mut lost[..n]);
    let [(a, b), (c, d)] = responses.map(|(re, im)| (&re[..n], &im[..n]));
    for x in 0..n {
        let power = a[x] * a[x] + b[x] * b[x];
        let both = power + c[x] * c[x] + d[x] * d[x];
        let product = 2.0 * (a[x] * c[x] + b[x] * d[x]);
        let alike = if both > 0.0 { product / both } else { 1.0 };
        let own = seen[x] * power / (power + floor);
        weight[x] += own;
        lost[x] += own * (1.0 - alike);
    }
}

/// Adds one filter's `s w G G'` and `s w G D` on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_bias(
    terms: &[f32],
    yardstick: Yardstick,
    a11: &mut [f32],
    a12: &mut [f32],
    a22: &mut [f32],
    b1: &mut [f32],
    b2: &mut [f32],
) {
    let n = a11.len();
    let (a12, a22, b1, b2) = (&mut a12[..n], &mut a22[..n], &mut b1[..n], &mut b2[..n]);
    let (gx, gy) = (&terms[..n], &terms[n..2 * n]);
    let (step, weight) = (&terms[2 * n..3 * n], &terms[3 * n..4 * n]);
    for x in 0..n {
        let r = step[x] / yardstick.residual;
        let w = yardstick.scale * weight[x] / (1.0 + r * r);
        a11[x] += w * gx[x] * gx[x];
        a12[x] += w * gx[x] * gy[x];
        a22[x] += w * gy[x] * gy[x];
        b1[x] += w * gx[x] * step[x];
        b2[x] += w * gy[x] * step[x];
    }
}

/// The averages of the sums, and what they say.
fn judge(sums: [Vec<f32>; SUMS], width: usize, control: &Control) -> Result<Mismatch> {
    let averaged = |plane: Vec<f32>, sigma: f64| {
        let shape = (plane.len() / width, width);
        match ArrayView2::from_shape(shape, &plane) {
            Ok(view) => smooth(view, sigma, control),
            Err(_) => Ok(Array2::zeros(shape)),
        }
    };
    let [weight, lost, a11, a12, a22, b1, b2] = sums;
    let (weight, lost) = (averaged(weight, SIGMA[0])?, averaged(lost, SIGMA[0])?);
    let map = Zip::from(&lost).and(&weight).map_collect(|l, w| l / (w + 0.05));
    let (a11, a12) = (averaged(a11, SIGMA[1])?, averaged(a12, SIGMA[1])?);
    let a22 = averaged(a22, SIGMA[1])?;
    let (b1, b2) = (averaged(b1, SIGMA[1])?, averaged(b2, SIGMA[1])?);
    let mut total = 0.0;
    for (i, &xx) in a11.indexed_iter() {
        let (xx, xy, yy) = (f64::from(xx) + 0.01, f64::from(a12[i]), f64::from(a22[i]) + 0.01);
        let (p, q) = (f64::from(b1[i]), f64::from(b2[i]));
        let determinant = xx * yy - xy * xy;
        total += (yy * p - xy * q).hypot(xx * q - xy * p) / determinant;
    }
    Ok(Mismatch { map, weight, bias: total / a11.len() as f64 })
}

/// Where several frames hold; nowhere when they are given up.
pub(super) fn several_hold(two: &Mismatch, several: &Mismatch) -> Array2<bool> {
    let mean = |m: &Mismatch| m.map.iter().map(|&e| f64::from(e)).sum::<f64>() / m.map.len() as f64;
    let ratio = (mean(several) + SMALL) / (mean(two) + SMALL);
    let help = ratio <= WORST_RATIO && several.bias <= WORST_BIAS;
    let mut hold = Zip::from(&two.map)
        .and(&several.map)
        .map_collect(|two, several| help && *several < 2.0 * two + SLACK);
    Zip::from(&mut hold).and(&two.weight).and(&several.weight).for_each(|hold, two, several| {
        *hold |= help && *several < JUDGING * two;
    });
    hold
}

/// The flow and confidence of `several` where `hold`, else of `two`.
pub(super) fn merge(
    hold: &Array2<bool>,
    two: (FlowField<f32>, Array2<f32>),
    several: (FlowField<f32>, Array2<f32>),
) -> (FlowField<f32>, Array2<f32>) {
    let pick = |a: Array2<f32>, b: &Array2<f32>| {
        Zip::from(hold).and(&a).and(b).map_collect(|&hold, &a, &b| if hold { b } else { a })
    };
    let flow = FlowField { u: pick(two.0.u, &several.0.u), v: pick(two.0.v, &several.0.v) };
    (flow, pick(two.1, &several.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(map: [f32; 3], weight: [f32; 3], bias: f64) -> Mismatch {
        let plane = |values: [f32; 3]| Array2::from_shape_fn((1, 3), |(_, x)| values[x]);
        Mismatch { map: plane(map), weight: plane(weight), bias }
    }

    #[test]
    fn several_frames_hold_where_they_explain_the_next() {
        let two = judged([0.10, 0.10, 0.10], [4.0; 3], 0.0);
        let fine = judged([0.05, 0.05, 0.24], [4.0; 3], 0.03);
        assert_eq!(several_hold(&two, &fine).into_raw_vec_and_offset().0, [true, true, false]);
        let out_of_view = judged([0.05, 0.05, 0.24], [4.0, 4.0, 1.0], 0.03);
        assert!(several_hold(&two, &out_of_view).iter().all(|&hold| hold));
    }

    #[test]
    fn several_frames_are_given_up_as_a_whole() {
        let two = judged([0.10; 3], [4.0; 3], 0.0);
        let worse = judged([0.12; 3], [4.0; 3], 0.0);
        let biased = judged([0.05; 3], [4.0, 4.0, 1.0], 0.05);
        for several in [worse, biased] {
            assert!(several_hold(&two, &several).iter().all(|&hold| !hold));
        }
    }

    /// One filter along x and one along y, of 1 rad/px each.
    #[test]
    fn bias_is_the_motion_that_the_constraints_still_ask_for() {
        let (five, none, seen) = ([5.0; 30], [0.0; 30], [1.0; 30]);
        let yardstick = Yardstick { floor: 0.1, scale: 1.0, residual: 0.5 };
        let mut sums = [(); SUMS].map(|()| vec![0.0; 900]);
        for y in 0..30 {
            let [weight, lost, a11, a12, a22, b1, b2] =
                sums.each_mut().map(|plane| &mut plane[30 * y..30 * (y + 1)]);
            for terms in [[1.0, 0.0, 0.03, 1.0], [0.0, 1.0, -0.04, 1.0]] {
                add_loss([(&five, &none); 2], &seen, yardstick.floor, weight, lost);
                add_bias(&terms.map(|t| [t; 30]).concat(), yardstick, a11, a12, a22, b1, b2);
            }
        }
        let found = judge(sums, 30, &Control::new()).unwrap();
        // 0.05 px but for the 1 % of the floor and the reweighting's 0.6 %.
        assert!((found.bias - 0.05).abs() < 1e-3, "{}", found.bias);
        assert!(found.map.iter().all(|&e| e == 0.0), "equal responses agree");
    }
}
