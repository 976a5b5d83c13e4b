//! The quadratic form of weighted smoothness, and its gradient.
//!
//! With a symmetric 2 x 2 weight T at every pixel and g the gradient,
//!
//! ```text
//! Q(x) = 1/2 sum_p <g_p, T_p g_p>_4,      grad Q = D' T D x
//! ```
//!
//! where `<>_4` is the mean over the four pairs of one-sided differences (left or right, up or down) at p. So every
//! difference between neighbours weighs by the mean of T_11 (or T_22) at its ends, and T_12 couples central
//! differences; the form keeps its value when the picture is mirrored or turned by 90 degrees. Differences across the
//! edge of the picture are absent. Units: T grey levels^-1 for total variation, x grey levels.

use multiversion::multiversion;
use rayon::prelude::*;

use super::vectors::block_dot;

/// Rows per task; a row's sum is its own, so that this does not show in results.
const ROWS_PER_TASK: usize = 8;

/// Weights of the differences of each pixel: three packed planes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Smoothness {
    pub(super) width: usize,
    /// T_11, T_12, T_22.
    pub(super) tensor: [Vec<f32>; 3],
}

/// The rows that a row's gradient reads: above, own, below.
struct Rows<'a> {
    p: [&'a [f32]; 3],
    /// T_12.
    mixed: [&'a [f32]; 3],
    /// T_22.
    down: [&'a [f32]; 3],
    /// T_11 of the row itself.
    right: &'a [f32],
}

impl Smoothness {
    /// The same weight everywhere, in all directions.
    pub(super) fn uniform((rows, width): (usize, usize), weight: f32) -> Self {
        let plane = |value| vec![value; rows * width];
        Self { width, tensor: [plane(weight), plane(0.0), plane(weight)] }
    }

    /// Adds `lambda D' T D p` to `q`; returns `<p, q>` after that.
    pub(super) fn add_gradient(&self, p: &[f32], lambda: f32, q: &mut [f32]) -> f64 {
        let width = self.width;
        let [right, mixed, down] = &self.tensor;
        let count = p.len() / width;
        let sums: Vec<f64> = q
            .par_chunks_mut(width)
            .with_min_len(ROWS_PER_TASK)
            .enumerate()
            .map(|(y, q)| {
                let (above, below) = (y.saturating_sub(1), (y + 1).min(count - 1));
                // Beyond the edge the transpose of a central difference changes sign.
                let mirrored =
                    |y: usize| mixed[y * width..][..width].iter().map(|t| -t).collect::<Vec<_>>();
                let three = |plane| rows_of(plane, width, [above, y, below]);
                let mut rows = Rows {
                    p: three(p),
                    mixed: three(mixed),
                    down: three(down),
                    right: &right[y * width..][..width],
                };
                let (first, last);
                if y == 0 {
                    first = mirrored(0);
                    rows.mixed[0] = &first;
                }
                if y + 1 == count {
                    last = mirrored(y);
                    rows.mixed[2] = &last;
                }
                row_gradient(&rows, lambda, q);
                block_dot(rows.p[1], q)
            })
            .collect();
        sums.iter().sum()
    }
}

fn rows_of(plane: &[f32], width: usize, rows: [usize; 3]) -> [&[f32]; 3] {
    rows.map(|y| &plane[y * width..][..width])
}

fn row_gradient(rows: &Rows<'_>, lambda: f32, q: &mut [f32]) {
    let width = q.len();
    q[0] += lambda * gradient_at(rows, 0);
    if width > 1 {
        q[width - 1] += lambda * gradient_at(rows, width - 1);
    }
    if width > 2 {
        interior(rows.p, rows.mixed, rows.down, rows.right, lambda, q);
    }
}

/// The gradient at one pixel, with the rules of the edge.
fn gradient_at(rows: &Rows<'_>, x: usize) -> f32 {
    let last = rows.right.len() - 1;
    let (west, east) = (x.saturating_sub(1), (x + 1).min(last));
    let [above, here, below] = rows.p;
    let [up, own, down] = rows.down;
    let right = rows.right;
    let flux = 0.5 * (right[x] + right[east]) * (here[east] - here[x])
        + 0.5 * (right[x] + right[west]) * (here[west] - here[x])
        + 0.5 * (own[x] + down[x]) * (below[x] - here[x])
        + 0.5 * (own[x] + up[x]) * (above[x] - here[x]);
    let across = |i: usize| rows.mixed[1][i] * (below[i] - above[i]);
    let ahead = if x == last { -across(x) } else { across(east) };
    let behind = if x == 0 { -across(x) } else { across(west) };
    let mixed = ahead - behind + rows.mixed[2][x] * (below[east] - below[west])
        - rows.mixed[0][x] * (above[east] - above[west]);
    -(flux + 0.25 * mixed)
}

/// As [`gradient_at`] for all pixels but the first and the last.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn interior(
    p: [&[f32]; 3],
    mixed: [&[f32]; 3],
    down: [&[f32]; 3],
    right: &[f32],
    lambda: f32,
    q: &mut [f32],
) {
    let n = q.len() - 2;
    let q = &mut q[1..=n];
    let [a, h, b] = p;
    let (aw, ac, ae) = (&a[..n], &a[1..=n], &a[2..n + 2]);
    let (hw, hc, he) = (&h[..n], &h[1..=n], &h[2..n + 2]);
    let (bw, bc, be) = (&b[..n], &b[1..=n], &b[2..n + 2]);
    let (rw, rc, re) = (&right[..n], &right[1..=n], &right[2..n + 2]);
    let (du, dc, dd) = (&down[0][1..=n], &down[1][1..=n], &down[2][1..=n]);
    let (mu, md) = (&mixed[0][1..=n], &mixed[2][1..=n]);
    let (mw, me) = (&mixed[1][..n], &mixed[1][2..n + 2]);
    for x in 0..n {
        let flux = (rc[x] + re[x]) * (he[x] - hc[x])
            + (rc[x] + rw[x]) * (hw[x] - hc[x])
            + (dc[x] + dd[x]) * (bc[x] - hc[x])
            + (dc[x] + du[x]) * (ac[x] - hc[x]);
        let mixed = me[x] * (be[x] - ae[x]) - mw[x] * (bw[x] - aw[x]) + md[x] * (be[x] - bw[x])
            - mu[x] * (ae[x] - aw[x]);
        q[x] -= lambda * (0.5 * flux + 0.25 * mixed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, k: f32) -> Vec<f32> {
        (0..n).map(|i| (i as f32 * k).sin() + 1.5).collect()
    }

    /// The definition: four pairs of one-sided differences per pixel.
    fn form(s: &Smoothness, x: &[f32]) -> f64 {
        let (w, h) = (s.width, x.len() / s.width);
        let at = |y: usize, c: usize| f64::from(x[y * w + c]);
        let mut sum = 0.0;
        for y in 0..h {
            for c in 0..w {
                let t: Vec<f64> = s.tensor.iter().map(|t| f64::from(t[y * w + c])).collect();
                for (ys, cs) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let gx = if cs == 1 {
                        at(y, (c + 1).min(w - 1)) - at(y, c)
                    } else {
                        at(y, c) - at(y, c.saturating_sub(1))
                    };
                    let gy = if ys == 1 {
                        at((y + 1).min(h - 1), c) - at(y, c)
                    } else {
                        at(y, c) - at(y.saturating_sub(1), c)
                    };
                    sum += 0.125 * (t[0] * gx * gx + 2.0 * t[1] * gx * gy + t[2] * gy * gy);
                }
            }
        }
        sum
    }

    #[test]
    fn gradient_is_that_of_the_form() {
        for (h, w) in [(7, 9), (1, 6), (5, 1), (2, 2), (3, 40), (1, 1)] {
            let n = h * w;
            let tensor = [wave(n, 0.3), wave(n, 1.1), wave(n, 0.7)];
            let s = Smoothness { width: w, tensor };
            let (x, y) = (wave(n, 2.3), wave(n, 1.9));
            let mut q = vec![0.0; n];
            let product = s.add_gradient(&x, 2.0, &mut q);
            // A quadratic form is half of <x, grad>, and its polar form <y, grad Q(x)>.
            assert!((product - 4.0 * form(&s, &x)).abs() < 1e-4 * (1.0 + product.abs()), "{h} {w}");
            let both: Vec<f32> = x.iter().zip(&y).map(|(a, b)| a + b).collect();
            let polar = form(&s, &both) - form(&s, &x) - form(&s, &y);
            let inner: f64 = q.iter().zip(&y).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            assert!((inner - 2.0 * polar).abs() < 1e-4 * (1.0 + inner.abs()), "{h} {w}");
        }
    }
}
