//! An even and an odd filter along one axis in one pass, sharing their loads.
//!
//! With `e_j = rows[r+j] + rows[r-j]` and `o_j = rows[r+j] - rows[r-j]`, `j = 1..=r`,
//!
//! ```text
//! even[x] = w_e[0] rows[r][x] + sum_j w_e[j] e_j[x],      odd[x] = sum_j w_o[j] o_j[x]
//! ```
//!
//! The real and the imaginary part of a Gabor factor are such a pair, and so are a window in time
//! and its slope. Plain multiplications and additions in the order of the taps, as in
//! [`crate::convolve`]: the same bits on every processor.

use multiversion::multiversion;

use crate::real::Real;

/// Samples handled together: two sums of two registers of 16 `f32`, enough to hide the latency of
/// additions.
const LANES: usize = 32;

/// The pair of sums; see the [module](self).
///
/// `even_taps` holds `w_e[0..=r]`, `odd_taps` holds `w_o[0..=r]` with `w_o[0]` unused.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn even_odd_sums<T: Real>(
    rows: &[&[T]],
    even_taps: &[T],
    odd_taps: &[T],
    even: &mut [T],
    odd: &mut [T],
) {
    let radius = even_taps.len() - 1;
    for start in (0..even.len()).step_by(LANES) {
        let end = (start + LANES).min(even.len());
        let (even, odd) = (&mut even[start..end], &mut odd[start..end]);
        let mut even_sum = [T::zero(); LANES];
        let mut odd_sum = [T::zero(); LANES];
        if even.len() == LANES {
            let centre = &rows[radius][start..end];
            for i in 0..LANES {
                even_sum[i] = even_taps[0] * centre[i];
            }
            for j in 1..=radius {
                let (a, b) = (&rows[radius + j][start..end], &rows[radius - j][start..end]);
                for i in 0..LANES {
                    even_sum[i] += even_taps[j] * (a[i] + b[i]);
                    odd_sum[i] += odd_taps[j] * (a[i] - b[i]);
                }
            }
            even.copy_from_slice(&even_sum);
            odd.copy_from_slice(&odd_sum);
        } else {
            for i in 0..even.len() {
                even_sum[i] = even_taps[0] * rows[radius][start + i];
                for j in 1..=radius {
                    let (a, b) = (rows[radius + j][start + i], rows[radius - j][start + i]);
                    even_sum[i] += even_taps[j] * (a + b);
                    odd_sum[i] += odd_taps[j] * (a - b);
                }
                even[i] = even_sum[i];
                odd[i] = odd_sum[i];
            }
        }
    }
}

/// The even sum alone, for a filter without an odd part.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn even_sums<T: Real>(rows: &[&[T]], taps: &[T], out: &mut [T]) {
    let radius = taps.len() - 1;
    for start in (0..out.len()).step_by(LANES) {
        let end = (start + LANES).min(out.len());
        let out = &mut out[start..end];
        let mut sum = [T::zero(); LANES];
        if out.len() == LANES {
            let centre = &rows[radius][start..end];
            for i in 0..LANES {
                sum[i] = taps[0] * centre[i];
            }
            for j in 1..=radius {
                let (a, b) = (&rows[radius + j][start..end], &rows[radius - j][start..end]);
                for i in 0..LANES {
                    sum[i] += taps[j] * (a[i] + b[i]);
                }
            }
            out.copy_from_slice(&sum);
        } else {
            for i in 0..out.len() {
                sum[i] = taps[0] * rows[radius][start + i];
                for j in 1..=radius {
                    sum[i] += taps[j] * (rows[radius + j][start + i] + rows[radius - j][start + i]);
                }
                out[i] = sum[i];
            }
        }
    }
}

