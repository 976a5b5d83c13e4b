//! Coefficients of an interpolating B-spline: the recursive filter in front of [`interpolate`](crate::interpolate).
//!
//! The coefficients of a line solve `sum_l c[l] B_n(k - l) = s[k]`. That filter factors into one first order
//! recursion per pole z, |z| < 1, run forwards and then backwards over the line:
//!
//! ```text
//! c+[k] = g s[k] + z c+[k-1],    c[k] = z (c[k+1] - c+[k]),    g = (1 - z)(1 - 1/z)
//! n = 3: z = sqrt(3) - 2       n = 5: z = sqrt(135/2 -+ sqrt(17745/4)) +- sqrt(105/4) - 13/2
//! ```
//!
//! Beyond its ends a line is mirrored about the end sample. The forward start is then a sum over the mirrored line
//! (closed form in [`causal_start`]) and the backward start `c[n-1] = z/(z² - 1) (c+[n-1] + z c+[n-2])`; both exact.
//!
//! Units: those of the samples. Validity: any finite line of at least one sample. In `f32` the result passes through
//! the samples to a few units in the seventh digit of the largest.
//!
//! Reference: M. Unser, A. Aldroubi, M. Eden, "B-spline signal processing: part II", IEEE Trans. Signal Processing
//! 41 (1993) 834-848, [10.1109/78.193221](https://doi.org/10.1109/78.193221), table I and box 2; part I, the theory:
//! [10.1109/78.193220](https://doi.org/10.1109/78.193220).
#![allow(
    clippy::inline_always,
    reason = "a helper gets its caller's vector instructions only when inlined"
)]

use multiversion::multiversion;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::real::Real;
use crate::tasks::filled;

/// Lines filtered side by side: one 64-byte cache line of `f32`, and a multiple of every vector register.
const LANES: usize = 16;

/// Weight that adds nothing: the rounding of `f64`, with room for the filter's gain of up to 7.5 per axis.
const NEGLIGIBLE: f64 = f64::EPSILON / 1024.0;

/// Poles of the cubic spline's filter.
pub(crate) fn cubic_poles() -> Vec<f64> {
    vec![3f64.sqrt() - 2.0]
}

/// Poles of the quintic spline's filter.
pub(crate) fn quintic_poles() -> Vec<f64> {
    let (inner, shift) = (17745f64.sqrt() / 2.0, 26.25f64.sqrt());
    vec![(67.5 - inner).sqrt() + shift - 6.5, (67.5 + inner).sqrt() - shift - 6.5]
}

/// Coefficients of a packed (height, width) picture along both axes.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(crate) fn spline_coefficients<T: Real>(
    samples: &[T],
    height: usize,
    width: usize,
    poles: &[f64],
    control: &Control,
) -> Result<Vec<T>> {
    // Each call filters along y and hands the result on transposed, hence two calls filter along both axes.
    let columns = filter_down(samples, height, width, poles, control)?;
    filter_down(&columns, width, height, poles, control)
}

/// Filters the columns of a packed (height, width) picture and returns them as the rows of its transpose.
fn filter_down<T: Real>(
    samples: &[T],
    height: usize,
    width: usize,
    poles: &[f64],
    control: &Control,
) -> Result<Vec<T>> {
    let mut out = filled(T::zero(), samples.len());
    // One "row" of the parallel loop is a block of LANES columns: LANES whole rows of the transpose.
    for_each_row(&mut out, LANES * height, control, |block, columns| {
        let (x0, lanes) = (block * LANES, columns.len() / height);
        let mut lines = vec![[T::zero(); LANES]; height];
        for (line, row) in lines.iter_mut().zip(samples.chunks_exact(width)) {
            line[..lanes].copy_from_slice(&row[x0..x0 + lanes]);
        }
        filter_lines(&mut lines, poles);
        for (lane, column) in columns.chunks_exact_mut(height).enumerate() {
            column.iter_mut().zip(&lines).for_each(|(to, line)| *to = line[lane]);
        }
    })?;
    Ok(out)
}

