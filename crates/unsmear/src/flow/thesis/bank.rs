//! The founding method's Gabor filters, flaws included.
//!
//! With tuning frequency `f0` cycles/px and bandwidth `beta` octaves (angles `w` have y *up*):
//!
//! ```text
//! sigma   = (2^beta + 1) / (f0 (2^beta - 1))                               px and frames
//! spacing = 2 atan(1 / (sigma f0)),  N = floor(360 / spacing) filters at w = 0, 360/N, ...
//! g(x, y) = exp(2 pi i f0 (x cos w + y sin w)) exp(-(x^2 + y^2) / (2 sigma^2))
//! ```
//!
//! on a grid as large as the picture, zero outside a disc of radius `round(sigma)`, divided by its
//! complex sum; then only the bins of its discrete spectrum nearer than `ceil(W / sigma)` to the
//! tuning frequency are kept. The window in time is the unit-sum Gaussian of the same `sigma` over
//! all frames, zero beyond both ends.
//!
//! A factor 2 pi is missing from `sigma` (f0 = .06, beta = .8: 61.6 px instead of 9.8), so a motion
//! edge smears over a hundred pixels and the mean leaks in; [`crate::gabor`] is the mended bank.
//! Grids of even size are those of the listing; odd sizes keep its formulas.
//!
//! Source: C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT 2007, chapter 4.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::error::{Error, Result, require};
use crate::fourier::{Complex64, Fft2};

/// Tuning and shape of the bank; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bank {
    height: usize,
    width: usize,
    frequency: f64,
    sigma: f64,
}

impl Bank {
    /// A bank for pictures of (height, width), `frequency` in cycles/px, `bandwidth` in octaves.
    ///
    /// # Errors
    /// [`Error::Value`] when a parameter is out of range or leaves no filter.
    pub fn new(height: usize, width: usize, frequency: f64, bandwidth: f64) -> Result<Self> {
        require("tuning_frequency", frequency, "in (0, 0.5) cycles/px", |f| f > 0.0 && f < 0.5)?;
        require("bandwidth_octaves", bandwidth, "in (0, 5]", |b| b > 0.0 && b <= 5.0)?;
        let ratio = bandwidth.exp2();
        let sigma = 1.0 / (frequency * (ratio - 1.0) / (ratio + 1.0));
        let bank = Self { height, width, frequency, sigma };
        if bank.angles().is_empty() {
            return Err(Error::value(
                "bandwidth_octaves",
                "narrow enough for one filter",
                bandwidth,
            ));
        }
        Ok(bank)
    }

    /// (height, width) of the pictures and of every filter.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Deviation of the window, px and frames.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Angle of each filter, degrees, y up.
    #[must_use]
    pub fn angles(&self) -> Vec<f64> {
        let spacing = 2.0 * (1.0 / (self.sigma * self.frequency)).atan().to_degrees();
        let count = (360.0 / spacing).floor();
        (0..count as usize).map(|i| i as f64 * (360.0 / count)).collect()
    }

    /// The filter at `angle` degrees before its spectrum is trimmed, row-major (H, W).
    #[must_use]
    pub fn window(&self, angle: f64) -> Vec<Complex64> {
        let (sin, cos) = angle.to_radians().sin_cos();
        let factor = |position: f64, direction: f64| {
            let envelope = (-position * position / (2.0 * self.sigma * self.sigma)).exp();
            Complex64::from_polar(envelope, TAU * self.frequency * direction * position)
        };
        let x = centred(self.width).map(|x| factor(x, cos)).collect::<Vec<_>>();
        let y = centred(self.height).map(|y| factor(1.0 - y, sin)).collect::<Vec<_>>();
        let radius = self.sigma.round();
        let middle = [self.height as f64 / 2.0, self.width as f64 / 2.0 - 1.0];
        let mut kernel = vec![Complex64::default(); self.height * self.width];
        for row in self.disc_rows() {
            let dy = row as f64 - middle[0];
            let line = &mut kernel[row * self.width..(row + 1) * self.width];
            for (column, (sample, along_x)) in line.iter_mut().zip(&x).enumerate() {
                let dx = column as f64 - middle[1];
                // Squares of halves are exact, so that no tie is decided by rounding.
                if dy * dy + dx * dx < radius * radius {
                    *sample = y[row] * along_x;
                }
            }
        }
        let sum: Complex64 = kernel.iter().sum();
        kernel.iter_mut().for_each(|sample| *sample /= sum);
        kernel
    }

