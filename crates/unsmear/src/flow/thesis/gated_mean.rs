//! Mean of several estimates after dropping outliers.
//!
//! Over `N` values (NaN counting as 0 in `mean` and in the deviation `std`, which has `N - 1`):
//!
//! ```text
//! drop a value where std > std_limit and |value - mean| / std > distance_limit
//! mean of the rest; NaN where fewer than least_fraction N values remain
//! ```
//!
//! The founding method applies it to each velocity component over the filters, then over frames.
//! Averaging *normal* velocities over all directions halves the speed: the mean of `n n'` over the
//! circle is `I / 2`. [`crate::flow::least_squares`] mends that.
//!
//! Source: C. Texin 2007, section 4.3; the published text has 1.5 px/frame for `std_limit`, the
//! listing 5.

use crate::error::{Result, require};

/// Limits of the gate; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GatedMean {
    /// Deviation above which the gate looks for outliers, px/frame. Default 5.
    pub std_limit: f64,
    /// Distance from the mean, in deviations, beyond which a value is one. Default 2.
    pub distance_limit: f64,
    /// Share of the values that must remain. Default 10/12.
    pub least_fraction: f64,
}

impl Default for GatedMean {
    fn default() -> Self {
        Self { std_limit: 5.0, distance_limit: 2.0, least_fraction: 10.0 / 12.0 }
    }
}

impl GatedMean {
    /// Checks the limits.
    ///
    /// # Errors
    /// [`Error::Value`](crate::Error::Value) naming the limit.
    pub fn check(&self) -> Result<()> {
        require("std_limit", self.std_limit, ">= 0 px/frame", |l| l >= 0.0)?;
        require("distance_limit", self.distance_limit, ">= 0", |l| l >= 0.0)?;
        require("least_fraction", self.least_fraction, "in [0, 1]", |f| (0.0..=1.0).contains(&f))
    }

    /// Replaces outliers by NaN.
    pub fn gate(&self, values: &mut [f64]) {
        let known = |value: f64| if value.is_nan() { 0.0 } else { value };
        let n = values.len() as f64;
        let mean = values.iter().map(|&v| known(v)).sum::<f64>() / n;
        let sum: f64 = values.iter().map(|&v| (known(v) - mean).powi(2)).sum();
        let std = (sum / (n - 1.0).max(1.0)).sqrt();
        if std > self.std_limit {
            for value in values {
                if (*value - mean).abs() / std > self.distance_limit {
                    *value = f64::NAN;
                }
            }
        }
    }

    /// Mean of what is left; NaN where that is too little.
    #[must_use]
    pub fn mean_of_rest(&self, gated: &[f64]) -> f64 {
        let rest = gated.iter().filter(|v| !v.is_nan());
        let (sum, count) = rest.fold((0.0, 0usize), |(sum, count), v| (sum + v, count + 1));
        if (count as f64) < gated.len() as f64 * self.least_fraction {
            return f64::NAN;
        }
        sum / count as f64
    }

    /// The gated mean; `values` hold NaN for what was dropped afterwards.
    pub fn of(&self, values: &mut [f64]) -> f64 {
        self.gate(values);
        self.mean_of_rest(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreeing_values_are_averaged() {
        assert_eq!(GatedMean::default().of(&mut [1.0, 2.0, 3.0]), 2.0);
        assert_eq!(GatedMean::default().of(&mut [4.0]), 4.0);
    }

    #[test]
    fn a_far_value_is_dropped_only_where_values_scatter() {
        let mut values = [0.0; 12];
        values[3] = 40.0;
        // std = 11.5 > 5 and the distance is 3.2 deviations: dropped.
        assert_eq!(GatedMean::default().of(&mut values.clone()), 0.0);
        let calm = GatedMean { std_limit: 12.0, ..Default::default() };
        assert_eq!(calm.of(&mut values), 40.0 / 12.0);
    }

    #[test]
    fn too_few_values_are_unknown() {
        let mut values =
            [f64::NAN, f64::NAN, f64::NAN, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        assert!(GatedMean::default().of(&mut values.clone()).is_nan());
        let lenient = GatedMean { least_fraction: 0.5, ..Default::default() };
        assert_eq!(lenient.of(&mut values), 1.0);
        assert!(GatedMean { least_fraction: 1.5, ..Default::default() }.check().is_err());
    }
}