/// The recursions of all poles, over LANES lines at once: `lines[k][lane]` is sample k of one line.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2+fma"))]
fn filter_lines<T: Real>(lines: &mut [[T; LANES]], poles: &[f64]) {
    let n = lines.len();
    if n < 2 {
        return; // a mirrored single sample is a constant line, whose coefficients are its value
    }
    for &pole in poles {
        let (z, gain) = (T::of(pole), T::of((1.0 - pole) * (1.0 - 1.0 / pole)));
        let mut previous = causal_start(lines, pole);
        for lane in &mut previous {
            *lane *= gain;
        }
        lines[0] = previous;
        for line in &mut lines[1..] {
            for lane in 0..LANES {
                line[lane] = gain * line[lane] + z * previous[lane];
            }
            previous = *line;
        }
        let edge = T::of(pole / (pole * pole - 1.0));
        let before = lines[n - 2];
        for lane in 0..LANES {
            previous[lane] = edge * (previous[lane] + z * before[lane]);
        }
        lines[n - 1] = previous;
        for line in lines[..n - 1].iter_mut().rev() {
            for lane in 0..LANES {
                line[lane] = z * (previous[lane] - line[lane]);
            }
            previous = *line;
        }
    }
}

/// `c+[0] / g`: the sum of `z^|k| s[k]` over the mirrored, hence periodic, line to the left of and at sample 0,
///
/// `(s[0] + sum_{0<k<n-1} (z^k + z^(p-k)) s[k] + z^(n-1) s[n-1]) / (1 - z^p)` with the period `p = 2(n - 1)`.
///
/// Weights below [`NEGLIGIBLE`] are left out, which no sum in `f64` can tell.
#[inline(always)]
fn causal_start<T: Real>(lines: &[[T; LANES]], pole: f64) -> [T; LANES] {
    let n = lines.len() as i32;
    let period = 2 * (n - 1);
    let closing = 1.0 - pole.powi(period);
    let mut sum = [T::zero(); LANES];
    for (k, line) in (0..n).zip(lines) {
        let folded = if k == 0 || k == n - 1 { 0.0 } else { pole.powi(period - k) };
        let weight = (pole.powi(k) + folded) / closing;
        if weight.abs() < NEGLIGIBLE {
            break;
        }
        let weight = T::of(weight);
        for lane in 0..LANES {
            sum[lane] += weight * line[lane];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of one line by Gauss elimination of `B c = s` with mirrored ends: slow, obviously right.
    fn solve(samples: &[f64], taps: &[f64]) -> Vec<f64> {
        let (n, reach) = (samples.len(), taps.len() / 2);
        let mut rows: Vec<Vec<f64>> = (0..n)
            .map(|k| {
                let mut row = vec![0.0; n + 1];
                for (i, tap) in taps.iter().enumerate() {
                    let l = k as isize + i as isize - reach as isize;
                    row[crate::Border::Reflect.index(l, n).unwrap()] += tap;
                }
                row[n] = samples[k];
                row
            })
            .collect();
        for k in 0..n {
            let pivot: Vec<f64> = rows[k].iter().map(|a| a / rows[k][k]).collect();
            for (other, row) in rows.iter_mut().enumerate() {
                let factor = if other == k { 0.0 } else { row[k] };
                row.iter_mut().zip(&pivot).for_each(|(a, p)| *a -= factor * p);
            }
            rows[k] = pivot;
        }
        rows.iter().map(|row| row[n]).collect()
    }

    #[test]
    fn recursion_solves_the_spline_equations_on_every_length() {
        // Values of the B-splines at the integers, as exact fractions.
        let cubic = [1.0, 4.0, 1.0].map(|b| b / 6.0).to_vec();
        let quintic = [1.0, 26.0, 66.0, 26.0, 1.0].map(|b| b / 120.0).to_vec();
        for (poles, taps) in [(cubic_poles(), cubic), (quintic_poles(), quintic)] {
            for n in (1..12).chain([40, 90]) {
                let line: Vec<f64> = (0..n).map(|k| ((7 * k * k + 3 * k) % 11) as f64).collect();
                let got = spline_coefficients(&line, n, 1, &poles, &Control::new()).unwrap();
                let expected = solve(&line, &taps);
                // Rounding only: the filter's largest gain (7.5 for degree 5) times 10 times a few eps.
                assert!(got.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "n = {n}");
            }
        }
    }

    #[test]
    fn lanes_do_not_mix() {
        // 37 columns: two whole blocks and a remainder; each column alone must give the same bytes.
        let (height, width) = (9, 37);
        let picture: Vec<f32> = (0..height * width).map(|i| ((i * i) % 23) as f32).collect();
        let columns =
            filter_down(&picture, height, width, &quintic_poles(), &Control::new()).unwrap();
        for x in 0..width {
            let column: Vec<f32> = (0..height).map(|y| picture[y * width + x]).collect();
            let alone = filter_down(&column, height, 1, &quintic_poles(), &Control::new()).unwrap();
            assert_eq!(alone, columns[x * height..][..height]);
        }
    }
}
