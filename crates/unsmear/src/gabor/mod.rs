//! A bank of quadrature Gabor filters over orientation, and its responses to one picture.
//!
//! With `k0 = 2 pi f0` rad/px and a bandwidth of `beta` octaves (measured at one deviation of the
//! filter's Gaussian spectrum), filter `j` of `N` is
//!
//! ```text
//! sigma = (2^beta + 1) / ((2^beta - 1) k0)                               px
//! k_j   = k0 (cos theta_j, sin theta_j),   theta_j = j pi / N            x right, y down
//! g_j(x, y) = exp(i k_j . (x, y)) exp(-(x^2 + y^2) / (2 sigma^2)) / sum
//! ```
//!
//! and its response the convolution `R_j = g_j * I`, whose phase advances by `+k_j` per pixel on a
//! pattern tuned to it. The half circle of orientations is complete: the other half holds complex
//! conjugates. A flat region must answer with nothing, so the filters are freed of their response
//! to a constant: in the one-dimensional factor along the larger component of `k_j`, the even taps
//! become `c - g sum(c)`.
//!
//! Differs from the founding method (see [`crate::flow::thesis`]), whose deviation lacks a factor
//! 2 pi, whose filters leak the mean and which covers the circle twice.
//!
//! The separable factors of mirrored orientations `theta` and `pi - theta` are shared: with
//! `A + iB` the picture filtered along x and `C + iS` the taps along y,
//! `R = (AC - BS) + i (AS + BC)` and its mirror `(AC + BS) + i (AS - BC)`.
//!
//! Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772), section 3 and appendix A.

use crate::convolve::gaussian_taps;
use crate::error::Result;
use crate::real::Real;

mod parameters;
mod respond;
mod responses;
pub(crate) mod stream;
mod taps;

pub use parameters::GaborParameters;
pub use responses::Responses;
use taps::{EvenOdd, wavevector};

/// Planned filters; see the [module](self). Build once, run on many pictures.
#[derive(Debug, Clone)]
pub struct GaborBank<T> {
    sigma: f64,
    radius: usize,
    wavevectors: Vec<[f64; 2]>,
    /// Taps along x, one set for each distinct `|k_x|`.
    along_x: Vec<EvenOdd<T>>,
    pairs: Vec<MirrorPair<T>>,
}

/// The filters at `(k_x, k_y)` and, unless it lies on an axis, at `(-k_x, k_y)`.
#[derive(Debug, Clone)]
struct MirrorPair<T> {
    along_x: usize,
    along_y: EvenOdd<T>,
    filter: usize,
    mirror: Option<usize>,
}

impl<T: Real> GaborBank<T> {
    /// Plans the filters.
    ///
    /// # Errors
    /// [`Error::Value`](crate::Error::Value) when a parameter is outside its documented range.
    pub fn new(parameters: &GaborParameters) -> Result<Self> {
        parameters.check()?;
        let GaborParameters { orientations, support, .. } = *parameters;
        Ok(Self::tuned(parameters.wavenumber(), parameters.sigma(), orientations, support))
    }

    /// A bank whose wavenumber `k0` (rad/px) and window deviation `sigma` (px) are chosen apart;
    /// the parameters have been checked.
    pub(crate) fn tuned(k0: f64, sigma: f64, n: usize, support: f64) -> Self {
        let radius = (support * sigma).ceil() as usize;
        let gaussian = gaussian_taps(sigma, radius);
        let wavevectors: Vec<[f64; 2]> = (0..n).map(|j| wavevector(k0, j, n)).collect();
        let mut bank = Self { sigma, radius, wavevectors, along_x: Vec::new(), pairs: Vec::new() };
        for filter in 0..=n / 2 {
            let [kx, ky] = bank.wavevectors[filter];
            // The slack keeps rounding from moving a true tie (45 degrees) to y.
            let x_carries = kx.abs() >= ky.abs() * (1.0 - 1e-12);
            bank.pairs.push(MirrorPair {
                along_x: bank.along_x.len(),
                along_y: EvenOdd::new(&gaussian, ky, !x_carries),
                filter,
                mirror: (filter > 0 && 2 * filter < n).then(|| n - filter),
            });
            bank.along_x.push(EvenOdd::new(&gaussian, kx, x_carries));
        }
        bank
    }

