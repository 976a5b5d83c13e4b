//! How fast phase changes, row by row: from a derivative, or from one frame to the next.
//!
//! For a response `R = |R| exp(i phi)`, its derivative `dR` along any direction and the response
//! `R'` of another frame,
//!
//! ```text
//! rate = Im(conj(R) dR) / |R|^2              rad per unit of the derivative; NaN where R = 0
//! step = arg(conj(R) R')                     rad in (-pi, pi]
//! ```
//!
//! Neither needs unwrapping. Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 3.

use multiversion::multiversion;

use crate::real::Real;

/// Real and imaginary part of a row.
pub type ComplexRow<'a, T> = (&'a [T], &'a [T]);

/// `Im(conj(R) dR) / |R|^2 + offset` for a row: the rate of phase along the direction in which `dR`
/// is the (demodulated) derivative; NaN where `R = 0`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn rate_of_phase<T: Real>(
    [re, im]: [&[T]; 2],
    [d_re, d_im]: [&[T]; 2],
    power: &[T],
    offset: T,
    out: &mut [T],
) {
    let n = out.len();
    let (re, im, d_re, d_im, power) = (&re[..n], &im[..n], &d_re[..n], &d_im[..n], &power[..n]);
    for x in 0..n {
        out[x] = (re[x] * d_im[x] - im[x] * d_re[x]) / power[x] + offset;
    }
}

/// `arg(conj(R) R')` of a row: the phase advance from one frame to the next, rad in (-pi, pi].
///
/// Exact for any uniform shift below half a wavelength; exactly 0 for equal responses.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn phase_step<T: Real>(first: ComplexRow<'_, T>, second: ComplexRow<'_, T>, out: &mut [T]) {
    let n = out.len();
    let ((a_re, a_im), (b_re, b_im)) = (first, second);
    let (a_re, a_im, b_re, b_im) = (&a_re[..n], &a_im[..n], &b_re[..n], &b_im[..n]);
    for x in 0..n {
        let across = a_re[x] * b_im[x] - a_im[x] * b_re[x];
        let along = a_re[x] * b_re[x] + a_im[x] * b_im[x];
        out[x] = T::angle(across, along);
    }
}

/// `out = re^2 + im^2`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn square<T: Real>(re: &[T], im: &[T], out: &mut [T]) {
    let n = out.len();
    let (re, im) = (&re[..n], &im[..n]);
    for x in 0..n {
        out[x] = re[x] * re[x] + im[x] * im[x];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_is_that_of_a_rotating_phasor() {
        let (re, im) = ([2.0, 0.0], [0.0, 1.0]);
        let (d_re, d_im) = ([0.0, -0.25], [0.5, 0.0]);
        let mut rate = [0.0; 2];
        rate_of_phase([&re, &im], [&d_re, &d_im], &[4.0, 1.0], 1.0, &mut rate);
        assert_eq!(rate, [1.25, 1.25]);
    }

    #[test]
    fn steps_are_signed_and_vanish_for_equal_responses() {
        let ((re, im), mut step) = (([1.0, 0.0, 0.3], [0.0, 2.0, -0.7]), [9.0; 3]);
        phase_step((&re, &im), (&re, &im), &mut step);
        assert_eq!(step, [0.0; 3]);
        // A quarter turn ahead: i R.
        let turned = (im.map(|b| -b), re);
        phase_step((&re, &im), (&turned.0, &turned.1), &mut step);
        assert!(step.iter().all(|s: &f64| (s - std::f64::consts::FRAC_PI_2).abs() < 1e-15));
    }
}
