//! Median over 5 x 5 pixels.
//!
//! ```text
//! out(y, x) = the 13th smallest of plane(y + j, x + i),   i, j = -2..2
//! ```
//!
//! Beyond the picture its edge pixels continue. Units are those of the plane. Validity: no NaN (the result would be
//! some sample of the window).
//!
//! Selection: every column of five is sorted once and serves the five windows that contain it. Sorting the rows of a
//! window then keeps its columns sorted, and entry (i, j) of such a matrix, counted from 0, has (i + 1)(j + 1) - 1
//! others not above it and (5 - i)(5 - j) - 1 not below it. The median has twelve of either, so that only entries with no
//! more remain, on three diagonals:
//!
//! ```text
//! P = {(0,3), (1,2), (2,1), (3,0)},   Q = {(0,4), (1,3), (2,2), (3,1), (4,0)},   R = {(1,4), (2,3), (3,2), (4,1)}
//! ```
//!
//! With six dropped below and six above, the median is the 7th of these 13. The third smallest of P has the largest of
//! P above it, and of Q and R at least six more: it cannot be the 7th, nor can those below it. So of P only the largest
//! remains, likewise of R the smallest, and the median is the 4th of the seven values max P, Q, min R.

use multiversion::multiversion;

use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::{Error, Result};

/// Pixels on either side of the centre.
const REACH: usize = 2;

/// Writes the 5 x 5 median of `plane` (packed rows of `width` samples, `height` of them) to `out`.
///
/// # Errors
/// [`Error::Shape`] when a slice has not height x width samples; [`Error::Cancelled`].
pub fn median_5x5(
    plane: &[f32],
    height: usize,
    width: usize,
    out: &mut [f32],
    control: &Control,
) -> Result<()> {
    for (argument, got) in [("plane", plane.len()), ("out", out.len())] {
        if got != height * width {
            return Err(Error::shape(argument, format!("({height} x {width},)"), &[got]));
        }
    }
    let padded = width + 2 * REACH;
    let scratch = || vec![0.0; 5 * padded];
    for_each_row_with(out, width, control, scratch, |y, out, columns| {
        let rows = [0, 1, 2, 3, 4].map(|j| {
            let y = (y + j).saturating_sub(REACH).min(height - 1);
            &plane[y * width..][..width]
        });
        let [first, second, third, fourth, fifth] = five_rows(columns, padded);
        let inner = REACH..REACH + width;
        sort_columns(
            rows,
            &mut first[inner.clone()],
            &mut second[inner.clone()],
            &mut third[inner.clone()],
            &mut fourth[inner.clone()],
            &mut fifth[inner],
        );
        for row in columns.chunks_exact_mut(padded) {
            let (left, right) = (row[REACH], row[REACH + width - 1]);
            row[..REACH].fill(left);
            row[REACH + width..].fill(right);
        }
        middles(columns, padded, out);
    })
}

/// Five rows of `length` samples.
fn five_rows(samples: &mut [f32], length: usize) -> [&mut [f32]; 5] {
    let (first, rest) = samples.split_at_mut(length);
    let (second, rest) = rest.split_at_mut(length);
    let (third, rest) = rest.split_at_mut(length);
    let (fourth, fifth) = rest.split_at_mut(length);
    [first, second, third, fourth, fifth]
}

/// Sorts each column of `rows`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn sort_columns(
    rows: [&[f32]; 5],
    first: &mut [f32],
    second: &mut [f32],
    third: &mut [f32],
    fourth: &mut [f32],
    fifth: &mut [f32],
) {
    let n = first.len();
    let [a, b, c, d, e] = rows;
    let (a, b, c, d, e) = (&a[..n], &b[..n], &c[..n], &d[..n], &e[..n]);
    let (second, third) = (&mut second[..n], &mut third[..n]);
    let (fourth, fifth) = (&mut fourth[..n], &mut fifth[..n]);
    for x in 0..n {
        let sorted = sorted(a[x], b[x], c[x], d[x], e[x]);
        (first[x], second[x], third[x], fourth[x], fifth[x]) = sorted;
    }
}

/// Medians of windows of five sorted columns.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn middles(columns: &[f32], padded: usize, out: &mut [f32]) {
    let n = out.len();
    let (r0, r1) = (&columns[..n + 4], &columns[padded..][..n + 4]);
    let (r2, r3) = (&columns[2 * padded..][..n + 4], &columns[3 * padded..][..n + 4]);
    let r4 = &columns[4 * padded..][..n + 4];
    for x in 0..n {
        let (p0, q0) = top_two(r0[x], r0[x + 1], r0[x + 2], r0[x + 3], r0[x + 4]);
        let (_, _, p1, q1, r1) = sorted(r1[x], r1[x + 1], r1[x + 2], r1[x + 3], r1[x + 4]);
        let (_, p2, q2, r2, _) = sorted(r2[x], r2[x + 1], r2[x + 2], r2[x + 3], r2[x + 4]);
        let (p3, q3, r3, _, _) = sorted(r3[x], r3[x + 1], r3[x + 2], r3[x + 3], r3[x + 4]);
        let (q4, r4) = bottom_two(r4[x], r4[x + 1], r4[x + 2], r4[x + 3], r4[x + 4]);
        let p = upper(upper(p0, p1), upper(p2, p3));
        let r = lower(lower(r1, r2), lower(r3, r4));
        out[x] = middle_of_seven(q0, q1, q2, q3, q4, p, r);
    }
}

