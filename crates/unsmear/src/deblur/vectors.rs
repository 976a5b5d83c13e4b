//! Arithmetic on packed pictures as vectors: sums, steps and directions of conjugate gradients.
//!
//! ```text
//! <a, b> = sum_i a_i b_i,     x <- x + alpha p,  r <- r - alpha q,     p <- r + beta p
//! ```
//!
//! Sums run over fixed blocks, in each over fixed lanes, and the blocks are added in order in `f64`: the result has the
//! same bits for any number of threads. A block of `f32` sums rounds to about 1e-6 of the sum of magnitudes.

use multiversion::multiversion;
use rayon::prelude::*;

/// Samples per block: three blocks stay in the smallest first-level cache, and a task outweighs its scheduling.
const BLOCK: usize = 1 << 13;

/// Independent partial sums: hides the latency of additions in registers of any width.
const LANES: usize = 32;

/// Inner product.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f64 {
    let blocks: Vec<f64> =
        a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(|(a, b)| block_dot(a, b)).collect();
    blocks.iter().sum()
}

/// `x + alpha p` into x, `r - alpha q` into r; returns the new `<r, r>`.
pub(super) fn step(x: &mut [f32], p: &[f32], r: &mut [f32], q: &[f32], alpha: f32) -> f64 {
    let blocks: Vec<f64> = x
        .par_chunks_mut(BLOCK)
        .zip(p.par_chunks(BLOCK))
        .zip(r.par_chunks_mut(BLOCK).zip(q.par_chunks(BLOCK)))
        .map(|((x, p), (r, q))| block_step(x, p, r, q, alpha))
        .collect();
    blocks.iter().sum()
}

/// `r + beta p` into p.
pub(super) fn direction(p: &mut [f32], r: &[f32], beta: f32) {
    p.par_chunks_mut(BLOCK).zip(r.par_chunks(BLOCK)).for_each(|(p, r)| block_direction(p, r, beta));
}

/// `a + b` into a.
pub(super) fn add(a: &mut [f32], b: &[f32]) {
    a.par_chunks_mut(BLOCK).zip(b.par_chunks(BLOCK)).for_each(|(a, b)| block_add(a, b));
}

/// `w (b - a)` into a.
pub(super) fn weighted_difference(a: &mut [f32], b: &[f32], w: &[f32]) {
    a.par_chunks_mut(BLOCK)
        .zip(b.par_chunks(BLOCK).zip(w.par_chunks(BLOCK)))
        .for_each(|(a, (b, w))| block_difference(a, b, w));
}

#[inline(always)]
fn total(lanes: &[f32; LANES]) -> f64 {
    lanes.iter().map(|&lane| f64::from(lane)).sum()
}

/// Inner product of one block, or of one row of a picture.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn block_dot(a: &[f32], b: &[f32]) -> f64 {
    let mut sums = [0.0f32; LANES];
    let whole = a.len() / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        let (a, b) = (&a[start..start + LANES], &b[start..start + LANES]);
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    for i in whole..a.len() {
        sums[i - whole] += a[i] * b[i];
    }
    total(&sums)
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn block_step(x: &mut [f32], p: &[f32], r: &mut [f32], q: &[f32], alpha: f32) -> f64 {
    let n = x.len();
    let (p, r, q) = (&p[..n], &mut r[..n], &q[..n]);
    let mut sums = [0.0f32; LANES];
    let whole = n / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        for k in 0..LANES {
            x[start + k] += alpha * p[start + k];
            let left = r[start + k] - alpha * q[start + k];
            r[start + k] = left;
            sums[k] += left * left;
        }
    }
    for i in whole..n {
        x[i] += alpha * p[i];
        r[i] -= alpha * q[i];
        sums[i - whole] += r[i] * r[i];
    }
    total(&sums)
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn block_direction(p: &mut [f32], r: &[f32], beta: f32) {
    let r = &r[..p.len()];
    for i in 0..p.len() {
        p[i] = r[i] + beta * p[i];
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn block_add(a: &mut [f32], b: &[f32]) {
    let b = &b[..a.len()];
    for i in 0..a.len() {
        a[i] += b[i];
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn block_difference(a: &mut [f32], b: &[f32], w: &[f32]) {
    let (b, w) = (&b[..a.len()], &w[..a.len()]);
    for i in 0..a.len() {
        a[i] = w[i] * (b[i] - a[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, phase: f32) -> Vec<f32> {
        (0..n).map(|i| (i as f32 * 0.7 + phase).sin()).collect()
    }

    #[test]
    fn sums_are_those_of_double_precision() {
        for n in [0, 1, 31, 32, 33, BLOCK + 5, 3 * BLOCK] {
            let (a, b) = (wave(n, 0.1), wave(n, 0.4));
            let exact: f64 = a.iter().zip(&b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            // Lanes of 256 terms below 1 in single precision.
            assert!((dot(&a, &b) - exact).abs() <= 2e-6 * n as f64, "{n}");
            let (mut x, mut r) = (a.clone(), b.clone());
            let left = step(&mut x, &b, &mut r, &a, 0.5);
            let expected: f64 = r.iter().map(|&r| f64::from(r).powi(2)).sum();
            assert!((left - expected).abs() <= 2e-6 * n as f64);
            assert!((0..n).all(|i| x[i] == a[i] + 0.5 * b[i] && r[i] == b[i] - 0.5 * a[i]));
        }
    }

    #[test]
    fn elementwise_forms_are_their_equations() {
        let (a, b, w) = (wave(100, 0.0), wave(100, 1.0), wave(100, 2.0));
        let mut out = a.clone();
        direction(&mut out, &b, 0.25);
        assert!((0..100).all(|i| out[i] == b[i] + 0.25 * a[i]));
        out.clone_from(&a);
        weighted_difference(&mut out, &b, &w);
        assert!((0..100).all(|i| out[i] == w[i] * (b[i] - a[i])));
        out.clone_from(&a);
        add(&mut out, &b);
        assert!((0..100).all(|i| out[i] == a[i] + b[i]));
    }
}