/// A filter and its mirror: with the sums `even` and `odd` of `rows[0]` and `rows[1]`,
///
/// ```text
/// re, im = even_0 - odd_1, odd_0 + even_1,      mirror_re, mirror_im = even_0 + odd_1, odd_0 - even_1
/// ```
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn mirrored_sums<T: Real>(
    rows: [&[&[T]]; 2],
    even_taps: &[T],
    odd_taps: &[T],
    re: &mut [T],
    im: &mut [T],
    mirror_re: &mut [T],
    mirror_im: &mut [T],
) {
    let (radius, n) = (even_taps.len() - 1, re.len());
    for start in (0..n).step_by(LANES) {
        let count = LANES.min(n - start);
        let mut even = [[T::zero(); LANES]; 2];
        let mut odd = [[T::zero(); LANES]; 2];
        for (part, rows) in rows.into_iter().enumerate() {
            let (even, odd) = (&mut even[part], &mut odd[part]);
            if count == LANES {
                let centre = &rows[radius][start..start + LANES];
                for i in 0..LANES {
                    even[i] = even_taps[0] * centre[i];
                }
                for j in 1..=radius {
                    let above = &rows[radius + j][start..start + LANES];
                    let below = &rows[radius - j][start..start + LANES];
                    for i in 0..LANES {
                        even[i] += even_taps[j] * (above[i] + below[i]);
                        odd[i] += odd_taps[j] * (above[i] - below[i]);
                    }
                }
            } else {
                for i in 0..count {
                    even[i] = even_taps[0] * rows[radius][start + i];
                    for j in 1..=radius {
                        let (a, b) = (rows[radius + j][start + i], rows[radius - j][start + i]);
                        even[i] += even_taps[j] * (a + b);
                        odd[i] += odd_taps[j] * (a - b);
                    }
                }
            }
        }
        let [[even, others], [odd, odds]] = [even, odd];
        let mut out = [[T::zero(); LANES]; 4];
        for i in 0..LANES {
            out[0][i] = even[i] - odds[i];
            out[1][i] = odd[i] + others[i];
            out[2][i] = even[i] + odds[i];
            out[3][i] = odd[i] - others[i];
        }
        let end = start + count;
        re[start..end].copy_from_slice(&out[0][..count]);
        im[start..end].copy_from_slice(&out[1][..count]);
        mirror_re[start..end].copy_from_slice(&out[2][..count]);
        mirror_im[start..end].copy_from_slice(&out[3][..count]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn even_and_odd_sums_are_two_filters(n in 1usize..100, radius in 0usize..7) {
            let line: Vec<f64> =
                (0..n + 2 * radius).map(|x| (x as f64 * 4.27).sin() + 0.1 * x as f64).collect();
            let rows: Vec<&[f64]> = (0..=2 * radius).map(|j| &line[j..j + n]).collect();
            let taps_e: Vec<f64> = (0..=radius).map(|j| 1.0 / (j + 1) as f64).collect();
            let taps_o: Vec<f64> = (0..=radius).map(|j| j as f64).collect();
            let (mut even, mut odd) = (vec![9.0; n], vec![9.0; n]);
            even_odd_sums(&rows, &taps_e, &taps_o, &mut even, &mut odd);
            for i in 0..n {
                let (mut e, mut o) = (0.0, 0.0);
                for j in 0..=2 * radius {
                    let d = j as isize - radius as isize;
                    e += taps_e[d.unsigned_abs()] * line[i + j];
                    o += taps_o[d.unsigned_abs()] * d.signum() as f64 * line[i + j];
                }
                // Another order of at most 13 additions of values below 10.
                prop_assert!((even[i] - e).abs() < 1e-12 && (odd[i] - o).abs() < 1e-12);
            }
            let (mut alone, mut both) = (vec![9.0; n], [(); 4].map(|()| vec![9.0; n]));
            even_sums(&rows, &taps_e, &mut alone);
            prop_assert_eq!(&alone, &even);
            let [re, im, mirror_re, mirror_im] = both.each_mut().map(|line| &mut line[..]);
            let reversed: Vec<&[f64]> = rows.iter().rev().copied().collect();
            mirrored_sums([&rows, &reversed], &taps_e, &taps_o, re, im, mirror_re, mirror_im);
            for i in 0..n {
                // Reversed rows change the sign of the odd sum.
                let expected = [even[i] + odd[i], odd[i] + even[i], even[i] - odd[i], odd[i] - even[i]];
                prop_assert_eq!(both.each_ref().map(|line| line[i]), expected);
            }
        }
    }
}
