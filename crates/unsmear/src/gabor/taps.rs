//! Wavevectors of a bank, and the taps of its one-dimensional complex factors.
//!
//! Along one axis, with the unit-sum Gaussian `g`, a filter is `g(n) exp(i k n)`: even taps
//! `g cos(k n)` and odd taps `g sin(k n)`. To be free of the mean the even taps become
//! `c - g sum(c)`; the odd ones sum to 0 already.

use std::f64::consts::PI;

use crate::real::Real;

/// Even and odd taps `0..=radius` of one complex factor; the odd ones are absent for `k = 0`.
#[derive(Debug, Clone)]
pub(super) struct EvenOdd<T> {
    pub(super) even: Vec<T>,
    pub(super) odd: Vec<T>,
    pub(super) real: bool,
}

impl<T: Real> EvenOdd<T> {
    /// Correlation taps of `g exp(i k x)`: the odd part changes sign against convolution's.
    pub(super) fn new(gaussian: &[f64], k: f64, free_of_mean: bool) -> Self {
        let radius = gaussian.len() / 2;
        let half = &gaussian[radius..];
        let mut even: Vec<f64> =
            half.iter().enumerate().map(|(j, g)| g * (k * j as f64).cos()).collect();
        if free_of_mean {
            let sum = even[0] + 2.0 * even[1..].iter().sum::<f64>();
            even.iter_mut().zip(half).for_each(|(c, g)| *c -= g * sum);
        }
        let odd = half.iter().enumerate().map(|(j, g)| T::of(-g * (k * j as f64).sin())).collect();
        Self { even: even.into_iter().map(T::of).collect(), odd, real: k == 0.0 }
    }
}

/// `k_j`; exact on the axes and exactly mirrored about them, as the shared passes assume.
pub(super) fn wavevector(k0: f64, j: usize, n: usize) -> [f64; 2] {
    if 2 * j == n {
        return [0.0, k0];
    }
    if 2 * j > n {
        let [kx, ky] = wavevector(k0, n - j, n);
        return [-kx, ky];
    }
    let theta = PI * j as f64 / n as f64;
    [k0 * theta.cos(), k0 * theta.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolve::gaussian_taps;

    #[test]
    fn factors_free_of_the_mean_sum_to_nothing() {
        let taps = EvenOdd::<f64>::new(&gaussian_taps(2.0, 6), 0.9, true);
        assert!((taps.even[0] + 2.0 * taps.even[1..].iter().sum::<f64>()).abs() < 1e-15);
        let plain = EvenOdd::<f64>::new(&gaussian_taps(2.0, 6), 0.0, false);
        assert!(plain.real && plain.odd.iter().all(|&o| o == 0.0));
    }

    #[test]
    fn wavevectors_are_mirrored_to_the_last_bit() {
        for n in 2..9 {
            for j in 1..n {
                let ([kx, ky], [mx, my]) = (wavevector(0.7, j, n), wavevector(0.7, n - j, n));
                assert!(kx == -mx && ky == my);
                assert!((kx.hypot(ky) - 0.7).abs() < 1e-15);
            }
        }
    }
}
