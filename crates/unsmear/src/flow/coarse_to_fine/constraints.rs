//! The phase constraints of one frame, kept from one linearisation to the next in 16 bits a term.
//!
//! ```text
//! G = g q_G,   D = pi q_D/Q,   W = (q_W/Q)^2,      |q| <= Q = 32767,   g = max |G|/Q
//! ```
//!
//! with integers `q`, rounded to nearest; 0 stays 0. Errors are at most 5e-5 rad in `D`, 9e-5 rad/px
//! in `G` (see [`super::phase_constraint`] for the bound of `G`), and 2e-5 `sqrt W` in `W`: a thousandth of what noise does to
//! phase. The square keeps small weights apart, which decide where little is seen.

use std::f32::consts::PI;

use multiversion::multiversion;

use super::look::Look;
use super::phase_constraint::{Filters, TERMS};
use crate::control::Control;
use crate::error::Result;
use crate::tasks::filled;

/// `Q`.
const LARGEST: f32 = 32767.0;
/// Added to a number below 2^22, it leaves the nearest integer in the lower bits of the sum.
const ROUND: f32 = 12_582_912.0;

/// Factors that turn the integers of a row into `G`, `D` and the square root of `W`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Units {
    /// `g`, rad/px.
    pub(super) slope: f32,
    /// rad.
    pub(super) step: f32,
    pub(super) root: f32,
}

/// Rows `[G_x, G_y, D, sqrt W]` of each filter, (H, N, 4, W).
#[derive(Debug)]
pub(super) struct Constraints {
    terms: Vec<i16>,
    units: Units,
    /// Samples of one picture row of one filter, all terms.
    stride: usize,
    filters: usize,
}

impl Constraints {
    /// None yet, with room for pictures of up to `samples` pixels.
    pub(super) fn with_room(filters: usize, samples: usize) -> Self {
        let units = Units { slope: 0.0, step: PI / LARGEST, root: 1.0 / LARGEST };
        Self { terms: filled(0, samples * filters * TERMS), units, stride: 0, filters }
    }

    /// Fills them with those of a look.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn fill(
        &mut self,
        look: &Look<'_>,
        filters: &Filters,
        control: &Control,
    ) -> Result<()> {
        self.units.slope = filters.largest_slope() / LARGEST;
        self.stride = TERMS * look.width;
        let samples = look.height * self.filters * self.stride;
        if self.terms.len() < samples {
            self.terms = filled(0, samples);
        }
        let (units, per_row) = (self.units, self.filters * self.stride);
        let scratch = || vec![0.0; per_row];
        look.for_each_row(
            [&mut self.terms[..samples]],
            [per_row],
            control,
            scratch,
            |y, pair, seen, [out], terms| {
                filters.constrain(y, pair, seen, terms);
                for (terms, out) in
                    terms.chunks_exact(self.stride).zip(out.chunks_exact_mut(self.stride))
                {
                    pack(terms, units, out);
                }
            },
        )
    }

    /// The rows of all filters at picture row `y`, each `[G_x, G_y, D, sqrt W]`, and their units.
    pub(super) fn row(&self, y: usize) -> (impl Iterator<Item = &[i16]>, Units) {
        let per_row = self.filters * self.stride;
        (self.terms[y * per_row..(y + 1) * per_row].chunks_exact(self.stride), self.units)
    }

    /// From the terms `[G_x, G_y, D, W]` of all rows and filters, of slopes up to `largest`.
    #[cfg(test)]
    pub(super) fn of(terms: &[f32], filters: usize, width: usize, largest: f32) -> Self {
        let mut made = Self::with_room(filters, 0);
        (made.units.slope, made.stride) = (largest / LARGEST, TERMS * width);
        made.terms.resize(terms.len(), 0);
        for (terms, out) in terms.chunks(made.stride).zip(made.terms.chunks_mut(made.stride)) {
            pack(terms, made.units, out);
        }
        made
    }
}

/// The terms `[G_x, G_y, D, W]` of a row as integers.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn pack(terms: &[f32], units: Units, out: &mut [i16]) {
    let n = terms.len() / TERMS;
    let (slopes, rest) = terms.split_at(2 * n);
    let (steps, weights) = rest.split_at(n);
    let (out_slopes, out_rest) = out.split_at_mut(2 * n);
    let (out_steps, out_roots) = out_rest.split_at_mut(n);
    nearest(slopes, 1.0 / units.slope, out_slopes);
    nearest(steps, 1.0 / units.step, out_steps);
    let factor = 1.0 / units.root;
    for (out, weight) in out_roots.iter_mut().zip(weights) {
        *out = (weight.sqrt() * factor + ROUND).to_bits() as i16;
    }
}

/// The nearest integers of `values` times `factor`, none beyond `Q`.
#[inline(always)]
fn nearest(values: &[f32], factor: f32, out: &mut [i16]) {
    for (out, value) in out.iter_mut().zip(values) {
        let scaled = value * factor;
        let scaled = if scaled < -LARGEST { -LARGEST } else { scaled };
        let scaled = if scaled > LARGEST { LARGEST } else { scaled };
        *out = (scaled + ROUND).to_bits() as i16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_come_back_within_half_a_unit() {
        let terms = [
            [0.0, -0.0, 5.5, -5.5, 1.5, 1e-4, -0.7],
            [0.3, 2.0, -3.1, 0.0, 5.4999, -1e-5, 0.01],
            [0.0, PI, -PI, 1e-3, -2.0, 0.5, 1e-6],
            [0.0, 1.0, 0.5, 1e-4, 1e-9, 0.999, 0.02],
        ];
        let packed = Constraints::of(&terms.concat(), 1, 7, 5.5);
        let (mut rows, units) = packed.row(0);
        let row = rows.next().unwrap();
        for x in 0..7 {
            let at = |term: usize| f32::from(row[term * 7 + x]);
            // Half a unit, and the rounding of the product with its inverse.
            for axis in [0, 1] {
                assert!((at(axis) * units.slope - terms[axis][x]).abs() < 0.51 * units.slope);
            }
            assert!((at(2) * units.step - terms[2][x]).abs() < 0.51 * units.step);
            assert!((at(3) * units.root - terms[3][x].sqrt()).abs() < 0.51 * units.root);
        }
        assert!((row[0], row[7], row[14], row[21]) == (0, 1787, 0, 0));
        let steep = Constraints::of(&[1e9, -7.0, 0.0, 1.0], 1, 1, 5.5);
        assert_eq!(steep.row(0).0.next().unwrap(), [32767, -32767, 0, 32767]);
    }
}
