//! Evidence that something rests: a pull towards no motion where the frames show none.
//!
//! A pattern of one direction says nothing about motion along it, and beside a moving thing the flow
//! leaks along it over a background that visibly rests. From the frames as they are, unwarped, with
//! phase difference `D_0` and mean phase gradient `G`, summed over the filters,
//!
//! ```text
//! E_n = G_2 * sum A D_0^2,   E_g = G_2 * sum A |G|^2,   A = min(a_0, a_1)^2
//! rho = z^2 E_n/(E_g + r_0),   r_0 = (0.3 r k_0)^2
//! S   = 0.05 E_g/(E_g + r_0) exp(-(rho/0.015)^2)
//! ```
//!
//! `S` is added to the diagonal of the data term's matrix for the *whole* flow, hence a weak spring
//! to zero. `z` is the ratio of the frames' size to the level's: `sqrt(rho)` is the speed, px/frame of
//! the frames, that the phase allows, and slow does not become still by being looked at from afar. A
//! tenth of a pixel cuts the spring to two thirds. Weak as it is, it decides only where nothing else
//! does. `r` is the amplitude floor, `G_2 *` a Gaussian average of deviation 2 px.
//!
//! A fine pattern that moves by its own period looks still. The next levels, coarser by up to
//! [`WITNESSES`], see another pattern there: the spring takes the least of their `exp`.

use multiversion::multiversion;
use ndarray::{Array2, Zip};

use super::exponential::falling;
use super::look::Look;
use super::phase_constraint::{Filters, TERMS};
use super::rows::for_each_rows;
use crate::control::Control;
use crate::error::Result;
use crate::pyramid::{Resampling, resample, smooth};

/// The spring where rest is certain, in units of the data term.
const STRENGTH: f32 = 0.05;
/// Squared speed at which the spring has lost all but 1/e, (px/frame)^2.
const STILLNESS: f32 = 0.015;
/// Amplitude, in floors, at which there is something to see resting.
const VISIBLE: f64 = 0.3;
/// Ratio of sizes up to which coarser levels are asked.
const WITNESSES: f32 = 4.5;
/// Deviation of the averages, px.
const SIGMA: f64 = 2.0;

/// What one level knows of rest, each (H, W) in [0, 1].
pub(super) struct Rest {
    /// `E_g/(E_g + r_0)`: whether there is a pattern.
    pub(super) pattern: Array2<f32>,
    /// The exponential: whether it rests, as far as this level can tell.
    pub(super) rest: Array2<f32>,
}

/// What a look at the unwarped frame tells.
///
/// `floor` is `r^2`, `wavenumber` `k_0`, `zoom` is `z`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn look_for_rest(
    look: &Look<'_>,
    filters: &Filters,
    floor: f32,
    wavenumber: f64,
    zoom: f32,
    control: &Control,
) -> Result<Rest> {
    let (count, width) = (look.filters(), look.width);
    let [mut motion, mut pattern] =
        [(); 2].map(|()| Array2::<f32>::zeros((look.height, look.width)));
    let planes = [&mut motion, &mut pattern].map(|p| p.as_slice_mut().unwrap_or_default());
    let scratch = || vec![0.0; count * TERMS * width];
    look.for_each_row(planes, [width; 2], control, scratch, |y, pair, seen, rows, terms| {
        let [motion, pattern] = rows;
        filters.constrain(y, pair, seen, terms);
        for (j, terms) in terms.chunks_exact(TERMS * width).enumerate() {
            add(pair.here(j), terms, motion, pattern);
        }
    })?;
    judge(&motion, &pattern, (VISIBLE * wavenumber).powi(2) as f32 * floor, zoom, control)
}

/// Adds one filter's `A D_0^2` and `A |G|^2` on a row.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(responses: [(&[f32], &[f32]); 2], terms: &[f32], motion: &mut [f32], pattern: &mut [f32]) {
    let n = motion.len();
    let pattern = &mut pattern[..n];
    let [(a, b), (c, d)] = responses.map(|(re, im)| (&re[..n], &im[..n]));
    let (gx, gy, step) = (&terms[..n], &terms[n..2 * n], &terms[2 * n..3 * n]);
    for x in 0..n {
        let (one, other) = (a[x] * a[x] + b[x] * b[x], c[x] * c[x] + d[x] * d[x]);
        let power = if one < other { one } else { other };
        motion[x] += power * (step[x] * step[x]);
        pattern[x] += power * (gx[x] * gx[x] + gy[x] * gy[x]);
    }
}

