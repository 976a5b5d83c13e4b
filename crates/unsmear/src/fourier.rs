//! Two-dimensional discrete Fourier transforms, planned once.
//!
//! ```text
//! forward  F(p, q) = sum_{y, x} f(y, x) exp(-2 pi i (p y / H + q x / W))
//! inverse  f(y, x) = 1 / (H W) sum_{p, q} F(p, q) exp(+2 pi i (p y / H + q x / W))
//! ```
//!
//! The inverse carries the whole normalisation. Arrays are row-major (H, W) slices, transformed in
//! place. `f64` only: transforms serve the founding method and the design of kernels, where
//! exactness counts; the per-pixel work of the library is local.

use std::sync::Arc;

/// Complex numbers of either precision.
pub use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Shorthand of this module's users.
pub type Complex64 = Complex<f64>;

/// Side of the square blocks of a transposition: two blocks of 16-byte samples fit a 32 KiB cache.
const BLOCK: usize = 16;

/// Transforms along rows of length `n`, forward and inverse (not normalised).
#[derive(Clone)]
pub struct LinePlan {
    n: usize,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl LinePlan {
    /// Plans transforms of length `n >= 1`.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let mut planner = FftPlanner::new();
        Self { n, forward: planner.plan_fft_forward(n), inverse: planner.plan_fft_inverse(n) }
    }

    /// Transforms each consecutive line of `n` samples; `scratch` grows to what is needed.
    pub fn forward(&self, lines: &mut [Complex64], scratch: &mut Vec<Complex64>) {
        run(self.forward.as_ref(), self.n, lines, scratch);
    }

    /// Inverse of [`LinePlan::forward`] times `n`.
    pub fn inverse(&self, lines: &mut [Complex64], scratch: &mut Vec<Complex64>) {
        run(self.inverse.as_ref(), self.n, lines, scratch);
    }
}

fn run(fft: &dyn Fft<f64>, n: usize, lines: &mut [Complex64], scratch: &mut Vec<Complex64>) {
    debug_assert!(lines.len().is_multiple_of(n), "whole lines only");
    scratch.resize(fft.get_inplace_scratch_len(), Complex64::default());
    fft.process_with_scratch(lines, scratch);
}

/// Plan of a two-dimensional transform; see the [module](self).
#[derive(Clone)]
pub struct Fft2 {
    rows: LinePlan,
    columns: LinePlan,
}

impl Fft2 {
    /// Plans transforms of (height, width), both at least 1.
    #[must_use]
    pub fn new(height: usize, width: usize) -> Self {
        Self { rows: LinePlan::new(width), columns: LinePlan::new(height) }
    }

    /// Forward transform in place.
    pub fn forward(&self, picture: &mut [Complex64], scratch: &mut Vec<Complex64>) {
        let (height, width) = (self.columns.n, self.rows.n);
        self.rows.forward(picture, scratch);
        let mut turned = transposed(picture, height, width);
        self.columns.forward(&mut turned, scratch);
        transpose_into(&turned, width, height, picture);
    }

    /// Inverse transform in place, normalised.
    pub fn inverse(&self, picture: &mut [Complex64], scratch: &mut Vec<Complex64>) {
        let (height, width) = (self.columns.n, self.rows.n);
        self.rows.inverse(picture, scratch);
        let mut turned = transposed(picture, height, width);
        self.columns.inverse(&mut turned, scratch);
        transpose_into(&turned, width, height, picture);
        let scale = 1.0 / (height * width) as f64;
        picture.iter_mut().for_each(|sample| *sample *= scale);
    }
}

/// The transpose of a row-major (height, width) array.
#[must_use]
pub fn transposed(source: &[Complex64], height: usize, width: usize) -> Vec<Complex64> {
    let mut target = vec![Complex64::default(); source.len()];
    transpose_into(source, height, width, &mut target);
    target
}

/// Writes the transpose of a row-major (height, width) array to `target`.
pub fn transpose_into(source: &[Complex64], height: usize, width: usize, target: &mut [Complex64]) {
    for top in (0..height).step_by(BLOCK) {
        let bottom = (top + BLOCK).min(height);
        for left in (0..width).step_by(BLOCK) {
            for x in left..(left + BLOCK).min(width) {
                let column = &mut target[x * height + top..x * height + bottom];
                for (y, sample) in (top..bottom).zip(column) {
                    *sample = source[y * width + x];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn picture(height: usize, width: usize) -> Vec<Complex64> {
        (0..height * width)
            .map(|i| Complex64::new((i as f64 * 0.7).sin(), (i as f64 * 1.3).cos()))
            .collect()
    }

    #[test]
    fn equals_the_definition() {
        let (height, width) = (6, 35);
        let source = picture(height, width);
        let mut spectrum = source.clone();
        let mut scratch = vec![Complex64::new(9.0, 9.0); 3];
        Fft2::new(height, width).forward(&mut spectrum, &mut scratch);
        for (p, q) in [(0, 0), (1, 0), (0, 1), (5, 34), (3, 17)] {
            let mut sum = Complex64::default();
            for (i, sample) in source.iter().enumerate() {
                let turn = (p * (i / width)) as f64 / height as f64
                    + (q * (i % width)) as f64 / width as f64;
                sum += sample * Complex64::from_polar(1.0, -TAU * turn);
            }
            // 210 terms of order 1, each rounded at 1e-16.
            assert!((spectrum[p * width + q] - sum).norm() < 1e-12);
        }
    }

    #[test]
    fn inverse_undoes_forward() {
        for (height, width) in [(1, 1), (1, 7), (16, 33), (40, 24)] {
            let source = picture(height, width);
            let mut copy = source.clone();
            let (plan, mut scratch) = (Fft2::new(height, width), Vec::new());
            plan.forward(&mut copy, &mut scratch);
            plan.inverse(&mut copy, &mut scratch);
            assert!(copy.iter().zip(&source).all(|(a, b)| (a - b).norm() < 1e-14));
        }
    }
}
