//! Normal equations of the phase constraints, reweighted by their residuals.
//!
//! For the present flow `U` and the flow `U_0` that the frames were warped with, `d = U - U_0`,
//!
//! ```text
//! r = G.d + D,   w = W/(1 + (r/r_s)^2)
//! A = s sum w G G',   b = s sum w G D,   s = 1/(k0^2 N F)
//! g (A + S I) U = c = g (A U_0 - b)
//! ```
//!
//! summed over `N` filters and `F` frames: the data part of the equations for the whole flow,
//! dimensionless, `A` of trace about 1 where every filter has full weight. `S` is the pull to rest
//! (see [`super::still`]), `g` the precision (see [`super::precision`]). The equations of a row are made when the
//! solver wants them and kept nowhere else. The reweighting is that
//! of the Lorentzian `log(1 + (r/r_s)^2)`: a constraint on another motion, or wrapped by 2 pi, loses
//! its say. Reference: M. J. Black & P. Anandan 1996 (doi 10.1006/cviu.1996.0006).

use multiversion::multiversion;

use super::constraints::{Constraints, Units};
use super::rows::Planes;

/// Residual scale `r_s` (rad) and factor `s` of the sums.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reweighting {
    pub(super) residual: f32,
    pub(super) scale: f32,
}

/// The constraints of all frames on the flow around the one they were warped with.
pub(super) struct DataTerm<'a> {
    pub(super) frames: Vec<&'a Constraints>,
    /// `U_0`, (H, W).
    pub(super) warped_with: Planes<'a>,
    pub(super) reweighting: Reweighting,
    /// Pull towards rest, added to the diagonal; see [`super::still`].
    pub(super) springs: &'a [f32],
    /// Factor of all data; see [`super::precision`].
    pub(super) gain: &'a [f32],
    pub(super) width: usize,
}

impl DataTerm<'_> {
    /// Fills the rows `a11, a12, a22, c1, c2` of row `y` with the equations at `flow`.
    pub(super) fn equations(&self, y: usize, flow: Planes<'_>, out: [&mut [f32]; 5]) {
        let [a11, a12, a22, c1, c2] = out;
        let row = |plane: &[f32]| y * self.width..((y + 1) * self.width).min(plane.len());
        let [u, v] = flow.map(|plane| &plane[row(plane)]);
        let [u0, v0] = self.warped_with.map(|plane| &plane[row(plane)]);
        [&mut *a11, &mut *a12, &mut *a22, &mut *c1, &mut *c2].into_iter().for_each(|p| p.fill(0.0));
        for constraints in &self.frames {
            let (filters, units) = constraints.row(y);
            for terms in filters {
                add(terms, units, [u, v], [u0, v0], self.reweighting, a11, a12, a22, c1, c2);
            }
        }
        let (springs, gain) = (&self.springs[row(self.springs)], &self.gain[row(self.gain)]);
        to_whole_flow([u0, v0], [springs, gain], a11, a12, a22, c1, c2);
    }
}

/// Adds one filter's `A` and `b` (in place of `c`) on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(
    terms: &[i16],
    units: Units,
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
    let (slope_x, slope_y) = (&terms[..n], &terms[n..2 * n]);
    let (steps, roots) = (&terms[2 * n..3 * n], &terms[3 * n..4 * n]);
    let Reweighting { residual, scale } = reweighting;
    let (inverse, scale) = (1.0 / residual, scale * units.root * units.root);
    for x in 0..n {
        let (gx, gy) = (f32::from(slope_x[x]) * units.slope, f32::from(slope_y[x]) * units.slope);
        let (step, root) = (f32::from(steps[x]) * units.step, f32::from(roots[x]));
        let r = (gx * (u[x] - u0[x]) + gy * (v[x] - v0[x]) + step) * inverse;
        let w = scale * (root * root) / (1.0 + r * r);
        let (wx, wy) = (w * gx, w * gy);
        a11[x] += wx * gx;
        a12[x] += wx * gy;
        a22[x] += wy * gy;
        b1[x] += wx * step;
        b2[x] += wy * step;
    }
}

