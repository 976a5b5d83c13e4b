//! Point spread functions of motion: the exact sub-pixel path, and MATLAB's anti-aliased line.
//!
//! **Exact path.** During the exposure a point travels `s(t) = t V + t^2/2 A`, t in [-1/2, 1/2] of the exposure, with
//! `V = (u, v)` the displacement (px; x right, y down) and `A` the acceleration (px per exposure squared). The picture
//! is `b = x * w`, i.e. `b(p) = mean over t of x(p - s(t))`, and each instant is spread over the four pixels around it
//! by the tent `L(z) = max(0, 1 - |z|)`:
//!
//! ```text
//! w(y, x) = integral_{-1/2}^{1/2} L(x - s_x(t)) L(y - s_y(t)) dt
//! ```
//!
//! Between two crossings of grid lines a straight path makes the integrand a polynomial of degree 2 in t, for which
//! Simpson's formula is the exact primitive. Curved paths are chords no farther than [`CHORD_ERROR`] from the path.
//! `w >= 0`, `sum w = 1`; for `A = 0` it is symmetric about the centre, hence centred; otherwise its centroid is
//! `A / 24`, because the centre is where the point is at mid-exposure. No motion gives the 1 x 1 delta.
//!
//! **MATLAB's line** ([`fspecial_motion`]): a pixel weighs `max(0, 1 - d)` with d its distance to a segment of the
//! given length through the centre, normalised to sum 1; the rule of `fspecial('motion', length, angle)` as its
//! documentation states it, with the end treatment the founding method relied on (lengths below 1 count as 1, angle
//! modulo 180 degrees, counter-clockwise with y up). It is not exact: weights are distances, not times.
//!
//! References: C. Texin, "Optical Flow Using Phase Information for Deblurring", M.Eng. thesis, MIT, 2007, chapter 4;
//! P. C. Hansen, J. G. Nagy, D. P. O'Leary, "Deblurring Images", SIAM 2006,
//! [10.1137/1.9780898718874](https://doi.org/10.1137/1.9780898718874), section 3.2.

use ndarray::{Array2, s};

use crate::error::{Error, Result, require};

/// Longest motion for which a kernel is made, px on either axis: an array of 4097 x 4097 samples is 134 MB.
pub const LONGEST_MOTION: f64 = 4096.0;

/// Largest distance of a curved path from its chords, px: a hundredth of what moves a kernel weight by 1 %.
pub const CHORD_ERROR: f64 = 1e-4;

/// The point spread function of a displacement `velocity = [u, v]` with `acceleration = [a_x, a_y]`.
///
/// Shape odd on both axes, centre at mid-exposure, sum 1; see the [module](self).
///
/// # Errors
/// [`Error::Value`] when a component is not finite or the path leaves [`LONGEST_MOTION`].
///
/// ```
/// let psf = unsmear::psf::motion_psf([2.0, 0.0], [0.0, 0.0])?;
/// assert_eq!(psf.as_slice(), Some(&[0.25, 0.5, 0.25][..]));
/// # Ok::<(), unsmear::Error>(())
/// ```
pub fn motion_psf(velocity: [f64; 2], acceleration: [f64; 2]) -> Result<Array2<f64>> {
    let in_range = |z: f64| z.abs() <= LONGEST_MOTION;
    for (name, value) in ["u", "v"].into_iter().zip(velocity) {
        require(name, value, "finite and at most 4096 px", in_range)?;
    }
    for value in acceleration {
        require("acceleration", value, "finite and at most 4096 px", in_range)?;
    }
    let path = chords(velocity, acceleration);
    // The smallest odd array that holds the path; a tent centred on a pixel of its rim ends there.
    let half = [0, 1].map(|axis| {
        path.iter().fold(0.0f64, |most, point| most.max(point[axis].abs())).ceil() as usize
    });
    let mut psf = Array2::zeros((2 * half[1] + 1, 2 * half[0] + 1));
    let duration = 1.0 / (path.len() - 1) as f64;
    for ends in path.windows(2) {
        spread_segment(&mut psf, half, ends[0], ends[1], duration);
    }
    Ok(psf)
}

/// Points of the path, equally spaced in time; the two ends of a straight one.
fn chords(velocity: [f64; 2], acceleration: [f64; 2]) -> Vec<[f64; 2]> {
    // The path leaves the chord of a time step h by |A| h^2 / 8 at most.
    let bend = acceleration[0].hypot(acceleration[1]);
    let steps = (bend / (8.0 * CHORD_ERROR)).sqrt().ceil().max(1.0);
    (0..=steps as usize)
        .map(|k| {
            let t = k as f64 / steps - 0.5;
            [0, 1].map(|axis| t * velocity[axis] + 0.5 * t * t * acceleration[axis])
        })
        .collect()
}