    /// Rows that the disc of the window may reach.
    pub(super) fn disc_rows(&self) -> Range<usize> {
        around(self.height as f64 / 2.0, self.sigma.round(), self.height)
    }

    /// Row and column of the tuning frequency, zero frequency in the middle, and the distance from
    /// which on bins are dropped.
    fn kept_disc(&self, angle: f64) -> ([f64; 2], f64) {
        let (sin, cos) = angle.to_radians().sin_cos();
        let (h, w) = (self.height as f64, self.width as f64);
        // `round` goes half away from zero, as the listing's does.
        let row = (h / 2.0 + 1.0).ceil() - (h * self.frequency * sin).round() - 1.0;
        let column = (w / 2.0 + 1.0).floor() + (w * self.frequency * cos).round() - 1.0;
        ([row, column], (w / self.sigma).ceil())
    }

    /// Rows and columns that hold every kept bin, zero frequency in the middle.
    pub(super) fn kept_extent(&self, angle: f64) -> (Range<usize>, Range<usize>) {
        let ([row, column], reach) = self.kept_disc(angle);
        (around(row, reach, self.height), around(column, reach, self.width))
    }

    /// Whether the bin (row, column) of the spectrum with zero frequency in the middle is kept.
    #[must_use]
    pub fn keeps(&self, angle: f64, row: usize, column: usize) -> bool {
        let ([centre_row, centre_column], reach) = self.kept_disc(angle);
        (row as f64 - centre_row).hypot(column as f64 - centre_column) < reach
    }

    /// The filter at `angle` degrees, row-major (H, W); `plan` transforms that shape. The flow
    /// takes the shorter way of [`super::pruned`].
    #[must_use]
    pub fn kernel(&self, angle: f64, plan: &Fft2, scratch: &mut Vec<Complex64>) -> Vec<Complex64> {
        let (h, w) = (self.height, self.width);
        let mut kernel = self.window(angle);
        plan.forward(&mut kernel, scratch);
        for (row, line) in kernel.chunks_mut(w).enumerate() {
            for (column, bin) in line.iter_mut().enumerate() {
                // Zero frequency moves from the first bin to the middle.
                if !self.keeps(angle, (row + h / 2) % h, (column + w / 2) % w) {
                    *bin = Complex64::default();
                }
            }
        }
        plan.inverse(&mut kernel, scratch);
        kernel
    }

    /// Unit-sum Gaussian taps over `frames` frames.
    #[must_use]
    pub fn temporal_taps(&self, frames: usize) -> Vec<f64> {
        let taps: Vec<f64> =
            centred(frames).map(|t| (-t * t / (2.0 * self.sigma * self.sigma)).exp()).collect();
        let sum: f64 = taps.iter().sum();
        taps.into_iter().map(|tap| tap / sum).collect()
    }
}

/// The positions of `0..n` that may lie nearer than `reach` to `middle`.
fn around(middle: f64, reach: f64, n: usize) -> Range<usize> {
    // Casting saturates at 0.
    let end = ((middle + reach).ceil() as usize).min(n);
    ((middle - reach).floor() as usize).min(end)..end
}

/// `-n/2 + 1 ..= n/2` for even `n`, `-(n-1)/2 ..= (n-1)/2` for odd.
fn centred(n: usize) -> impl Iterator<Item = f64> {
    let first = n.saturating_sub(1) / 2;
    (0..n).map(move |i| i as f64 - first as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_tuning_gives_the_published_bank() {
        let bank = Bank::new(16, 20, 0.06, 0.8).unwrap();
        assert!((bank.sigma() - 61.6).abs() < 0.05);
        assert_eq!(bank.angles().len(), 11);
        let taps = bank.temporal_taps(3);
        assert!((taps.iter().sum::<f64>() - 1.0).abs() < 1e-15 && taps[0] == taps[2]);
        assert!(Bank::new(16, 20, 0.6, 0.8).is_err() && Bank::new(16, 20, 0.06, 0.0).is_err());
    }

    /// All bins kept, the trimmed kernel is the window itself.
    #[test]
    fn trimming_nothing_changes_nothing() {
        let bank = Bank::new(6, 40, 0.2, 4.9).unwrap();
        let wide = Bank { sigma: 1.0, ..bank };
        let kernel = wide.kernel(30.0, &Fft2::new(6, 40), &mut Vec::new());
        let window = wide.window(30.0);
        assert!(kernel.iter().zip(&window).all(|(a, b)| (a - b).norm() < 1e-14));
    }
}
