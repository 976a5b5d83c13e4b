//! How precisely the phase of a neighbourhood tells its motion: weights measured, not assumed.
//!
//! The weight of a constraint supposes phase to be as uncertain everywhere. On a smooth pattern,
//! longer than the tuned wavelength, phase turns slowly (`|G| << k_0`) and the data lose to the
//! smoothness term by `|G|^2/k_0^2`; yet such phase is steady, and its few hundredths of a radian
//! are motion. What the phase is worth shows in the residuals at the flow of the last warp. With
//!
//! ```text
//! sigma^2 = (G_2 * sum W D^2 + e s_0^2)/(G_2 * sum W + e)      rad^2
//! T       = G_2 * s sum W |G|^2
//! g       = min(s_0^2/sigma^2, T_0/T), in [1, 100]
//! ```
//!
//! over the filters and frames, the data of a pixel, pull to rest included, count `g` times: where
//! the residuals around it are smaller than `s_0` (`precision_scale`), in proportion to the inverse
//! of their variance as least squares wants it, but not beyond the evidence `T_0` that ordinary texture
//! has. Noise, occlusion, wrong motion and aliasing show in `D`, and `g` stays 1. `G_2 *` is a Gaussian
//! average of deviation 2 px, `e` = [`LITTLE`] the weight below which a neighbourhood knows nothing.
//!
//! Reference: A. C. Aitken, Proc. R. Soc. Edinb. 55 (1936) 42-48
//! ([10.1017/S0370164600014346](https://doi.org/10.1017/S0370164600014346)): weights are inverse variances.

use multiversion::multiversion;
use ndarray::ArrayView2;

use super::constraints::{Constraints, Units};
use super::rows::for_each_rows;
use crate::control::Control;
use crate::error::Result;
use crate::pyramid::smooth;
use crate::tasks::filled;

/// Trace of the data term of ordinary texture, up to which data are raised.
const FULL_TRACE: f32 = 0.3;
/// Largest factor: residuals of a tenth of the scale are rounding.
const MOST: f32 = 100.0;
/// Sum of weights below which a neighbourhood knows nothing.
const LITTLE: f32 = 1e-3;
/// Keeps the quotient of traces finite.
const NO_TRACE: f32 = 1e-6;
/// Deviation of the averages, px.
const SIGMA: f64 = 2.0;

/// Fills `out` (H, W) with `g` from the constraints of each frame.
///
/// `precision` is `s_0` in rad, `scale` is `s`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn precision(
    frames: &[&Constraints],
    width: usize,
    precision: f32,
    scale: f32,
    out: &mut [f32],
    control: &Control,
) -> Result<()> {
    let samples = out.len();
    let (mut residual, mut trace) = (filled(0.0, samples), filled(0.0, samples));
    let sums = [&mut residual[..], &mut *out, &mut trace[..]];
    for_each_rows(sums, [width; 3], control, |y, [residual, weight, trace]| {
        residual.fill(0.0);
        weight.fill(0.0);
        trace.fill(0.0);
        for constraints in frames {
            let (filters, units) = constraints.row(y);
            filters.for_each(|terms| add(terms, units, residual, weight, trace));
        }
    })?;
    let averaged = |plane: &[f32]| {
        let view = ArrayView2::from_shape((samples / width, width), plane);
        view.map_or_else(
            |_| Ok(Vec::new()),
            |view| smooth(view, SIGMA, control).map(|plane| plane.into_raw_vec_and_offset().0),
        )
    };
    // One after the other: each average takes the place of its plane.
    residual = averaged(&residual)?;
    trace = averaged(&trace)?;
    let weight = averaged(out)?;
    for_each_rows([out], [width], control, |y, [out]| {
        let row = y * width..(y + 1) * width;
        let (residual, weight) = (&residual[row.clone()], &weight[row.clone()]);
        factor(residual, weight, &trace[row], precision * precision, scale, out);
    })
}

/// Adds one filter's `W D^2`, `W` and `W |G|^2` on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(terms: &[i16], units: Units, residual: &mut [f32], weight: &mut [f32], trace: &mut [f32]) {
    let n = residual.len();
    let (weight, trace) = (&mut weight[..n], &mut trace[..n]);
    let (slope_x, slope_y) = (&terms[..n], &terms[n..2 * n]);
    let (steps, roots) = (&terms[2 * n..3 * n], &terms[3 * n..4 * n]);
    for x in 0..n {
        let (gx, gy) = (f32::from(slope_x[x]) * units.slope, f32::from(slope_y[x]) * units.slope);
        let (step, root) = (f32::from(steps[x]) * units.step, f32::from(roots[x]) * units.root);
        let w = root * root;
        residual[x] += w * step * step;
        weight[x] += w;
        trace[x] += w * (gx * gx + gy * gy);
    }
}

/// `g` on a row, from the averages.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn factor(
    residual: &[f32],
    weight: &[f32],
    trace: &[f32],
    square: f32,
    scale: f32,
    out: &mut [f32],
) {
    let n = out.len();
    let (residual, weight, trace) = (&residual[..n], &weight[..n], &trace[..n]);
    let least = square / MOST;
    for x in 0..n {
        let variance = (residual[x] + LITTLE * square) / (weight[x] + LITTLE);
        let steady = square / if variance > least { variance } else { least };
        let room = FULL_TRACE / (scale * trace[x] + NO_TRACE);
        let g = if steady < room { steady } else { room };
        out[x] = if g > 1.0 { g } else { 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `g` in the middle of a picture where one filter says `[G_x, G_y, D, W]` everywhere.
    fn g(terms: [f32; 4]) -> f32 {
        let (width, height) = (24, 20);
        let row = terms.into_iter().flat_map(|term| [term; 24]).collect::<Vec<_>>();
        let constraints = Constraints::of(&row.repeat(height), 1, width, 1.6);
        let mut out = vec![0.0; width * height];
        precision(&[&constraints], width, 0.25, 0.4, &mut out, &Control::new()).unwrap();
        assert!(out.iter().all(|g| (1.0..=100.0).contains(g)));
        out[10 * width + 12]
    }

    #[test]
    fn weight_is_inverse_variance_between_its_bounds() {
        // (0.25/0.05)^2 = 25 but for the little weight: (0.0025 + 6e-5)/1.001.
        assert!((g([0.05, 0.0, 0.05, 1.0]) - 24.4).abs() < 0.1);
        assert_eq!(g([0.05, 0.0, 0.5, 1.0]), 1.0, "uncertain phase keeps its weight");
        assert!((g([0.05, 0.0, 0.0, 1.0]) - 100.0).abs() < 1e-3);
        // T = 0.4 * 0.25 = 0.1 may grow to 0.3; texture has it all.
        assert!((g([0.3, 0.4, 0.0, 1.0]) - 3.0).abs() < 1e-3);
        assert_eq!(g([1.2, 0.9, 0.0, 1.0]), 1.0);
    }

    #[test]
    fn where_nothing_is_seen_nothing_is_raised() {
        assert_eq!(g([0.0; 4]), 1.0);
        assert!((g([0.1, 0.0, 0.01, 1e-7]) - 1.0).abs() < 1e-3);
    }
}
