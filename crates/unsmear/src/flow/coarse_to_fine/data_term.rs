//! Normal equations of the phase constraints, reweighted by their residuals.
//!
//! For the present flow `U` and the flow `U_0` that the frames were warped with, `d = U - U_0`,
//!
//! ```text
//! r = G.d + D,   w = W/(1 + (r/r_s)^2)
//! A = s sum w G G',   b = s sum w G D,   c = A U_0 - b,   s = 1/(k0^2 N F)
//! ```
//!
//! summed over `N` filters and `F` frames: `A U = c` is the data part of the equations for the whole
//! flow, dimensionless, of trace about 1 where every filter has full weight. The reweighting is that
//! of the Lorentzian `log(1 + (r/r_s)^2)`: a constraint on another motion, or wrapped by 2 pi, loses
//! its say. Reference: M. J. Black & P. Anandan 1996 (doi 10.1006/cviu.1996.0006).

use multiversion::multiversion;

use super::phase_constraint::TERMS;
use super::rows::{Planes, for_each_rows};
use crate::control::Control;
use crate::error::Result;

/// The planes `a11, a12, a22, c1, c2`, (H, W) each.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations {
    pub(super) a11: Vec<f32>,
    pub(super) a12: Vec<f32>,
    pub(super) a22: Vec<f32>,
    pub(super) c1: Vec<f32>,
    pub(super) c2: Vec<f32>,
}

impl NormalEquations {
    /// No data anywhere.
    pub(super) fn zeros(samples: usize) -> Self {
        let zeros = || vec![0.0; samples];
        Self { a11: zeros(), a12: zeros(), a22: zeros(), c1: zeros(), c2: zeros() }
    }
}

/// Residual scale `r_s` (rad) and factor `s` of the sums.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reweighting {
    pub(super) residual: f32,
    pub(super) scale: f32,
}

/// Computes the equations at `flow` from the constraints of each frame, warped with `warped_with`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn accumulate(
    frames: &[&[f32]],
    flow: Planes<'_>,
    warped_with: Planes<'_>,
    width: usize,
    reweighting: Reweighting,
    out: &mut NormalEquations,
    control: &Control,
) -> Result<()> {
    let NormalEquations { a11, a12, a22, c1, c2 } = out;
    let per_row = frames[0].len() / (a11.len() / width);
    for_each_rows([a11, a12, a22, c1, c2], [width; 5], control, |y, rows| {
        let [a11, a12, a22, c1, c2] = rows;
        let row = |plane: &[f32]| y * width..((y + 1) * width).min(plane.len());
        let [u, v] = flow.map(|plane| &plane[row(plane)]);
        let [u0, v0] = warped_with.map(|plane| &plane[row(plane)]);
        [&mut *a11, &mut *a12, &mut *a22, &mut *c1, &mut *c2].into_iter().for_each(|p| p.fill(0.0));
        for constraints in frames {
            let filters = &constraints[y * per_row..(y + 1) * per_row];
            for terms in filters.chunks_exact(TERMS * width) {
                add(terms, [u, v], [u0, v0], reweighting, a11, a12, a22, c1, c2);
            }
        }
        to_whole_flow([u0, v0], a11, a12, a22, c1, c2);
    })
}

/// Adds one filter's `A` and `b` (in place of `c`) on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(
    terms: &[f32],
    [u, v]: Planes<'_>,
    [u0, v0]: Planes<'_>,
    reweighting: Reweighting,
    a11: &mut [f32],
    a12: &mut [f32],
    a22: &mut [f32],
    b1: &mut [f32],
    b2: &mut [f32],
) {
    let n = a11.len();
    let (a12, a22, b1, b2) = (&mut a12[..n], &mut a22[..n], &mut b1[..n], &mut b2[..n]);
    let (u, v, u0, v0) = (&u[..n], &v[..n], &u0[..n], &v0[..n]);
    let (gx, gy) = (&terms[..n], &terms[n..2 * n]);
    let (step, weight) = (&terms[2 * n..3 * n], &terms[3 * n..4 * n]);
    let Reweighting { residual, scale } = reweighting;
    let inverse = 1.0 / residual;
    for x in 0..n {
        let r = (gx[x] * (u[x] - u0[x]) + gy[x] * (v[x] - v0[x]) + step[x]) * inverse;
        let w = scale * weight[x] / (1.0 + r * r);
        let (wx, wy) = (w * gx[x], w * gy[x]);
        a11[x] += wx * gx[x];
        a12[x] += wx * gy[x];
        a22[x] += wy * gy[x];
        b1[x] += wx * step[x];
        b2[x] += wy * step[x];
    }
}

