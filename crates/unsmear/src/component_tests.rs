//! When to believe a component velocity.
//!
//! ```text
//! amplitude   |R| >= max(fraction * largest |R| of the bank, floor)
//! frequency   |(phi_x, phi_y, phi_t) - (k_x, k_y, omega)| <= tau sigma_k,   sigma_k = 1/sigma
//! ```
//!
//! The frequency test removes the neighbourhoods of phase singularities, where phase turns fast
//! while the amplitude is not yet zero. The floor keeps rounding from passing as signal in a blank
//! picture.
//!
//! Sources: Fleet & Jepson 1990 (doi 10.1007/BF00056772); Fleet & Jepson 1993 (doi
//! 10.1109/34.250844) on singularities.

use multiversion::multiversion;

use crate::error::{Result, require};
use crate::gabor::Responses;
use crate::real::Real;

/// Share of the largest |brightness| that counts as signal: far above single precision rounding
/// (6e-8 per operation), far below one grey level of 8 bits (4e-3).
const ROUNDING_FLOOR: f64 = 1e-5;

/// The two tests; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentTests {
    /// Least amplitude, as a share of the largest of the bank. Default 0.05.
    pub amplitude_fraction: f64,
    /// `tau`: largest distance from the tuned frequency in deviations of the spectrum. Default 1.25.
    pub tau: f64,
}

impl Default for ComponentTests {
    fn default() -> Self {
        Self { amplitude_fraction: 0.05, tau: 1.25 }
    }
}

impl ComponentTests {
    pub(crate) fn check(&self) -> Result<()> {
        require("amplitude_fraction", self.amplitude_fraction, "in [0, 1]", |f| {
            (0.0..=1.0).contains(&f)
        })?;
        require("tau", self.tau, "> 0 deviations", |t| t > 0.0)
    }

    /// Least amplitude that passes, given the largest one and the largest |brightness|.
    #[must_use]
    pub fn threshold(&self, largest: f64, brightness: f64) -> f64 {
        (self.amplitude_fraction * largest).max(ROUNDING_FLOOR * brightness)
    }
}

/// Largest amplitude of all responses.
#[must_use]
pub fn largest_amplitude<T: Real>(responses: &Responses<T>) -> f64 {
    let (filters, height, _) = responses.dim();
    (0..height)
        .flat_map(|y| (0..filters).map(move |filter| responses.row(filter, y)))
        .fold(T::zero(), |largest, (re, im)| largest_power(re, im, largest))
        .as_f64()
        .sqrt()
}

/// The larger of `least` and the largest `re^2 + im^2`; NaN does not count.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn largest_power<T: Real>(re: &[T], im: &[T], least: T) -> T {
    // The maximum is the same in any order, so each lane may keep its own.
    const LANES: usize = 32;
    let mut lanes = [least; LANES];
    let n = re.len() - re.len() % LANES;
    for (re, im) in re[..n].chunks_exact(LANES).zip(im[..n].chunks_exact(LANES)) {
        for i in 0..LANES {
            let power = re[i] * re[i] + im[i] * im[i];
            lanes[i] = if power > lanes[i] { power } else { lanes[i] };
        }
    }
    for (&re, &im) in re[n..].iter().zip(&im[n..]) {
        let power = re * re + im * im;
        lanes[0] = if power > lanes[0] { power } else { lanes[0] };
    }
    lanes.into_iter().fold(least, |largest, lane| if lane > largest { lane } else { largest })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threshold_is_the_larger_of_share_and_floor() {
        let tests = ComponentTests::default();
        assert!((tests.threshold(2.0, 1.0) - 0.1).abs() < 1e-15);
        assert!((tests.threshold(0.0, 255.0) - 255.0 * ROUNDING_FLOOR).abs() < 1e-15);
        assert!(ComponentTests { tau: 0.0, ..tests }.check().is_err());
    }

    #[test]
    fn largest_amplitude_is_a_modulus() {
        let mut responses = Responses::<f32>::zeros(2, 2, 3);
        let (re, im) = responses.row_mut(1, 1);
        (re[2], im[2]) = (3.0, -4.0);
        assert!((largest_amplitude(&responses) - 5.0).abs() < 1e-6);
    }
}