/// `g (A + S I)`, and `g (A U_0 - b)` in place of `b`: a spring `S` to rest has no right-hand side.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn to_whole_flow(
    [u0, v0]: Planes<'_>,
    [springs, gain]: Planes<'_>,
    a11: &mut [f32],
    a12: &mut [f32],
    a22: &mut [f32],
    b1: &mut [f32],
    b2: &mut [f32],
) {
    let n = b1.len();
    let (a11, a12, a22, b2) = (&mut a11[..n], &mut a12[..n], &mut a22[..n], &mut b2[..n]);
    let (u0, v0, springs, gain) = (&u0[..n], &v0[..n], &springs[..n], &gain[..n]);
    for x in 0..n {
        let g = gain[x];
        b1[x] = (a11[x] * u0[x] + a12[x] * v0[x] - b1[x]) * g;
        b2[x] = (a12[x] * u0[x] + a22[x] * v0[x] - b2[x]) * g;
        a11[x] = (a11[x] + springs[x]) * g;
        a12[x] *= g;
        a22[x] = (a22[x] + springs[x]) * g;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations `[a11, a12, a22, c1, c2]` of one row.
    fn equations(data: &DataTerm<'_>, flow: Planes<'_>) -> [Vec<f32>; 5] {
        let mut rows = [(); 5].map(|()| vec![f32::NAN; data.width]);
        data.equations(0, flow, rows.each_mut().map(|row| &mut row[..]));
        rows
    }

    /// Constraints that are all fulfilled by one flow: it solves `A U = c`, whatever the weights.
    #[test]
    fn the_flow_that_fulfils_all_constraints_solves_the_equations() {
        let (width, filters) = (5, 4);
        let (start, truth) = ([0.4f32, -0.2], [1.1f32, 0.3]);
        let mut constraints = vec![0.0; filters * 4 * width];
        for (i, terms) in constraints.chunks_mut(4 * width).enumerate() {
            let angle = 0.7 * i as f32;
            let g = [1.5 * angle.cos(), 1.5 * angle.sin()];
            for x in 0..width {
                terms[x] = g[0];
                terms[width + x] = g[1];
                terms[2 * width + x] = -g[0] * (truth[0] - start[0]) - g[1] * (truth[1] - start[1]);
                terms[3 * width + x] = 0.1 + 0.2 * x as f32;
            }
        }
        let packed = Constraints::of(&constraints, filters, width, 1.6);
        let plane = |value: f32| vec![value; width];
        let (u0, v0, u, v) = (plane(start[0]), plane(start[1]), plane(0.0), plane(0.9));
        let (springs, gain) = (plane(0.0), plane(3.0));
        let data = DataTerm {
            frames: vec![&packed],
            warped_with: [&u0, &v0],
            reweighting: Reweighting { residual: 0.5, scale: 0.3 },
            springs: &springs,
            gain: &gain,
            width,
        };
        let [a11, a12, a22, c1, c2] = equations(&data, [&u, &v]);
        // Terms are kept to 5e-5; three of them of order one meet in each equation.
        for i in 0..width {
            let left = a11[i] * truth[0] + a12[i] * truth[1];
            assert!(a11[i] > 0.0 && (left - c1[i]).abs() < 3e-4 * a11[i]);
            let left = a12[i] * truth[0] + a22[i] * truth[1];
            assert!(a22[i] > 0.0 && (left - c2[i]).abs() < 3e-4 * a22[i]);
        }
    }

    /// `A U - c` is the gradient of the robust energy, by central differences of it.
    #[test]
    fn the_equations_are_the_gradient_of_the_energy() {
        let constraints = [[1.2f32, -0.4, 0.3, 0.8], [0.1, 1.5, -1.1, 0.5], [-0.9, 1.0, 2.5, 1.0]];
        let (start, flow) = ([0.3f32, 0.1], [0.9f32, -0.4]);
        let (spring, gain) = (0.2f32, 1.7f32);
        let energy = |at: [f64; 2]| -> f64 {
            let along = |g: f32, i: usize| f64::from(g) * (at[i] - f64::from(start[i]));
            let term = |[gx, gy, d, w]: [f32; 4]| {
                let r = (along(gx, 0) + along(gy, 1) + f64::from(d)) / 0.6;
                0.7 * 0.5 * 0.36 * f64::from(w) * (1.0 + r * r).ln()
            };
            let rest = 0.5 * f64::from(spring) * (at[0] * at[0] + at[1] * at[1]);
            f64::from(gain) * (constraints.into_iter().map(term).sum::<f64>() + rest)
        };
        let packed = Constraints::of(&constraints.concat(), 3, 1, 1.6);
        let data = DataTerm {
            frames: vec![&packed],
            warped_with: [&[start[0]], &[start[1]]],
            reweighting: Reweighting { residual: 0.6, scale: 0.7 },
            springs: &[spring],
            gain: &[gain],
            width: 1,
        };
        let [a11, a12, a22, c1, c2] = equations(&data, [&[flow[0]], &[flow[1]]]).map(|row| row[0]);
        let (h, [u, v]) = (1e-5, flow.map(f64::from));
        let numeric = [
            (energy([u + h, v]) - energy([u - h, v])) / (2.0 * h),
            (energy([u, v + h]) - energy([u, v - h])) / (2.0 * h),
        ];
        let found = [a11 * flow[0] + a12 * flow[1] - c1, a12 * flow[0] + a22 * flow[1] - c2];
        // Terms of order one, each kept to 5e-5.
        assert!((numeric[0] - f64::from(found[0])).abs() < 2e-4);
        assert!((numeric[1] - f64::from(found[1])).abs() < 2e-4);
    }

    #[test]
    fn a_residual_of_the_scale_halves_the_weight() {
        let packed = Constraints::of(&[1.0, 0.0, 0.5, 1.0], 1, 1, 1.0);
        let data = DataTerm {
            frames: vec![&packed, &packed],
            warped_with: [&[0.0], &[0.0]],
            reweighting: Reweighting { residual: 0.5, scale: 1.0 },
            springs: &[0.0],
            gain: &[1.0],
            width: 1,
        };
        let expected = [1.0, 0.0, 0.0, -0.5, 0.0];
        for (found, expected) in equations(&data, [&[0.0], &[0.0]]).iter().zip(expected) {
            assert!((found[0] - expected).abs() < 1e-4);
        }
    }
}
