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
use super::phase_constraint::TERMS;
use super::rows::for_each_rows;
use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::gabor::Responses;
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

/// Looks at the constraints of the unwarped frame, as [`super::phase_constraint::constrain`] makes them.
///
/// `floor` is `r^2`, `wavenumber` `k_0`, `zoom` is `z`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn look_for_rest(
    responses: [&Responses<f32>; 2],
    constraints: &[f32],
    floor: f32,
    wavenumber: f64,
    zoom: f32,
    control: &Control,
) -> Result<Rest> {
    let (filters, height, width) = responses[0].dim();
    let [mut motion, mut pattern] = [(); 2].map(|()| Array2::<f32>::zeros((height, width)));
    for (plane, of_motion) in [(&mut motion, true), (&mut pattern, false)] {
        let samples = plane.as_slice_mut().unwrap_or_default();
        for_each_row(samples, width, control, |y, out| {
            for j in 0..filters {
                let [(a, b), (c, d)] = responses.map(|r| r.row(j, y));
                let terms = &constraints[(y * filters + j) * TERMS * width..][..TERMS * width];
                let (gx, gy, step) =
                    (&terms[..width], &terms[width..2 * width], &terms[2 * width..3 * width]);
                for x in 0..width {
                    let power = (a[x] * a[x] + b[x] * b[x]).min(c[x] * c[x] + d[x] * d[x]);
                    out[x] += power
                        * if of_motion { step[x] * step[x] } else { gx[x] * gx[x] + gy[x] * gy[x] };
                }
            }
        })?;
    }
    let mut rest = smooth(motion.view(), SIGMA, control)?;
    let mut pattern = smooth(pattern.view(), SIGMA, control)?;
    let least = (VISIBLE * wavenumber).powi(2) as f32 * floor;
    let planes = [&mut rest, &mut pattern].map(|p| p.as_slice_mut().unwrap_or_default());
    for_each_rows(planes, [width; 2], control, |_, [rest, pattern]| {
        judge(rest, pattern, least, zoom * zoom / STILLNESS);
    })?;
    Ok(Rest { pattern, rest })
}

/// `E_n, E_g` on a row to the exponential and `E_g/(E_g + r_0)`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn judge(motion: &mut [f32], pattern: &mut [f32], least: f32, scale: f32) {
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
        let mut responses = Responses::zeros(1, 20, 20);
        for y in 0..20 {
            responses.row_mut(0, y).0.fill(2.0);
        }
        let mut constraints = Vec::new();
        for _ in 0..20 {
            constraints.extend([1.5, 0.0, step, 1.0].into_iter().flat_map(|term| [term; 20]));
        }
        let pair = [&responses, &responses];
        look_for_rest(pair, &constraints, 0.25, 1.5, zoom, &Control::new()).unwrap()
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