/// `c = A U_0 - b` in place of `b`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn to_whole_flow(
    [u0, v0]: Planes<'_>,
    a11: &[f32],
    a12: &[f32],
    a22: &[f32],
    b1: &mut [f32],
    b2: &mut [f32],
) {
    let n = b1.len();
    let (a11, a12, a22, b2) = (&a11[..n], &a12[..n], &a22[..n], &mut b2[..n]);
    let (u0, v0) = (&u0[..n], &v0[..n]);
    for x in 0..n {
        b1[x] = a11[x] * u0[x] + a12[x] * v0[x] - b1[x];
        b2[x] = a12[x] * u0[x] + a22[x] * v0[x] - b2[x];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constraints that are all fulfilled by one flow: it solves `A U = c`, whatever the weights.
    #[test]
    fn the_flow_that_fulfils_all_constraints_solves_the_equations() {
        let (width, height, filters) = (5, 2, 4);
        let (start, truth) = ([0.4f32, -0.2], [1.1f32, 0.3]);
        let mut constraints = vec![0.0; height * filters * TERMS * width];
        for (i, terms) in constraints.chunks_mut(TERMS * width).enumerate() {
            let angle = 0.7 * i as f32;
            let g = [1.5 * angle.cos(), 1.5 * angle.sin()];
            for x in 0..width {
                terms[x] = g[0];
                terms[width + x] = g[1];
                terms[2 * width + x] = -g[0] * (truth[0] - start[0]) - g[1] * (truth[1] - start[1]);
                terms[3 * width + x] = 0.1 + 0.2 * x as f32;
            }
        }
        let n = width * height;
        let plane = |value: f32| vec![value; n];
        let (u0, v0, u, v) = (plane(start[0]), plane(start[1]), plane(0.0), plane(0.9));
        let mut equations = NormalEquations::zeros(n);
        let reweighting = Reweighting { residual: 0.5, scale: 0.3 };
        let (flow, with) = ([&u[..], &v[..]], [&u0[..], &v0[..]]);
        accumulate(
            &[&constraints],
            flow,
            with,
            width,
            reweighting,
            &mut equations,
            &Control::new(),
        )
        .unwrap();
        let e = &equations;
        for i in 0..n {
            let left = e.a11[i] * truth[0] + e.a12[i] * truth[1];
            assert!(e.a11[i] > 0.0 && (left - e.c1[i]).abs() < 1e-6);
            let left = e.a12[i] * truth[0] + e.a22[i] * truth[1];
            assert!(e.a22[i] > 0.0 && (left - e.c2[i]).abs() < 1e-6);
        }
    }

    /// `A U - c` is the gradient of the robust energy, by central differences of it.
    #[test]
    fn the_equations_are_the_gradient_of_the_energy() {
        let constraints = [[1.2f32, -0.4, 0.3, 0.8], [0.1, 1.5, -1.1, 0.5], [-0.9, 1.0, 2.5, 1.0]];
        let (start, flow) = ([0.3f32, 0.1], [0.9f32, -0.4]);
        let energy = |at: [f64; 2]| -> f64 {
            let along = |g: f32, i: usize| f64::from(g) * (at[i] - f64::from(start[i]));
            let term = |[gx, gy, d, w]: [f32; 4]| {
                let r = (along(gx, 0) + along(gy, 1) + f64::from(d)) / 0.6;
                0.7 * 0.5 * 0.36 * f64::from(w) * (1.0 + r * r).ln()
            };
            constraints.into_iter().map(term).sum()
        };
        let reweighting = Reweighting { residual: 0.6, scale: 0.7 };
        let (terms, mut e) = (constraints.concat(), NormalEquations::zeros(1));
        let (u, v, u0, v0) = ([flow[0]], [flow[1]], [start[0]], [start[1]]);
        let control = Control::new();
        accumulate(&[&terms], [&u, &v], [&u0, &v0], 1, reweighting, &mut e, &control).unwrap();
        let (h, [u, v]) = (1e-5, flow.map(f64::from));
        let numeric = [
            (energy([u + h, v]) - energy([u - h, v])) / (2.0 * h),
            (energy([u, v + h]) - energy([u, v - h])) / (2.0 * h),
        ];
        let found = [
            e.a11[0] * flow[0] + e.a12[0] * flow[1] - e.c1[0],
            e.a12[0] * flow[0] + e.a22[0] * flow[1] - e.c2[0],
        ];
        // Single precision sums of terms of order one.
        assert!((numeric[0] - f64::from(found[0])).abs() < 1e-6);
        assert!((numeric[1] - f64::from(found[1])).abs() < 1e-6);
    }

    #[test]
    fn a_residual_of_the_scale_halves_the_weight() {
        let terms = [1.0, 0.0, 0.5, 1.0];
        let mut sums = [[0.0f32]; 5];
        let [a, b, c, d, e] = &mut sums;
        let reweighting = Reweighting { residual: 0.5, scale: 1.0 };
        add(&terms, [&[0.0], &[0.0]], [&[0.0], &[0.0]], reweighting, a, b, c, d, e);
        assert_eq!(sums, [[0.5], [0.0], [0.0], [0.25], [0.0]]);
    }
}
