//! The best finite inverse of a one-dimensional motion blur, and the bank of them.
//!
//! Along a streamline, in steps of 1 px of the pixel's own speed, the blur is a box of L steps,
//! `K(w) = sin(w L/2) / (w L/2)`. Of all kernels h with taps at -n..=n and sum 1, the one that restores a signal of
//! spectrum S from white noise of power N with the least mean square error minimises
//!
//! ```text
//! integral S |1 - K H|^2 + N |H|^2 dw      =>      R h = k + l 1,      sum h = 1
//! R_ij = (S K^2 + N)^(i - j),  k_i = (S K)^(i)               ^: inverse Fourier transform, l the multiplier
//! ```
//!
//! R is a symmetric Toeplitz matrix, so Levinson's recursion solves both right-hand sides in O(n^2). For n without
//! bound this is the regularised inverse `H = K / (K^2 + N/S)`; but that one decays as exp(-6.3 sqrt(N/S) n / L), far
//! too slowly to be cut, and cutting costs several dB where solving for the finite kernel costs tenths.
//!
//! S is the spectrum of natural pictures, c/|w|^2, averaged over the frequencies q in (0, pi) across the motion,
//! which a kernel along it cannot tell apart: `S(w) = c / (pi W) atan(pi / W)`, `W^2 = w^2 + w0^2`. Given a constant
//! regularisation r instead, S = 1 and N = r. Below 1 px of blur the kernel fades to the identity, reached at 1/2 px.
//!
//! Reference: N. Levinson, J. Math. Phys. 25 (1946) 261-278, [10.1002/sapm1946251261](https://doi.org/10.1002/sapm1946251261);
//! B. R. Hunt, IEEE Trans. Computers C-22 (1973) 805-812, [10.1109/TC.1973.5009169](https://doi.org/10.1109/TC.1973.5009169).

use std::f64::consts::{PI, TAU};

use ndarray::Array1;
use rayon::prelude::*;

use crate::control::Control;
use crate::error::Result;
use crate::fourier::{Complex64, LinePlan};
use crate::real::Real;

/// Step of the bank in blur length, px. A step of 1/2 px loses 0.05 dB.
const LENGTH_STEP: f64 = 0.25;

/// Longest blur restored, px; longer ones leave nothing to restore at any noise and would need thousands of taps.
pub const LONGEST_BLUR: f64 = 200.0;

/// Blur, px, up to which a pixel is copied: K is above 0.95 up to half the sampling frequency.
pub const COPIED_BLUR: f64 = 0.5;

/// Blur, px, from which the inverse acts in full.
const FULL_BLUR: f64 = 1.0;

/// Taps on each side of the centre: two blur lengths, and the interpolation's own width.
const TAPS_PER_LENGTH: f64 = 2.0;
const TAPS_LEAST: usize = 8;

/// Frequency, rad/px, below which the spectrum of a picture stops rising: a period of 600 px.
const FLAT_BELOW: f64 = 0.01;

/// Least length of the transforms, and their length per px of blur: the autocorrelations wrap beyond it.
const LEAST_TRANSFORM: usize = 1024;
const TRANSFORM_PER_LENGTH: f64 = 16.0;

/// Ratios of noise to detail, (rad/px)^2, between which kernels are made. The least is what interpolation and the
/// model err by where a picture has no noise; at the greatest, noise drowns detail at 1 rad/px.
const LEAST_RATIO: f64 = 1e-4;
const GREATEST_RATIO: f64 = 1.0;

/// Kernels per octave of that ratio: a step changes the gain by less than 0.05 dB.
const LEVELS_PER_OCTAVE: f64 = 2.0;

/// What the inverse is to be the best for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Regularization {
    /// Ratio of the noise's power to the constant c of a natural picture's spectrum.
    NoiseToDetail(f64),
    /// The same ratio r at every frequency.
    Constant(f64),
}

/// Nearest level of a ratio of noise to detail.
#[inline]
pub(super) fn level_of(ratio: f64) -> u8 {
    let octaves = (ratio.clamp(LEAST_RATIO, GREATEST_RATIO) / LEAST_RATIO).log2();
    (LEVELS_PER_OCTAVE * octaves).round() as u8
}

