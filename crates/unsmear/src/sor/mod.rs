//! Red-black successive over-relaxation (SOR) of the coupled flow equations.
//!
//! For every pixel p with its four neighbours q and the unknowns U = (u, v), solves
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
//!
//! The half-sweeps of a pass run as a wave: half-sweep k relaxes row y once half-sweep k - 1 has done row y + 1, so that
//! rows stay in cache for the whole pass. With several threads each first relaxes the shrinking part of its band of
//! rows that depends on nothing outside, then the growing triangles between bands follow. Every pixel goes through the
//! same arithmetic on the same operands in every order, hence the same bytes for any number of threads.

mod layout;
mod relax;
mod system;

use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::tasks::{fill, filled, for_each_task};
use layout::{LANES, Layout};
use relax::{Band, relax_band};

pub use system::{SorSystem, SystemRows};

/// Half-sweeps per pass: 11 rows of 640 px are 260 kB, well inside a second-level cache.
const HALVES_PER_PASS: usize = 10;

/// Fewest pixels worth a thread of their own: a pass over them takes some 10 us, several times its scheduling.
const PIXELS_PER_BAND: usize = 4096;

/// Memory of [`solve`], 36 B/px; reusable between calls of any size.
#[derive(Debug, Default)]
pub struct SorScratch {
    layout: Layout,
    coefficients: Vec<f32>,
    field: Vec<f32>,
}

impl SorScratch {
    /// With room for pictures of up to `height` x `width`.
    #[must_use]
    pub fn with_room(height: usize, width: usize) -> Self {
        let layout = Layout::new(height, width);
        let room = |per_row: usize| filled(0.0, (height + 2) * per_row + LANES);
        Self {
            layout: Layout::default(),
            coefficients: room(layout.block()),
            field: room(layout.rows()),
        }
    }
}

/// Runs `sweeps` sweeps with relaxation `omega` on (`u`, `v`) in place; see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when a slice has not height x width samples; [`Error::Value`] for omega outside (0, 2);
/// [`Error::Cancelled`], after which (`u`, `v`) are as before.
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
    solve_rows(system, [system.height, system.width], u, v, omega, sweeps, scratch, control)
}

/// Like [`solve`], with equations made row by row for a picture of `[height, width]`.
///
/// # Errors
/// [`Error::Shape`] when `u` or `v` has not height x width samples; else as [`solve`].
pub fn solve_rows(
    system: &impl SystemRows,
    [height, width]: [usize; 2],
    u: &mut [f32],
    v: &mut [f32],
    omega: f32,
    sweeps: usize,
    scratch: &mut SorScratch,
    control: &Control,
) -> Result<()> {
    for (argument, got) in [("u", u.len()), ("v", v.len())] {
        if got != height * width {
            return Err(Error::shape(argument, format!("({height} x {width},)"), &[got]));
        }
    }
    require("omega", f64::from(omega), "in (0, 2)", |o| 0.0 < o && o < 2.0)?;
    if u.is_empty() || sweeps == 0 {
        return Ok(());
    }
    let layout = Layout::new(height, width);
    let SorScratch { layout: former, coefficients, field } = scratch;
    if *former != layout {
        // Padding is zero and stays so.
        *former = layout;
        for (values, per_row) in [(&mut *coefficients, layout.block()), (field, layout.rows())] {
            let samples = (layout.height + 2) * per_row + LANES;
            if values.len() < samples {
                *values = filled(0.0, samples);
            } else {
                fill(&mut values[..samples], 0.0);
            }
        }
    }
    let (coefficients, field) = (aligned(coefficients), aligned(field));
    layout.pack(system, u, v, coefficients, field, control)?;
    for first in (0..2 * sweeps).step_by(HALVES_PER_PASS) {
        let halves = HALVES_PER_PASS.min(2 * sweeps - first);
        relax_pass(&layout, coefficients, field, omega, first..first + halves, control)?;
    }
    layout.unpack(field, u, v)
}

/// What follows the first sample that starts a register-sized piece of memory: loads across cache lines cost twice.
fn aligned(values: &mut [f32]) -> &mut [f32] {
    let start = values.as_ptr().align_offset(LANES * size_of::<f32>()).min(LANES);
    &mut values[start..]
}

/// Runs the given half-sweeps over the whole picture.
fn relax_pass(
    layout: &Layout,
    coefficients: &[f32],
    field: &mut [f32],
    omega: f32,
    halves: std::ops::Range<usize>,
    control: &Control,
) -> Result<()> {
    let rows = layout.height + 2;
    let most =
        (rows / (4 * (halves.len() + 1))).min(layout.height * layout.width / PIXELS_PER_BAND);
    let bands = rayon::current_num_threads().min(most).max(1);
    let bounds: Vec<usize> = (0..=bands).map(|i| i * rows / bands).collect();
    // Half-sweep k of a band leaves out the k + 1 rows next to its inner bounds: they see beyond.
    let shrinking = |band: &Band<'_>, k: usize| {
        let [start, end] = [band.first, band.end(layout)];
        let start = if start == 0 { 1 } else { start + k + 1 };
        start..if end == rows { rows - 1 } else { end - k - 1 }
    };
    let parts = split_rows(field, &bounds, layout.rows());
    for_each_task(parts.into_iter(), bands, |mut band| {
        relax_band(layout, coefficients, &mut band, shrinking, omega, halves.clone(), control)
    })?;
    // What was left out lies within `halves` rows of the inner bounds, each in the middle of one part.
    let middles: Vec<usize> = std::iter::once(0)
        .chain(bounds.windows(2).map(|pair| pair[0].midpoint(pair[1])))
        .chain([rows])
        .collect();
    let parts = split_rows(field, &middles, layout.rows()).into_iter().zip(&bounds);
    let inner = parts.filter(|(_, bound)| 0 < **bound && **bound < rows);
    for_each_task(inner, bands - 1, |(mut band, &bound)| {
        let growing = |_: &Band<'_>, k: usize| bound - k - 1..bound + k + 1;
        relax_band(layout, coefficients, &mut band, growing, omega, halves.clone(), control)
    })
}

/// Cuts the rows of `field` at `bounds`, which run from 0 to their number.
fn split_rows<'a>(mut field: &'a mut [f32], bounds: &[usize], row: usize) -> Vec<Band<'a>> {
    let mut bands = Vec::with_capacity(bounds.len());
    for pair in bounds.windows(2) {
        let (rows, rest) = field.split_at_mut((pair[1] - pair[0]) * row);
        bands.push(Band { first: pair[0], rows });
        field = rest;
    }
    bands
}

#[cfg(test)]
mod tests;