    /// Deviation of the Gaussian window, px; its inverse is that of the spectrum, rad/px.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Farthest sample that takes part in a response, px: the halo of the bank.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.radius
    }

    /// `(k_x, k_y)` of each filter, rad/px.
    #[must_use]
    pub fn wavevectors(&self) -> &[[f64; 2]] {
        &self.wavevectors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::border::Border;
    use crate::control::Control;
    use ndarray::Array2;

    fn bank(orientations: usize) -> GaborBank<f64> {
        GaborBank::new(&GaborParameters { orientations, ..Default::default() }).unwrap()
    }

    fn respond(bank: &GaborBank<f64>, picture: &Array2<f64>) -> Responses<f64> {
        bank.respond(picture.view(), Border::Replicate, &Control::new()).unwrap()
    }

    /// A cosine along `k` answers its own filter with half its amplitude times exp(i k x), but for
    /// the 0.3 % beyond the support and the leak of the conjugate, exp(-(2 k0 sigma)^2 / 2).
    #[test]
    fn phase_of_a_plane_wave_advances_along_its_wavevector() {
        let bank = bank(6);
        for (filter, &[kx, ky]) in bank.wavevectors().iter().enumerate() {
            let wave = |y: usize, x: usize| kx * x as f64 + ky * y as f64;
            let picture = Array2::from_shape_fn((40, 44), |(y, x)| wave(y, x).cos());
            let responses = respond(&bank, &picture);
            let (re, im) = responses.row(filter, 20);
            let phase = wave(20, 21);
            assert!((re[21] - 0.5 * phase.cos()).abs() < 3e-3, "filter {filter}");
            assert!((im[21] - 0.5 * phase.sin()).abs() < 3e-3, "filter {filter}");
        }
    }

    #[test]
    fn a_flat_picture_answers_with_nothing() {
        for orientations in [2, 3, 4, 5, 6] {
            let bank = bank(orientations);
            let mut responses = respond(&bank, &Array2::from_elem((30, 31), 255.0));
            // 25 taps of order 0.1 on 255: rounding is below 1e-12.
            assert!(responses.packed_mut().iter().all(|r| r.abs() < 1e-11));
        }
    }

    #[test]
    fn shared_passes_equal_the_direct_sum() {
        let picture = Array2::from_shape_fn((9, 37), |(y, x)| ((x * y) as f64 * 0.37).sin());
        for orientations in [2, 3, 5, 6] {
            let parameters = GaborParameters {
                tuning_frequency: 0.2,
                bandwidth_octaves: 1.5,
                orientations,
                support: 2.5,
            };
            let bank = GaborBank::<f64>::new(&parameters).unwrap();
            let responses = respond(&bank, &picture);
            let r = bank.radius() as isize;
            let g = gaussian_taps(parameters.sigma(), bank.radius());
            for (filter, &[kx, ky]) in bank.wavevectors().iter().enumerate() {
                let factor = |k: f64, carries: bool, j: isize| {
                    let phase = |j: isize| k * j as f64;
                    let at = |j: isize| g[(j + r) as usize];
                    let mean: f64 = (-r..=r).map(|j| at(j) * phase(j).cos()).sum();
                    let even = phase(j).cos() - if carries { mean } else { 0.0 };
                    [at(j) * even, -at(j) * phase(j).sin()]
                };
                for (y, x) in [(0, 0), (4, 18), (8, 36), (2, 30)] {
                    let mut sum = [0.0; 2];
                    for (j, i) in (-r..=r).flat_map(|j| (-r..=r).map(move |i| (j, i))) {
                        let x_carries = kx.abs() >= ky.abs() * (1.0 - 1e-12);
                        let [a, b] = factor(kx, x_carries, i);
                        let [c, s] = factor(ky, !x_carries, j);
                        let sample = picture[(
                            Border::Replicate.index(y as isize + j, 9).unwrap(),
                            Border::Replicate.index(x as isize + i, 37).unwrap(),
                        )];
                        sum[0] += sample * (a * c - b * s);
                        sum[1] += sample * (a * s + b * c);
                    }
                    let (re, im) = responses.row(filter, y);
                    assert!((re[x] - sum[0]).abs() < 1e-13 && (im[x] - sum[1]).abs() < 1e-13);
                }
            }
        }
    }
}
