//! Red-black successive over-relaxation (SOR) of the coupled flow equations.
//!
//! For every pixel p with its four neighbours q, unknowns U = (u, v), and the increment's normal equations folded into
//! the right-hand side, solves
//!
//! ```text
//! (A(p) + sum_q g(p,q) I) U(p) - sum_q g(p,q) U(q) = c(p),    A = [[a11, a12], [a12, a22]] >= 0,  g >= 0
//! U(p) <- U(p) + omega ((A(p) + sum_q g I)^-1 (c(p) + sum_q g U(q)) - U(p))
//! ```
//!
//! first on all red pixels (x + y even), then on all black ones: one sweep. Pixels of one colour do not see each other,
//! so their order is free. Nothing crosses the edge of the picture (Neumann border).
//! Units: U in px; A, c and g in any common unit. Validity: finite input, 0 < omega < 2; a singular pixel (A singular
//! and no neighbour) keeps its value.
//! Reference: D. M. Young, "Iterative methods for solving partial difference equations of elliptic type", Trans. Amer.
//! Math. Soc. 76 (1954) 92-111, [10.1090/S0002-9947-1954-0059635-7](https://doi.org/10.1090/S0002-9947-1954-0059635-7).

use crate::control::Control;
use crate::error::{Error, Result, require};

/// Relative determinant at or below which a pixel without neighbours counts as singular: rounding of `a11 a22 - a12^2`.
const SINGULAR: f32 = 1e-6;

/// The equations of all pixels; packed rows of `width` samples, `height` of them.
#[derive(Debug, Clone, Copy)]
pub struct SorSystem<'a> {
    /// Upper left entry of A.
    pub a11: &'a [f32],
    /// Off-diagonal entry of A.
    pub a12: &'a [f32],
    /// Lower right entry of A.
    pub a22: &'a [f32],
    /// First component of the right-hand side c.
    pub c1: &'a [f32],
    /// Second component of the right-hand side c.
    pub c2: &'a [f32],
    /// Diffusivity between (y, x) and (y, x + 1); the last column is ignored.
    pub gx: &'a [f32],
    /// Diffusivity between (y, x) and (y + 1, x); the last row is ignored.
    pub gy: &'a [f32],
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

/// Memory of [`solve`], reusable between calls of any size.
#[derive(Debug, Default)]
pub struct SorScratch {
    inverse: Vec<[f32; 3]>,
}

impl SorSystem<'_> {
    fn check(&self, u: &[f32], v: &[f32]) -> Result<()> {
        let fields = [
            ("a11", self.a11.len()),
            ("a12", self.a12.len()),
            ("a22", self.a22.len()),
            ("c1", self.c1.len()),
            ("c2", self.c2.len()),
            ("gx", self.gx.len()),
            ("gy", self.gy.len()),
            ("u", u.len()),
            ("v", v.len()),
        ];
        for (argument, got) in fields {
            if got != self.height * self.width {
                let expected = format!("({} x {},)", self.height, self.width);
                return Err(Error::shape(argument, expected, &[got]));
            }
        }
        Ok(())
    }
}

/// Runs `sweeps` sweeps with relaxation `omega` on (`u`, `v`) in place; see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when a slice has not height x width samples; [`Error::Value`] for omega outside (0, 2);
/// [`Error::Cancelled`], after which (`u`, `v`) are undefined.
pub fn solve(
    system: &SorSystem<'_>,
    u: &mut [f32],
    v: &mut [f32],
    omega: f32,
    sweeps: usize,
    scratch: &mut SorScratch,
    control: &Control,
) -> Result<()> {
    system.check(u, v)?;
    require("omega", f64::from(omega), "in (0, 2)", |o| 0.0 < o && o < 2.0)?;
    let (height, width) = (system.height, system.width);
    let edges = |y: usize, x: usize| {
        let i = y * width + x;
        let west = if x > 0 { system.gx[i - 1] } else { 0.0 };
        let east = if x + 1 < width { system.gx[i] } else { 0.0 };
        let north = if y > 0 { system.gy[i - width] } else { 0.0 };
        let south = if y + 1 < height { system.gy[i] } else { 0.0 };
        [west, east, north, south]
    };
    scratch.inverse.clear();
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let [west, east, north, south] = edges(y, x);
            let sum = (west + east) + (north + south);
            scratch.inverse.push(inverse(system.a11[i], system.a12[i], system.a22[i], sum));
        }
    }
    for half in 0..2 * sweeps {
        for y in 0..height {
            control.check()?;
            for x in ((y + half) % 2..width).step_by(2) {
                let i = y * width + x;
                let [i11, i12, i22] = scratch.inverse[i];
                if i11 == 0.0 {
                    continue;
                }
                let g = edges(y, x);
                let q = [
                    if x > 0 { i - 1 } else { i },
                    if x + 1 < width { i + 1 } else { i },
                    if y > 0 { i - width } else { i },
                    if y + 1 < height { i + width } else { i },
                ];
                let (mut r1, mut r2) = (system.c1[i], system.c2[i]);
                for (g, q) in g.into_iter().zip(q) {
                    r1 += g * u[q];
                    r2 += g * v[q];
                }
                u[i] += omega * ((i11 * r1 + i12 * r2) - u[i]);
                v[i] += omega * ((i12 * r1 + i22 * r2) - v[i]);
            }
        }
    }
    Ok(())
}

/// Inverse of `A + sum I` as (11, 12, 22); zeros when singular.
#[inline(always)]
fn inverse(a11: f32, a12: f32, a22: f32, sum: f32) -> [f32; 3] {
    let own = a11 * a22 - a12 * a12;
    // Rounding must not make A indefinite.
    let own = if own > SINGULAR * a11 * a22 { own } else { 0.0 };
    let scale = 1.0 / (own + sum * (a11 + a22 + sum));
    if scale.is_finite() {
        [(a22 + sum) * scale, -a12 * scale, (a11 + sum) * scale]
    } else {
        [0.0; 3]
    }
}