/// Adds the time spent on the segment from `a` to `b` (total `duration`) to the pixels, in closed form.
fn spread_segment(
    psf: &mut Array2<f64>,
    half: [usize; 2],
    a: [f64; 2],
    b: [f64; 2],
    duration: f64,
) {
    let mut knots = vec![0.0, 1.0];
    for axis in [0, 1] {
        let (from, to) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
        let (first, last) = (from.ceil() as i64, to.floor() as i64);
        if from < to {
            knots.extend((first..=last).map(|k| (k as f64 - a[axis]) / (b[axis] - a[axis])));
        }
    }
    knots.retain(|s| (0.0..=1.0).contains(s));
    knots.sort_by(f64::total_cmp);
    let at = |s: f64| [0, 1].map(|axis| a[axis] + s * (b[axis] - a[axis]) + half[axis] as f64);
    for piece in knots.windows(2) {
        let (start, end) = (piece[0], piece[1]);
        let middle = at(0.5 * (start + end));
        // All of the piece lies in one cell of the grid, and the cell of its middle is beyond doubt.
        let cell = [0, 1].map(|axis| (middle[axis] as usize).min((2 * half[axis]).max(1) - 1));
        let weight = duration * (end - start) / 6.0;
        for (point, share) in [(at(start), 1.0), (middle, 4.0), (at(end), 1.0)] {
            let f = [0, 1].map(|axis| (point[axis] - cell[axis] as f64).clamp(0.0, 1.0));
            for (dy, wy) in [(0, 1.0 - f[1]), (1, f[1])] {
                for (dx, wx) in [(0, 1.0 - f[0]), (1, f[0])] {
                    // Off the rim only where the weight is exactly zero (no motion on that axis).
                    if let Some(sample) = psf.get_mut((cell[1] + dy, cell[0] + dx)) {
                        *sample += weight * share * wy * wx;
                    }
                }
            }
        }
    }
}

/// MATLAB's `fspecial('motion', length, angle)`; `length` in px (below 1 counts as 1), `angle` in degrees,
/// counter-clockwise with y up. See the [module](self).
///
/// # Errors
/// [`Error::Value`] when `length` is negative, above [`LONGEST_MOTION`] or either is not finite.
pub fn fspecial_motion(length: f64, angle: f64) -> Result<Array2<f64>> {
    if !(0.0..=LONGEST_MOTION).contains(&length) {
        return Err(Error::value("length", "in [0, 4096] px", length));
    }
    require("angle", angle, "finite (degrees)", |_| true)?;
    let epsilon = f64::EPSILON;
    let length = length.max(1.0);
    let end = (length - 1.0) / 2.0;
    let (sine, cosine) = (angle.rem_euclid(180.0) / 180.0 * std::f64::consts::PI).sin_cos();
    // A hair less, so that an end exactly on a pixel does not open an empty rim; the original takes it from a signed
    // length, hence the sign.
    let columns = (end * cosine.abs() + 1.0 - (length * epsilon).copysign(cosine)).trunc() as usize;
    let rows = (end * sine + 1.0 - length * epsilon).trunc() as usize;
    let quadrant = Array2::from_shape_fn((rows + 1, columns + 1), |(y, x)| {
        let (y, x) = (y as f64, x as f64);
        let across = y * cosine.abs() - x * sine;
        let distance = if x.hypot(y) >= end && across.abs() <= 1.0 {
            across.hypot(end - ((x + across * sine) / cosine.abs()).abs())
        } else {
            across.abs()
        };
        (1.0 + epsilon - distance).max(0.0)
    });
    let mut psf = Array2::zeros((2 * rows + 1, 2 * columns + 1));
    psf.slice_mut(s![..=rows, ..=columns]).assign(&quadrant.slice(s![..;-1, ..;-1]));
    psf.slice_mut(s![rows.., columns..]).assign(&quadrant);
    let total = psf.sum() + epsilon * length * length;
    psf /= total;
    // The quadrant falls to the right; an angle below 90 degrees rises.
    if cosine > 0.0 {
        psf.invert_axis(ndarray::Axis(0));
    }
    Ok(psf.as_standard_layout().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(psf: &Array2<f64>) -> [f64; 3] {
        let (cy, cx) = ((psf.nrows() / 2) as f64, (psf.ncols() / 2) as f64);
        psf.indexed_iter().fold([0.0; 3], |[s, mx, my], ((y, x), w)| {
            [s + w, mx + w * (x as f64 - cx), my + w * (y as f64 - cy)]
        })
    }

    #[test]
    fn paths_sum_to_one_and_have_the_centroid_of_their_law() {
        for (v, a) in [
            ([0.0, 0.0], [0.0, 0.0]),
            ([7.3, -2.6], [0.0, 0.0]),
            ([0.0, 4.0], [0.0, 0.0]),
            ([1e-3, 1e-9], [0.0, 0.0]),
            ([9.0, 1.0], [-3.0, 6.0]),
        ] {
            let psf = motion_psf(v, a).unwrap();
            assert!(psf.iter().all(|&w| w >= 0.0));
            let [sum, mx, my] = moments(&psf);
            // Rounding of some hundred additions; the chords of a curve cost a part of their distance to it.
            let tolerance = if a == [0.0, 0.0] { 1e-13 } else { CHORD_ERROR };
            assert!((sum - 1.0).abs() < 1e-13, "{v:?}: {sum}");
            assert!((mx - a[0] / 24.0).abs() < tolerance && (my - a[1] / 24.0).abs() < tolerance);
        }
    }

    #[test]
    fn whole_lengths_are_boxes_with_half_ends_and_rotate_with_the_motion() {
        let psf = motion_psf([4.0, 0.0], [0.0, 0.0]).unwrap();
        assert_eq!(psf.as_slice().unwrap(), [0.125, 0.25, 0.25, 0.25, 0.125]);
        let across = motion_psf([5.3, 2.1], [0.0, 0.0]).unwrap();
        let down = motion_psf([2.1, 5.3], [0.0, 0.0]).unwrap();
        // The same pieces added in another order: rounding only.
        assert!(across.t().iter().zip(&down).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn bad_motions_are_refused_by_name() {
        assert!(
            motion_psf([f64::NAN, 0.0], [0.0; 2]).unwrap_err().to_string().starts_with("u must")
        );
        assert!(motion_psf([0.0, 1e9], [0.0; 2]).is_err());
        assert!(fspecial_motion(-1.0, 0.0).unwrap_err().to_string().starts_with("length must"));
    }
}
