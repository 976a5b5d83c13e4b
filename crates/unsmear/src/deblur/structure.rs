//! Weights that make a quadratic form touch total variation, from the structure of the current picture.
//!
//! With the structure tensor J = K * mean_c g_c g_c' of the gradient g (mean over channels c and over the four pairs of
//! one-sided differences, K the binomial window [1 2 1] x [1 2 1] / 16), the prior is
//!
//! ```text
//! R(x) = sum_p trace (J_p + eps^2 I)^(1/2),       T = K * (J + eps^2 I)^(-1/2),      R(y) <= R(x) + Q(y) - Q(x)
//! ```
//!
//! where Q is the form of `smoothness.rs` with weights T: minimising Q and renewing T lowers R at every turn. Along an
//! edge T is large (1 / eps), across it small (1 / contrast). Without the window, and with the trace taken before the
//! root, R is isotropic total variation.
//!
//! Sources: L. I. Rudin, S. Osher & E. Fatemi, Physica D 60 (1992) 259-268,
//! [10.1016/0167-2789(92)90242-F](https://doi.org/10.1016/0167-2789(92)90242-F), for total variation; S. Lefkimmiatis,
//! A. Roussos, P. Maragos & M. Unser, SIAM J. Imaging Sci. 8 (2015) 1090-1122,
//! [10.1137/14098154X](https://doi.org/10.1137/14098154X), for that of the structure tensor.

use multiversion::multiversion;
use rayon::prelude::*;

use super::smoothness::Smoothness;

/// Rows per task.
const ROWS_PER_TASK: usize = 8;

/// Outer samples of the window [1 2 1] / 4.
const SIDE: f32 = 0.25;

/// How gradients become weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Gradient below which the prior is quadratic, grey levels per px, > 0.
    pub rounding: f32,
    /// Whether neighbouring gradients share one structure tensor; else isotropic total variation.
    pub structure: bool,
}

impl Prior {
    /// Renews the weights of `smoothness` from the picture `channels`; `scratch` holds three planes, and afterwards
    /// nothing of meaning.
    pub(super) fn renew(
        &self,
        channels: &[Vec<f32>],
        smoothness: &mut Smoothness,
        scratch: [&mut Vec<f32>; 3],
    ) {
        let width = smoothness.width;
        let [s0, s1, s2] = scratch;
        let [t0, t1, t2] = &mut smoothness.tensor;
        for_rows([s0, s1, s2], width, |y, out| {
            out.iter_mut().for_each(|row| row.fill(0.0));
            for x in channels {
                let three = neighbours(x, width, y);
                add_products(three, 1.0 / channels.len() as f32, out);
            }
        });
        let side = if self.structure { SIDE } else { 0.0 };
        let source = [&s0[..], &s1[..], &s2[..]];
        for_rows([t0, t1, t2], width, |y, out| {
            window(source, width, y, side, out);
            inverse_root(self.rounding, self.structure, out);
        });
        if side > 0.0 {
            let source = [&t0[..], &t1[..], &t2[..]];
            for_rows([s0, s1, s2], width, |y, out| window(source, width, y, side, out));
            std::mem::swap(t0, s0);
            std::mem::swap(t1, s1);
            std::mem::swap(t2, s2);
        }
    }
}

/// Runs `row` on each row of three planes in parallel.
fn for_rows(
    planes: [&mut Vec<f32>; 3],
    width: usize,
    row: impl Fn(usize, &mut [&mut [f32]; 3]) + Sync,
) {
    let [a, b, c] = planes;
    a.par_chunks_mut(width)
        .zip(b.par_chunks_mut(width).zip(c.par_chunks_mut(width)))
        .with_min_len(ROWS_PER_TASK)
        .enumerate()
        .for_each(|(y, (a, (b, c)))| row(y, &mut [a, b, c]));
}

fn neighbours(plane: &[f32], width: usize, y: usize) -> [&[f32]; 3] {
    let last = plane.len() / width - 1;
    [y.saturating_sub(1), y, (y + 1).min(last)].map(|y| &plane[y * width..][..width])
}

/// Adds `share` times the products of the gradient of one row to J_11, J_12, J_22.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_products(rows: [&[f32]; 3], share: f32, out: &mut [&mut [f32]; 3]) {
    let [above, here, below] = rows;
    let n = here.len();
    let (above, below) = (&above[..n], &below[..n]);
    let [a, b, c] = out;
    let (a, b, c) = (&mut a[..n], &mut b[..n], &mut c[..n]);
    let mut west = 0.0;
    for x in 0..n {
        let east = if x + 1 < n { here[x + 1] - here[x] } else { 0.0 };
        let (north, south) = (here[x] - above[x], below[x] - here[x]);
        a[x] += 0.5 * share * (east * east + west * west);
        b[x] += 0.25 * share * (east + west) * (north + south);
        c[x] += 0.5 * share * (north * north + south * south);
        west = east;
    }
}

/// The three planes of row `y` averaged with [side, 1 - 2 side, side] along both axes.
fn window(source: [&[f32]; 3], width: usize, y: usize, side: f32, out: &mut [&mut [f32]; 3]) {
    for (plane, out) in source.into_iter().zip(out) {
        let rows = neighbours(plane, width, y);
        if side == 0.0 {
            out.copy_from_slice(rows[1]);
        } else {
            let mut line = vec![0.0; width];
            average(rows, side, &mut line);
            let last = width - 1;
            average([&line[..1], &line[..1], &line[last.min(1)..][..1]], side, &mut out[..1]);
            let before = last.saturating_sub(1);
            let end = &line[last..];
            average([&line[before..][..1], end, end], side, &mut out[last..]);
            if width > 2 {
                let n = width - 2;
                average([&line[..n], &line[1..=n], &line[2..]], side, &mut out[1..=n]);
            }
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn average(from: [&[f32]; 3], side: f32, out: &mut [f32]) {
    let n = out.len();
    let [a, b, c] = from.map(|row| &row[..n]);
    let middle = 1.0 - 2.0 * side;
    for x in 0..n {
        out[x] = middle * b[x] + side * (a[x] + c[x]);
    }
}

/// J of a row replaced by (J + eps^2 I)^(-1/2), or by trace^(-1/2) I.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn inverse_root(rounding: f32, structure: bool, rows: &mut [&mut [f32]; 3]) {
    let [a, b, c] = rows;
    let n = a.len();
    let (b, c) = (&mut b[..n], &mut c[..n]);
    let floor = rounding * rounding;
    if !structure {
        for x in 0..n {
            let weight = 1.0 / (a[x] + c[x] + floor).sqrt();
            a[x] = weight;
            b[x] = 0.0;
            c[x] = weight;
        }
        return;
    }
    for x in 0..n {
        let (p, q) = (a[x] + floor, c[x] + floor);
        // M^(1/2) = (M + s I) / t with s = sqrt(det M), t = sqrt(trace M + 2 s); the inverse of that is its adjugate over s.
        let det = p * q - b[x] * b[x];
        let s = (if det > floor * floor { det } else { floor * floor }).sqrt();
        let scale = 1.0 / (s * (p + q + 2.0 * s).sqrt());
        a[x] = (q + s) * scale;
        c[x] = (p + s) * scale;
        b[x] *= -scale;
    }
}