/// Number of levels of [`level_of`].
fn levels() -> usize {
    usize::from(level_of(GREATEST_RATIO)) + 1
}

/// Kernels for the lengths and levels that occur; each holds h(0), h(1) .. h(n), and h(-k) = h(k).
pub(super) struct KernelBank<T> {
    kernels: Vec<Vec<T>>,
    levels: usize,
}

impl<T: Real> KernelBank<T> {
    /// Solves for the kernels of the (blur length in px, level) given; others may be missing. With a `constant`
    /// regularisation all levels must be 0.
    pub(super) fn new(
        needed: impl Iterator<Item = (f64, u8)>,
        constant: Option<f64>,
        control: &Control,
    ) -> Result<Self> {
        let levels = if constant.is_some() { 1 } else { levels() };
        let mut wanted = Vec::new();
        for (length, level) in needed {
            let Some(index) = index_of(length) else { continue };
            if (index + 1) * levels > wanted.len() {
                wanted.resize((index + 1) * levels, false);
            }
            wanted[index * levels + usize::from(level)] = true;
        }
        let solve = |(place, &wanted): (usize, &bool)| {
            control.check()?;
            if !wanted {
                return Ok(Vec::new());
            }
            let octaves = (place % levels) as f64 / LEVELS_PER_OCTAVE;
            let natural = Regularization::NoiseToDetail(LEAST_RATIO * octaves.exp2());
            let regularization = constant.map_or(natural, Regularization::Constant);
            let kernel = inverse_kernel((place / levels) as f64 * LENGTH_STEP, regularization);
            Ok(kernel.into_iter().map(T::of).collect())
        };
        let kernels = wanted.par_iter().enumerate().map(solve).collect::<Result<_>>()?;
        Ok(Self { kernels, levels })
    }

    /// The kernel nearest to a blur length; None where the pixel is to be copied.
    #[inline]
    pub(super) fn kernel(&self, length: f64, level: u8) -> Option<&[T]> {
        let place = index_of(length)? * self.levels + usize::from(level);
        self.kernels.get(place).map(Vec::as_slice)
    }

    /// Largest number of taps on one side.
    pub(super) fn reach(&self) -> usize {
        self.kernels.iter().map(|k| k.len().saturating_sub(1)).max().unwrap_or(0)
    }
}

/// Place in the bank; None for lengths copied: short, unknown or too long.
#[inline]
fn index_of(length: f64) -> Option<usize> {
    let restored = length > COPIED_BLUR && length <= LONGEST_BLUR;
    restored.then(|| (length / LENGTH_STEP).round() as usize)
}

/// The half kernel h(0) .. h(n) for a blur of `length` px.
pub(super) fn inverse_kernel(length: f64, regularization: Regularization) -> Vec<f64> {
    // Even, because streamlines are walked in strides of two steps.
    let reach = 2 * (0.5 * TAPS_PER_LENGTH * length).ceil() as usize + TAPS_LEAST;
    let taps = 2 * reach + 1;
    let n = ((TRANSFORM_PER_LENGTH * length) as usize).max(4 * taps).max(LEAST_TRANSFORM);
    let n = n.next_power_of_two();
    let (mut both, mut scratch) = (Vec::with_capacity(n), Vec::new());
    for i in 0..n {
        let w = TAU * if 2 * i > n { i as f64 - n as f64 } else { i as f64 } / n as f64;
        let half = 0.5 * w * length;
        let k = if half == 0.0 { 1.0 } else { half.sin() / half };
        let (s, noise) = match regularization {
            Regularization::NoiseToDetail(ratio) => {
                let radius = w.hypot(FLAT_BELOW);
                ((PI / radius).atan() / (PI * radius), ratio)
            }
            Regularization::Constant(r) => (1.0, r),
        };
        // Both transforms at once: even real spectra have real transforms.
        both.push(Complex64::new(s * k * k + noise, s * k));
    }
    LinePlan::new(n).inverse(&mut both, &mut scratch);
    let correlation: Vec<f64> = both[..taps].iter().map(|z| z.re).collect();
    let cross: Vec<f64> = (0..taps).map(|i| both[i.abs_diff(reach)].im).collect();
    let [free, constant] = solve_toeplitz(&correlation, [&cross, &vec![1.0; taps]]);
    let multiplier = (1.0 - free.sum()) / constant.sum();
    let whole = free + multiplier * constant;
    // Halfway to the identity where the blur is too small to matter and the picture must not change abruptly.
    let share = ((length - COPIED_BLUR) / (FULL_BLUR - COPIED_BLUR)).clamp(0.0, 1.0);
    (0..=reach)
        .map(|i| {
            let identity = if i == 0 { 1.0 } else { 0.0 };
            // Rounding breaks the symmetry by a few units in the last place; the mean restores it.
            let h = 0.5 * (whole[reach + i] + whole[reach - i]);
            identity + share * (h - identity)
        })
        .collect()
}

