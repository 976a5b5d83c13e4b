//! What a bank of Gabor filters is tuned to.
//!
//! ```text
//! k0    = 2 pi f0                                                        rad/px
//! sigma = (2^beta + 1) / ((2^beta - 1) k0)                               px
//! ```
//!
//! for a tuning frequency `f0` cycles/px and a bandwidth of `beta` octaves, measured at one
//! deviation `1 / sigma` of the filter's Gaussian spectrum.

use std::f64::consts::TAU;

use crate::error::{Result, require};

/// What a bank is tuned to; see the [module](super).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaborParameters {
    /// `f0`, cycles/px, in (0, 0.5). Default 0.15: a wavelength of 6.7 px.
    pub tuning_frequency: f64,
    /// `beta`, octaves, in (0, 3]. Default 0.8, Fleet & Jepson's.
    pub bandwidth_octaves: f64,
    /// `N`, filters over 180 degrees, at least 2. Default 6: neighbours cross at half power.
    pub orientations: usize,
    /// Where the taps end, in deviations. Default 3: what is cut off weighs 0.3 %.
    pub support: f64,
}

impl Default for GaborParameters {
    fn default() -> Self {
        Self { tuning_frequency: 0.15, bandwidth_octaves: 0.8, orientations: 6, support: 3.0 }
    }
}

impl GaborParameters {
    /// `k0`, rad/px: the one place where cycles become radians.
    #[must_use]
    pub fn wavenumber(&self) -> f64 {
        TAU * self.tuning_frequency
    }

    /// Deviation of the Gaussian window, px.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        let ratio = self.bandwidth_octaves.exp2();
        (ratio + 1.0) / ((ratio - 1.0) * self.wavenumber())
    }

    pub(crate) fn check(&self) -> Result<()> {
        require("tuning_frequency", self.tuning_frequency, "in (0, 0.5) cycles/px", |f| {
            f > 0.0 && f < 0.5
        })?;
        let octaves = self.bandwidth_octaves;
        require("bandwidth_octaves", octaves, "in (0, 3]", |b| b > 0.0 && b <= 3.0)?;
        require("orientations", self.orientations as f64, "in 2..=64", |n| {
            (2.0..=64.0).contains(&n)
        })?;
        require("support", self.support, "in [1, 6] deviations", |s| (1.0..=6.0).contains(&s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gabor::GaborBank;

    #[test]
    fn parameters_outside_their_range_are_named() {
        let bad = GaborParameters { tuning_frequency: 0.5, ..Default::default() };
        let error = GaborBank::<f32>::new(&bad).unwrap_err().to_string();
        assert_eq!(error, "tuning_frequency must be in (0, 0.5) cycles/px, got 0.5");
        assert!(GaborBank::<f32>::new(&GaborParameters { orientations: 1, ..bad }).is_err());
    }
}
