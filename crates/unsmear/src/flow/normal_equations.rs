//! The 2 x 2 normal equations of phase constraints, pixel by pixel.
//!
//! Constraints `G.w + D = 0` of weight `W` are summed to `M = sum W G G'`, `b = sum W D G`,
//! `c = sum W D^2` and `m = sum W`; then
//!
//! ```text
//! w        = -M^-1 b                          by the cofactors
//! lambda   = least eigenvalue of M
//! residual = (c + w.b) / m                    mean square at the minimum, rad^2
//! ```
//!
//! Reweighted, `W` becomes `W / (1 + (r / robust)^2)^2`, `r = G.w + D` with the last solution: the
//! function of Geman & `McClure` 1987.

use ndarray::Array3;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::real::Real;

/// Terms of a constraint: G, D and W.
pub(super) const TERMS: usize = 4;
/// Sums over constraints: xx, xy, yy, xd, yd, dd and the weight.
pub(super) const SUMS: usize = 7;

/// Adds one constraint row to the sums of its row.
pub(super) fn accumulate<T: Real>(
    constraint: &[T],
    flow: Option<&[ndarray::ArrayView1<'_, T>; 2]>,
    softness: T,
    out: &mut [T],
) {
    let width = constraint.len() / TERMS;
    let [gx, gy, d, w] = [0, 1, 2, 3].map(|i| &constraint[i * width..(i + 1) * width]);
    for x in 0..width {
        let mut weight = w[x];
        if let Some([u, v]) = flow {
            let own = gx[x] * u[x] + gy[x] * v[x] + d[x];
            // An unsolved pixel has no residual; its own constraints stay as they are.
            if own.is_finite() {
                let soft = T::one() + own * own * softness;
                weight /= soft * soft;
            }
        }
        let (wx, wy, wd) = (weight * gx[x], weight * gy[x], weight * d[x]);
        let terms = [wx * gx[x], wx * gy[x], wy * gy[x], wx * d[x], wy * d[x], wd * d[x], weight];
        for (i, term) in terms.into_iter().enumerate() {
            out[i * width + x] += term;
        }
    }
}

/// `u`, `v`, least eigenvalue of `M` and mean squared residual, (4, H, W); NaN flow where singular.
pub(super) fn solve<T: Real>(sums: &Array3<T>, control: &Control) -> Result<Array3<T>> {
    let (_, height, width) = sums.dim();
    let mut rows = vec![T::zero(); 4 * height * width];
    for_each_row(&mut rows, 4 * width, control, |y, out| {
        for x in 0..width {
            let [xx, xy, yy, xd, yd, dd, mass] =
                [0, 1, 2, 3, 4, 5, 6].map(|i| sums[(i, y, x)].as_f64());
            let least = (xx + yy) / 2.0 - ((xx - yy) / 2.0).hypot(xy);
            let determinant = xx * yy - xy * xy;
            let (mut u, mut v, mut residual) = (f64::NAN, f64::NAN, 0.0);
            if determinant > 0.0 && least > 0.0 {
                // Adding 0 turns the -0 of a still picture into 0.
                u = -(yy * xd - xy * yd) / determinant + 0.0;
                v = -(xx * yd - xy * xd) / determinant + 0.0;
                // At the minimum sum W (G.w + D)^2 = sum W D^2 + w.b.
                residual = (dd + u * xd + v * yd).max(0.0) / mass;
            }
            for (i, value) in [u, v, least, residual].into_iter().enumerate() {
                out[i * width + x] = T::of(value);
            }
        }
    })?;
    let solution = Array3::from_shape_vec((height, 4, width), rows).unwrap_or_default();
    Ok(solution.permuted_axes([1, 0, 2]).as_standard_layout().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows `[G_x, G_y, D, W]` of one pixel that fulfil the flow (0.5, -0.25), and an outlier.
    const EXACT: [[f64; 4]; 2] = [[1.0, 0.0, -0.5, 2.0], [1.0, 2.0, 0.0, 1.0]];
    const OUTLIER: [f64; 4] = [0.0, 1.0, 3.0, 1.0];

    fn solved(rows: &[[f64; 4]], start: Option<[f64; 2]>) -> [f64; 4] {
        let start = start.map(|flow| flow.map(|c| ndarray::arr1(&[c])));
        let views = start.as_ref().map(|s| [s[0].view(), s[1].view()]);
        let mut sums = [0.0; SUMS];
        rows.iter().for_each(|row| accumulate(row, views.as_ref(), 100.0, &mut sums));
        let sums = Array3::from_shape_vec((SUMS, 1, 1), sums.to_vec()).unwrap();
        let solution = solve(&sums, &Control::new()).unwrap();
        [0, 1, 2, 3].map(|i| solution[(i, 0, 0)])
    }

    #[test]
    fn exact_constraints_are_solved_exactly() {
        let [u, v, least, residual] = solved(&EXACT, None);
        assert!((u - 0.5).abs() < 1e-15 && (v + 0.25).abs() < 1e-15 && residual < 1e-15);
        // M = [[3, 2], [2, 4]].
        assert!((least - (3.5 - 4.25f64.sqrt())).abs() < 1e-14);
    }

    #[test]
    fn reweighting_silences_what_does_not_fit() {
        let rows = [EXACT[0], EXACT[1], OUTLIER];
        let plain = solved(&rows, None);
        let again = solved(&rows, Some([0.5, -0.25]));
        // The outlier is 2.75 rad off at a softness of 0.1 rad: weight 1.7e-6.
        assert!((plain[1] + 0.25).abs() > 0.1 && (again[1] + 0.25).abs() < 1e-5);
        assert!(solved(&EXACT[..1], None)[0].is_nan(), "one constraint holds no flow");
    }
}
