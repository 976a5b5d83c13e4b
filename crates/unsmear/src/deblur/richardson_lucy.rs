//! Richardson-Lucy: the likeliest non-negative picture under Poisson noise, by multiplications.
//!
//! ```text
//! x <- x * A'( w b / (A x) ) / A' w
//! ```
//!
//! The operator must have no negative entries (linear taps): with those of a cubic the quotient changes sign and the
//! iteration diverges. It fits noise ever more closely, so it ends when the residual has come down to the noise, or
//! after a number of turns. Several data share one x; their numerators and denominators add. Where no datum sees x, it
//! keeps its start. Units: grey levels above black, >= 0.
//!
//! W. H. Richardson, J. Opt. Soc. Am. 62 (1972) 55-59, [10.1364/JOSA.62.000055](https://doi.org/10.1364/JOSA.62.000055);
//! L. B. Lucy, Astron. J. 79 (1974) 745-754, [10.1086/111605](https://doi.org/10.1086/111605).

use ndarray::ArrayView2;
use rayon::prelude::*;

use super::datum::{Datum, check_looks, first_guess, residual_rms};
use super::look::{Look, data, operators};
use super::total_variation::Restored;
use super::variational::Solution;
use super::vectors::add;
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::motion_operator::Taps;

/// Least intensity in a quotient, grey levels: a hundredth of a quantisation step.
const DARK: f32 = 0.01;

/// Samples per task.
const BLOCK: usize = 1 << 13;

/// Richardson-Lucy with an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RichardsonLucy {
    /// Most turns, >= 1.
    pub turns: usize,
    /// Residual at which to stop, grey levels, >= 0.
    pub noise: f64,
}

impl Default for RichardsonLucy {
    fn default() -> Self {
        Self { turns: 30, noise: 0.0 }
    }
}

impl RichardsonLucy {
    /// Restores one picture, whose black is its darkest sample.
    ///
    /// # Errors
    /// As [`RichardsonLucy::solve`], and [`Error::Shape`] for shapes that differ.
    pub fn restore(&self, look: &Look<'_>, control: &Control) -> Result<Restored> {
        control.expect(self.turns);
        let known = |plane: &ArrayView2<'_, f32>| {
            plane.iter().copied().filter(|s| s.is_finite()).fold(f32::INFINITY, f32::min)
        };
        let black = look.planes.iter().map(known).fold(f32::INFINITY, f32::min);
        let lifted: Vec<_> = look.planes.iter().map(|plane| plane.map(|s| s - black)).collect();
        let planes = lifted.iter().map(|plane| plane.view()).collect();
        let (paths, weights) = (look.paths.clone(), look.weights.clone());
        let looks = [Look { paths, planes, weights, ceiling: None }];
        let (operators, pad) = operators(&looks, Taps::Linear)?;
        let mut solution = self.solve(&data(&looks, &operators)?, control)?;
        solution.channels.iter_mut().flatten().for_each(|x| *x += black);
        let mismatch = f64::NAN;
        Ok(Restored { solution, pad, lambda: f64::NAN, mismatch })
    }

    /// Restores from data >= 0 (negative samples count as 0).
    ///
    /// # Errors
    /// [`Error::Value`] for parameters out of range, no data, or data that differ in channels or unknown;
    /// [`Error::Cancelled`].
    pub fn solve(&self, data: &[Datum<'_>], control: &Control) -> Result<Solution> {
        require("noise", self.noise, "finite and not negative", |n| n >= 0.0)?;
        if self.turns == 0 {
            return Err(Error::value("turns", "at least 1", 0));
        }
        let (rows, columns) = check_looks(data)?;
        let unknowns = rows * columns;
        let mut channels = first_guess(&data[0]);
        channels.iter_mut().flatten().for_each(|x| *x = x.max(DARK));
        let mut blurred =
            vec![0.0; data.iter().map(|d| d.weights().len()).max().unwrap_or_default()];
        let (mut seen, mut share) = (vec![0.0; unknowns], vec![0.0; unknowns]);
        for datum in data {
            datum.operator().adjoint(datum.weights(), &mut share);
            add(&mut seen, &share);
        }
        let mut ratio = vec![0.0; unknowns];
        let mut steps = 0;
        let mut residual = residual_rms(data, &channels, &mut blurred);
        for _ in 0..self.turns {
            if residual <= self.noise {
                break;
            }
            for (channel, x) in channels.iter_mut().enumerate() {
                ratio.fill(0.0);
                for datum in data {
                    control.check()?;
                    let blurred = &mut blurred[..datum.weights().len()];
                    datum.operator().apply(x, blurred);
                    quotient(blurred, &datum.planes()[channel], datum.weights());
                    datum.operator().adjoint(blurred, &mut share);
                    add(&mut ratio, &share);
                }
                multiply(x, &ratio, &seen);
            }
            steps += 1;
            control.advance()?;
            residual = residual_rms(data, &channels, &mut blurred);
        }
        Ok(Solution { channels, steps, residual })
    }
}

/// `w b / a` into a.
fn quotient(a: &mut [f32], b: &[f32], w: &[f32]) {
    a.par_chunks_mut(BLOCK).zip(b.par_chunks(BLOCK).zip(w.par_chunks(BLOCK))).for_each(
        |(a, (b, w))| {
            for i in 0..a.len() {
                a[i] = w[i] * b[i].max(0.0) / a[i].max(DARK);
            }
        },
    );
}

/// `x ratio / seen` into x where anything is seen.
fn multiply(x: &mut [f32], ratio: &[f32], seen: &[f32]) {
    x.par_chunks_mut(BLOCK).zip(ratio.par_chunks(BLOCK).zip(seen.par_chunks(BLOCK))).for_each(
        |(x, (ratio, seen))| {
            for i in 0..x.len() {
                if seen[i] > DARK {
                    x[i] *= ratio[i] / seen[i];
                }
            }
        },
    );
}
