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

use ndarray::{Array2, Zip};

use super::phase_constraint::TERMS;
use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::flow_field::FlowField;
use crate::gabor::Responses;
use crate::pyramid::smooth;

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

/// What [`mismatch`] looks at: responses, weights and constraints of the warped next frame.
pub(super) struct Explanation<'a> {
    pub(super) responses: [&'a Responses<f32>; 2],
    pub(super) visible: &'a [f32],
    pub(super) constraints: &'a [f32],
    /// `r^2`.
    pub(super) floor: f32,
    /// `s`.
    pub(super) scale: f32,
    /// `r_s`, rad.
    pub(super) residual: f32,
}

/// Measures `E` and the bias.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn mismatch(seen: &Explanation<'_>, control: &Control) -> Result<Mismatch> {
    let (filters, height, width) = seen.responses[0].dim();
    let sum = |term: fn([f32; 4], f32) -> f32| -> Result<Array2<f32>> {
        let mut out = Array2::<f32>::zeros((height, width));
        let samples = out.as_slice_mut().unwrap_or_default();
        for_each_row(samples, width, control, |y, out| {
            let visible = &seen.visible[y * width..(y + 1) * width];
            for j in 0..filters {
                let [(a, b), (c, d)] = seen.responses.map(|r| r.row(j, y));
                for (x, out) in out.iter_mut().enumerate() {
                    *out += visible[x] * term([a[x], b[x], c[x], d[x]], seen.floor);
                }
            }
        })?;
        smooth(out.view(), SIGMA[0], control)
    };
    let weight = sum(|[a, b, ..], floor| {
        let power = a * a + b * b;
        power / (power + floor)
    })?;
    let lost = sum(|[a, b, c, d], floor| {
        let (power, both) = (a * a + b * b, a * a + b * b + c * c + d * d);
        let alike = if both > 0.0 { 2.0 * (a * c + b * d) / both } else { 1.0 };
        power / (power + floor) * (1.0 - alike)
    })?;
    let map = Zip::from(&lost).and(&weight).map_collect(|l, w| l / (w + 0.05));
    let bias = bias(seen, control)?;
    Ok(Mismatch { map, weight, bias })
}

/// Mean of `|delta|`.
fn bias(seen: &Explanation<'_>, control: &Control) -> Result<f64> {
    let (filters, height, width) = seen.responses[0].dim();
    let sum = |term: fn([f32; 3]) -> f32| -> Result<Array2<f32>> {
        let mut out = Array2::<f32>::zeros((height, width));
        let samples = out.as_slice_mut().unwrap_or_default();
        for_each_row(samples, width, control, |y, out| {
            let row = &seen.constraints[y * filters * TERMS * width..][..filters * TERMS * width];
            for terms in row.chunks_exact(TERMS * width) {
                for (x, out) in out.iter_mut().enumerate() {
                    let [gx, gy, d, w] = [0, 1, 2, 3].map(|term| terms[term * width + x]);
                    let r = d / seen.residual;
                    *out += seen.scale * w / (1.0 + r * r) * term([gx, gy, d]);
                }
            }
        })?;
        smooth(out.view(), SIGMA[1], control)
    };
    let a11 = sum(|[gx, _, _]| gx * gx)?;
    let a12 = sum(|[gx, gy, _]| gx * gy)?;
    let a22 = sum(|[_, gy, _]| gy * gy)?;
    let b1 = sum(|[gx, _, d]| gx * d)?;
    let b2 = sum(|[_, gy, d]| gy * d)?;
    let mut total = 0.0;
    for (i, &xx) in a11.indexed_iter() {
        let (xx, xy, yy) = (f64::from(xx) + 0.01, f64::from(a12[i]), f64::from(a22[i]) + 0.01);
        let (p, q) = (f64::from(b1[i]), f64::from(b2[i]));
        let determinant = xx * yy - xy * xy;
        total += (yy * p - xy * q).hypot(xx * q - xy * p) / determinant;
    }
    Ok(total / a11.len() as f64)
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
        let mut responses = Responses::zeros(2, 30, 30);
        for (y, j) in (0..30).flat_map(|y| [(y, 0), (y, 1)]) {
            responses.row_mut(j, y).0.fill(5.0);
        }
        let mut constraints = Vec::new();
        for _ in 0..30 {
            for terms in [[1.0, 0.0, 0.03, 1.0], [0.0, 1.0, -0.04, 1.0]] {
                constraints.extend(terms.into_iter().flat_map(|term| [term; 30]));
            }
        }
        let seen = Explanation {
            responses: [&responses, &responses],
            visible: &[1.0; 900],
            constraints: &constraints,
            floor: 0.1,
            scale: 1.0,
            residual: 0.5,
        };
        let found = mismatch(&seen, &Control::new()).unwrap();
        // 0.05 px but for the 1 % of the floor and the reweighting's 0.6 %.
        assert!((found.bias - 0.05).abs() < 1e-3, "{}", found.bias);
        assert!(found.map.iter().all(|&e| e == 0.0), "equal responses agree");
    }
}
