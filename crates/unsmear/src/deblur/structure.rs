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

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (6, 7);

    fn wave(k: f32) -> Vec<f32> {
        (0..SIZE.0 * SIZE.1).map(|i| 20.0 * (i as f32 * k).sin() + (i % 5) as f32).collect()
    }

    /// The prior by its definition: gradients, window, trace of the root.
    fn value(prior: &Prior, channels: &[Vec<f32>]) -> f64 {
        let (h, w) = SIZE;
        let clamp = |i: isize, n: usize| i.clamp(0, n as isize - 1) as usize;
        let product = |y: usize, x: usize| {
            let mut j = [0.0; 3];
            for c in channels {
                let at = |y: isize, x: isize| f64::from(c[clamp(y, h) * w + clamp(x, w)]);
                let (y, x) = (y as isize, x as isize);
                for gx in [at(y, x + 1) - at(y, x), at(y, x) - at(y, x - 1)] {
                    for gy in [at(y + 1, x) - at(y, x), at(y, x) - at(y - 1, x)] {
                        let share = 0.25 / channels.len() as f64;
                        j = [
                            j[0] + share * gx * gx,
                            j[1] + share * gx * gy,
                            j[2] + share * gy * gy,
                        ];
                    }
                }
            }
            j
        };
        let side = if prior.structure { f64::from(SIDE) } else { 0.0 };
        let mut sum = 0.0;
        for y in 0..h as isize {
            for x in 0..w as isize {
                let mut j = [0.0; 3];
                for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
                    let of = |d: isize| if d == 0 { 1.0 - 2.0 * side } else { side };
                    let share = of(dy) * of(dx);
                    let there = product(clamp(y + dy, h), clamp(x + dx, w));
                    (0..3).for_each(|k| j[k] += share * there[k]);
                }
                let floor = f64::from(prior.rounding).powi(2);
                sum += if prior.structure {
                    let (a, c) = (j[0] + floor, j[2] + floor);
                    // trace M^(1/2) = sqrt(trace M + 2 sqrt(det M)).
                    (a + c + 2.0 * (a * c - j[1] * j[1]).sqrt()).sqrt()
                } else {
                    (j[0] + j[2] + floor).sqrt()
                };
            }
        }
        sum
    }

    #[test]
    fn weights_give_the_gradient_of_the_prior() {
        for structure in [false, true] {
            let prior = Prior { rounding: 0.5, structure };
            let channels = [wave(0.9), wave(1.7)];
            let mut smoothness = Smoothness::uniform(SIZE, 1.0);
            let mut scratch = [(); 3].map(|()| vec![f32::NAN; SIZE.0 * SIZE.1]);
            let [a, b, c] = &mut scratch;
            prior.renew(&channels, &mut smoothness, [a, b, c]);
            let mut gradient = vec![0.0; SIZE.0 * SIZE.1];
            smoothness.add_gradient(&channels[0], 1.0, &mut gradient);
            for i in 0..gradient.len() {
                let moved = |by: f32| {
                    let mut other = channels.clone();
                    other[0][i] += by;
                    value(&prior, &other)
                };
                let slope = (moved(0.02) - moved(-0.02)) / 0.04;
                // The mean over two channels halves the form's gradient; single precision and third derivatives.
                assert!((slope - 0.5 * f64::from(gradient[i])).abs() < 2e-3, "{structure} {i}");
            }
        }
    }
}
