//! Coefficients of the interpolating cubic spline, by a filter that is its own transpose.
//!
//! ```text
//! x = B c,   B = [1 4 1] / 6 along rows and columns,     c = H x,   H = (sum_k h[k] S^k),   h[k] ~ z^|k|, z = sqrt(3) - 2
//! ```
//!
//! for |k| <= [`REACH`], scaled to sum 1. The picture is mirrored about its edges (half a pixel outside), which keeps
//! H symmetric: what an operator with H before it needs as its transpose is H again. H B is the identity but for z^7.
//! Units: those of x. Validity: finite x.
//! M. Unser, A. Aldroubi, M. Eden, IEEE Trans. Signal Processing 41 (1993) 821-833,
//! [10.1109/78.193220](https://doi.org/10.1109/78.193220), equation 3.17.

use multiversion::multiversion;
use rayon::prelude::*;

/// Taps beside the middle one: what is cut off is 1e-4 of the sum.
const REACH: usize = 6;

/// Rows per task.
const ROWS_PER_TASK: usize = 8;

/// Writes H x to `out`; rows of `width` samples.
pub(super) fn spline_inverse(x: &[f32], width: usize, out: &mut [f32]) {
    let taps = taps();
    let height = x.len() / width;
    let row = |y: isize| &x[mirrored(y, height) * width..][..width];
    out.par_chunks_mut(width).with_min_len(ROWS_PER_TASK).enumerate().for_each_init(
        || vec![0.0; width + 2 * REACH],
        |line, (y, out)| {
            let y = y as isize;
            let pairs: [[&[f32]; 2]; REACH + 1] =
                std::array::from_fn(|k| [row(y - k as isize), row(y + k as isize)]);
            down(&pairs, &taps, &mut line[REACH..REACH + width]);
            for k in 0..REACH {
                line[REACH - 1 - k] = line[REACH + mirrored(-1 - k as isize, width)];
                line[REACH + width + k] = line[REACH + mirrored((width + k) as isize, width)];
            }
            across(line, &taps, out);
        },
    );
}

/// h[0..=REACH].
fn taps() -> [f32; REACH + 1] {
    let z = 3f64.sqrt() - 2.0;
    let sum: f64 = 1.0 + 2.0 * (1..=REACH).map(|k| z.powi(k as i32)).sum::<f64>();
    std::array::from_fn(|k| (z.powi(k as i32) / sum) as f32)
}

/// The sample that the mirrored line has at `i`.
fn mirrored(i: isize, count: usize) -> usize {
    let (i, period) = (i.rem_euclid(2 * count as isize) as usize, 2 * count);
    i.min(period - 1 - i)
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn down(pairs: &[[&[f32]; 2]; REACH + 1], taps: &[f32; REACH + 1], out: &mut [f32]) {
    let n = out.len();
    let middle = &pairs[0][0][..n];
    for x in 0..n {
        out[x] = taps[0] * middle[x];
    }
    for k in 1..=REACH {
        let [above, below] = pairs[k].map(|row| &row[..n]);
        for x in 0..n {
            out[x] += taps[k] * (above[x] + below[x]);
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn across(line: &[f32], taps: &[f32; REACH + 1], out: &mut [f32]) {
    let n = out.len();
    let line = &line[..n + 2 * REACH];
    for x in 0..n {
        let mut sum = taps[0] * line[x + REACH];
        for k in 1..=REACH {
            sum += taps[k] * (line[x + REACH - k] + line[x + REACH + k]);
        }
        out[x] = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_operator::trials::{dot, noise};

    #[test]
    fn the_spline_goes_through_the_samples_and_the_filter_is_its_own_transpose() {
        for (height, width) in [(17, 23), (1, 40), (3, 5), (2, 1)] {
            let (x, r) = (noise(height * width, 1), noise(height * width, 2));
            let mut c = vec![f32::NAN; x.len()];
            spline_inverse(&x, width, &mut c);
            for (i, wanted) in x.iter().enumerate() {
                let (y, x) = ((i / width) as isize, (i % width) as isize);
                let line = |y: isize| {
                    let row = mirrored(y, height) * width;
                    let at = |x: isize| c[row + mirrored(x, width)];
                    (at(x - 1) + 4.0 * at(x) + at(x + 1)) / 6.0
                };
                let value = (line(y - 1) + 4.0 * line(y) + line(y + 1)) / 6.0;
                // What is cut off, 3e-4 of the sum on either axis, on white noise.
                assert!((value - wanted).abs() < 1e-3, "{height} {width} {i}: {value} {wanted}");
            }
            let mut back = vec![f32::NAN; r.len()];
            spline_inverse(&r, width, &mut back);
            assert!((dot(&c, &r) - dot(&x, &back)).abs() < 1e-5 * dot(&x, &x).max(1.0));
        }
    }
}