/// Solves `T x = b` for two right-hand sides; T symmetric Toeplitz, positive definite, with first column `r`.
fn solve_toeplitz(r: &[f64], rhs: [&[f64]; 2]) -> [Array1<f64>; 2] {
    let n = r.len();
    // Predictor a (a_0 = 1) of order m and its error power.
    let mut predictor = vec![1.0];
    let mut power = r[0];
    let mut solutions = rhs.map(|b| vec![b[0] / r[0]]);
    for m in 1..n {
        let reflection: f64 =
            -predictor.iter().enumerate().map(|(i, a)| a * r[m - i]).sum::<f64>() / power;
        predictor.push(0.0);
        predictor = (0..=m).map(|i| predictor[i] + reflection * predictor[m - i]).collect();
        power *= 1.0 - reflection * reflection;
        for (x, b) in solutions.iter_mut().zip(rhs) {
            let known: f64 = x.iter().enumerate().map(|(i, x)| x * r[m - i]).sum();
            let step = (b[m] - known) / power;
            x.push(0.0);
            // The reversed predictor is the solution for the last unit vector, times the power.
            x.iter_mut().zip(predictor.iter().rev()).for_each(|(x, a)| *x += step * a);
        }
    }
    solutions.map(Array1::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toeplitz_systems_are_solved() {
        let r = [4.0, 1.5, -0.7, 0.2, 0.1];
        let b = [1.0, -2.0, 0.5, 3.0, 0.25];
        let [x, y] = solve_toeplitz(&r, [&b, &[1.0; 5]]);
        for i in 0..5usize {
            let row = |x: &Array1<f64>| (0..5usize).map(|j| r[i.abs_diff(j)] * x[j]).sum::<f64>();
            assert!((row(&x) - b[i]).abs() < 1e-13 && (row(&y) - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn kernels_keep_constants_and_undo_their_blur() {
        let bank = Regularization::NoiseToDetail(1e-3);
        for length in [0.75, 1.0, 4.25, 15.0, 60.0] {
            let h = inverse_kernel(length, bank);
            let sum = h[0] + 2.0 * h[1..].iter().sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        // A slow wave, well inside the main lobe of the blur, comes back: gain K H within 3 % of 1.
        let h = inverse_kernel(7.0, bank);
        let w = 0.3;
        let gain = h[0] + 2.0 * (1..h.len()).map(|k| h[k] * (w * k as f64).cos()).sum::<f64>();
        let blur = (0.5 * w * 7.0f64).sin() / (0.5 * w * 7.0);
        assert!((gain * blur - 1.0).abs() < 0.03, "{}", gain * blur);
    }

    #[test]
    fn short_blur_fades_to_the_identity() {
        assert_eq!(inverse_kernel(COPIED_BLUR, Regularization::Constant(0.01))[0], 1.0);
        assert!(index_of(COPIED_BLUR).is_none() && index_of(f64::NAN).is_none());
        assert!(index_of(LONGEST_BLUR * 2.0).is_none());
    }
}