/// The lesser, in the form of the machine instruction.
#[inline(always)]
fn lower(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater, in the form of the machine instruction.
#[inline(always)]
fn upper(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Both in order.
#[inline(always)]
fn order(a: f32, b: f32) -> (f32, f32) {
    (lower(a, b), upper(a, b))
}

/// All five in order: the fifth is inserted into the other four. What a caller ignores costs nothing.
#[inline(always)]
fn sorted(a: f32, b: f32, c: f32, d: f32, e: f32) -> (f32, f32, f32, f32, f32) {
    let ((a, b), (c, d)) = (order(a, b), order(c, d));
    let ((a, c), (b, d)) = (order(a, c), order(b, d));
    let (b, c) = order(b, c);
    let (e, fifth) = order(d, e);
    let (e, fourth) = order(c, e);
    let (e, third) = order(b, e);
    let (first, second) = order(a, e);
    (first, second, third, fourth, fifth)
}

/// The second greatest and the greatest.
#[inline(always)]
fn top_two(a: f32, b: f32, c: f32, d: f32, e: f32) -> (f32, f32) {
    let ((a, b), (c, d)) = (order(a, b), order(c, d));
    let second = upper(lower(b, d), upper(a, c));
    let (rest, greatest) = order(upper(b, d), e);
    (upper(second, rest), greatest)
}

/// The least and the second least.
#[inline(always)]
fn bottom_two(a: f32, b: f32, c: f32, d: f32, e: f32) -> (f32, f32) {
    let ((a, b), (c, d)) = (order(a, b), order(c, d));
    let second = lower(upper(a, c), lower(b, d));
    let (least, rest) = order(lower(a, c), e);
    (least, lower(second, rest))
}

/// The 4th of seven. Of any five the least and the greatest cannot be it, then of four, then of three.
#[inline(always)]
fn middle_of_seven(a: f32, b: f32, c: f32, d: f32, e: f32, f: f32, g: f32) -> f32 {
    let ((a, b), (c, d)) = (order(a, b), order(c, d));
    let ((a, c), (b, d)) = (order(a, c), order(b, d));
    // a is the least and d the greatest of four: of these two and e the middle one stays.
    let kept = upper(a, lower(d, e));
    let ((p, q), (r, s)) = (order(b, c), order(kept, f));
    let (p, q) = order(upper(p, r), lower(q, s));
    upper(p, lower(q, g))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn median(plane: &[f32], height: usize, width: usize) -> Vec<f32> {
        let mut out = vec![f32::NAN; height * width];
        median_5x5(plane, height, width, &mut out, &Control::new()).unwrap();
        out
    }

    /// The slow twin: sorts every window.
    fn slow(plane: &[f32], height: usize, width: usize) -> Vec<f32> {
        let near = |i: usize, k: usize, n: usize| (i + k).saturating_sub(2).min(n - 1);
        let at = |y: usize, x: usize| {
            let sample = |k: usize| plane[near(y, k / 5, height) * width + near(x, k % 5, width)];
            let mut window: Vec<f32> = (0..25).map(sample).collect();
            window.sort_by(f32::total_cmp);
            window[12]
        };
        (0..height * width).map(|i| at(i / width, i % width)).collect()
    }

    proptest! {
        #[test]
        fn equals_the_sort(
            (height, width, plane) in (1usize..12, 1usize..40).prop_flat_map(|(h, w)| {
                // Few values: many ties.
                let sample = prop_oneof![-4i8..4, any::<i8>()].prop_map(f32::from);
                (Just(h), Just(w), prop::collection::vec(sample, h * w))
            }),
        ) {
            prop_assert_eq!(median(&plane, height, width), slow(&plane, height, width));
        }

        /// By the 0-1 principle: a network of minima and maxima that selects from zeros and ones selects from all.
        #[test]
        fn selects_the_13th_of_zeros_and_ones(window: [bool; 25]) {
            let plane = window.map(|one| f32::from(u8::from(one)));
            let middle = median(&plane, 5, 5)[12];
            prop_assert_eq!(middle == 1.0, window.iter().filter(|one| **one).count() >= 13);
        }
    }

    #[test]
    fn ramps_pass_and_outliers_do_not() {
        let ramp: Vec<f32> = (0..9 * 11).map(|i| (i / 11) as f32 - 2.0 * (i % 11) as f32).collect();
        let mut spoilt = ramp.clone();
        spoilt[4 * 11 + 5] = 1e9;
        let (clean, mended) = (median(&ramp, 9, 11), median(&spoilt, 9, 11));
        assert_eq!(clean[4 * 11 + 5], ramp[4 * 11 + 5]);
        // One outlier among 25 moves the median by at most one rank, here half a unit or one.
        assert!((mended[4 * 11 + 5] - ramp[4 * 11 + 5]).abs() <= 1.0);
    }

    #[test]
    fn same_bits_for_any_number_of_threads_and_refusals() {
        let plane: Vec<f32> = (0..67 * 41).map(|i| ((i * i) % 101) as f32).collect();
        let one = median(&plane, 67, 41);
        for threads in [2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| median(&plane, 67, 41)), one);
        }
        let control = Control::new();
        let error = median_5x5(&plane[..5], 2, 3, &mut [0.0; 6], &control);
        assert_eq!(error, Err(Error::shape("plane", "(2 x 3,)", &[5])));
        control.cancel();
        let error = median_5x5(&plane[..6], 2, 3, &mut [0.0; 6], &control);
        assert_eq!(error, Err(Error::Cancelled));
    }
}
