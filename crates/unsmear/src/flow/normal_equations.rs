//! Normal equations of weighted constraints on the flow, gathered and solved pixel by pixel.
//!
//! The constraints `G.w + D = 0` of weight `W` enter as seven sums,
//!
//! ```text
//! xx, xy, yy = sum W G_x G_x, W G_x G_y, W G_y G_y      xd, yd = sum W G_x D, W G_y D
//! dd = sum W D^2,  mass = sum W
//! w = -[xx xy; xy yy]^-1 (xd, yd),   mean squared residual = (dd + w.(xd, yd)) / mass   rad^2
//! ```
//!
//! A reweighted constraint counts `W / (1 + (residual/robust)^2)^2` (Geman & `McClure` 1987). Sums
//! run in the order of the constraints, a row of pixels at a time.

use multiversion::multiversion;
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
    flow: Option<[&[T]; 2]>,
    softness: T,
    scratch: &mut [T],
    out: &mut [T],
) {
    let width = constraint.len() / TERMS;
    let [gx, gy, d, w] = [0, 1, 2, 3].map(|i| &constraint[i * width..(i + 1) * width]);
    let (reweighted, weighted) = scratch.split_at_mut(width);
    let weight = match flow {
        Some(flow) => {
            reweigh([gx, gy, d, w], flow, softness, reweighted);
            &*reweighted
        }
        None => w,
    };
    let mut sums = out.chunks_mut(width);
    // In the order of `SUMS`: each product is formed once and serves a run of sums.
    for (factor, others) in [(gx, &[gx, gy][..]), (gy, &[gy]), (gx, &[d]), (gy, &[d]), (d, &[d])] {
        multiply(weight, factor, weighted);
        for (other, sum) in others.iter().zip(&mut sums) {
            add_product(weighted, other, sum);
        }
    }
    for (sum, &weight) in sums.next().unwrap_or_default().iter_mut().zip(weight) {
        *sum += weight;
    }
}

/// `W` times the robust weight of the residual; an unsolved pixel has none and keeps its weights.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn reweigh<T: Real>([gx, gy, d, w]: [&[T]; 4], [u, v]: [&[T]; 2], softness: T, out: &mut [T]) {
    let n = out.len();
    let (gx, gy, d, w, u, v) = (&gx[..n], &gy[..n], &d[..n], &w[..n], &u[..n], &v[..n]);
    for x in 0..n {
        let own = gx[x] * u[x] + gy[x] * v[x] + d[x];
        let soft = T::one() + own * own * softness;
        let robust = w[x] / (soft * soft);
        out[x] = if own.is_finite() { robust } else { w[x] };
    }
}

/// `out = a b`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn multiply<T: Real>(a: &[T], b: &[T], out: &mut [T]) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for x in 0..n {
        out[x] = a[x] * b[x];
    }
}

/// `out += a b`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_product<T: Real>(a: &[T], b: &[T], out: &mut [T]) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for x in 0..n {
        out[x] += a[x] * b[x];
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

    /// Two constraints on one pixel hold its flow; a third one, far off, loses its weight.
    #[test]
    fn sums_and_solution_of_three_constraints() {
        let constraints = [[1.0, 0.0, -2.0, 1.0], [0.0, 2.0, 1.0, 0.5], [1.0, 1.0, 98.5, 1.0]];
        let (mut sums, mut scratch) = (vec![0.0; SUMS], vec![9.0; 2]);
        for constraint in &constraints[..2] {
            accumulate::<f64>(constraint, None, 4.0, &mut scratch, &mut sums);
        }
        assert_eq!(sums, [1.0, 0.0, 2.0, -2.0, 1.0, 4.5, 1.5]);
        let cube = Array3::from_shape_vec((SUMS, 1, 1), sums.clone()).unwrap();
        let solution = solve(&cube, &Control::new()).unwrap();
        assert_eq!(solution.as_slice().unwrap(), [2.0, -0.5, 1.0, 0.0]);
        let before = sums[6];
        let flow: [&[f64]; 2] = [&[2.0], &[-0.5]];
        accumulate(&constraints[2], Some(flow), 4.0, &mut scratch, &mut sums);
        // Residual 100, squared times 4: (1 + 40000)^-2.
        assert!((sums[6] - before - 40_001f64.powi(-2)).abs() < 1e-15);
        let unsolved: [&[f64]; 2] = [&[f64::NAN], &[0.0]];
        accumulate(&constraints[2], Some(unsolved), 4.0, &mut scratch, &mut sums);
        assert!((sums[6] - before - 1.0).abs() < 1e-8, "an unsolved pixel keeps its weights");
    }
}