/// `Rest` of the sums; `least` is `r_0`.
fn judge(
    motion: &Array2<f32>,
    pattern: &Array2<f32>,
    least: f32,
    zoom: f32,
    control: &Control,
) -> Result<Rest> {
    let mut rest = smooth(motion.view(), SIGMA, control)?;
    let mut pattern = smooth(pattern.view(), SIGMA, control)?;
    let width = rest.ncols();
    let planes = [&mut rest, &mut pattern].map(|p| p.as_slice_mut().unwrap_or_default());
    for_each_rows(planes, [width; 2], control, |_, [rest, pattern]| {
        judge_row(rest, pattern, least, zoom * zoom / STILLNESS);
    })?;
    Ok(Rest { pattern, rest })
}

/// `E_n, E_g` on a row to the exponential and `E_g/(E_g + r_0)`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn judge_row(motion: &mut [f32], pattern: &mut [f32], least: f32, scale: f32) {
    let n = motion.len();
    let pattern = &mut pattern[..n];
    for x in 0..n {
        let inverse = 1.0 / (pattern[x] + least);
        let rho = scale * motion[x] * inverse;
        motion[x] = falling(rho * rho);
        pattern[x] *= inverse;
    }
}

/// Spring of a level from its own `Rest` and the exponentials of coarser levels with their `zoom`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn spring(
    here: &Rest,
    zoom: f32,
    coarser: &[(f32, Array2<f32>)],
    control: &Control,
) -> Result<Array2<f32>> {
    let mut least = here.rest.clone();
    for (_, rest) in coarser.iter().filter(|(other, _)| *other <= WITNESSES * zoom) {
        let rest = resample(rest.view(), least.dim(), Resampling::Linear, control)?;
        Zip::from(&mut least).and(&rest).for_each(|least, &rest| *least = least.min(rest));
    }
    Ok(Zip::from(&here.pattern).and(&least).map_collect(|pattern, rest| STRENGTH * pattern * rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One filter that sees a pattern of amplitude 2 everywhere, moved by `step` rad, `G = (1.5, 0)`.
    fn rest_of(step: f32, zoom: f32) -> Rest {
        let (two, none) = ([2.0; 20], [0.0; 20]);
        let terms = [[1.5; 20], [0.0; 20], [step; 20], [1.0; 20]].concat();
        let [mut motion, mut pattern] = [(); 2].map(|()| Array2::zeros((20, 20)));
        for y in 0..20 {
            let rows = [motion.row_mut(y), pattern.row_mut(y)].map(|row| row.into_slice().unwrap());
            let [motion, pattern] = rows;
            add([(&two, &none), (&none, &two)], &terms, motion, pattern);
        }
        judge(&motion, &pattern, (VISIBLE * 1.5).powi(2) as f32 * 0.25, zoom, &Control::new())
            .unwrap()
    }

    #[test]
    fn a_pattern_at_rest_is_held_and_a_moving_one_is_not() {
        let middle = |rest: &Rest| spring(rest, 1.0, &[], &Control::new()).unwrap()[(10, 10)];
        let still = middle(&rest_of(0.0, 1.0));
        assert!(still > 0.99 * STRENGTH && still <= STRENGTH);
        // A tenth of a pixel: rho = 0.01 but for the floor.
        let slow = middle(&rest_of(0.15, 1.0)) / STRENGTH;
        assert!((0.6..0.7).contains(&slow), "{slow}");
        assert!(middle(&rest_of(0.5, 1.0)) < 1e-3);
        // The same phase at a quarter of the size is four times the speed.
        assert!(middle(&rest_of(0.15, 4.0)) < 1e-6);
    }

    #[test]
    fn a_coarser_level_that_sees_motion_forbids_the_spring() {
        let fine = rest_of(0.0, 1.0);
        let seen = Array2::from_elem((10, 10), 0.25);
        let with = |zoom| spring(&fine, 1.0, &[(zoom, seen.clone())], &Control::new()).unwrap();
        assert!((with(2.0)[(8, 8)] - 0.25 * STRENGTH).abs() < 1e-3);
        assert!(with(8.0)[(8, 8)] > 0.99 * STRENGTH, "too far away to tell");
    }
}
