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

use multiversion::multiversion;

use crate::error::{Result, require};

/// Pixels handled together: enough to hide the latency of a chain of additions.
const LANES: usize = 32;

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

    /// The gated means of a row of pixels: value `k` of pixel `x` is `values[k][x]`. The same sums
    /// in the same order as [`GatedMean::of`], many pixels at a time.
    ///
    /// # Panics
    /// When a row of values is shorter than `means`.
    pub fn of_rows(&self, values: &[&[f64]], means: &mut [f64]) {
        gated_means(*self, values, means);
    }

    /// The gated mean; `values` hold NaN for what was dropped afterwards.
    pub fn of(&self, values: &mut [f64]) -> f64 {
        self.gate(values);
        self.mean_of_rest(values)
    }
}

/// [`GatedMean::of_rows`].
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn gated_means(gate: GatedMean, values: &[&[f64]], means: &mut [f64]) {
    let count = values.len() as f64;
    let least = count * gate.least_fraction;
    for (step, means) in means.chunks_mut(LANES).enumerate() {
        let n = means.len();
        let row = |k: usize| &values[k][step * LANES..][..n];
        let (mut mean, mut spread) = ([0.0; LANES], [0.0; LANES]);
        for k in 0..values.len() {
            let row = row(k);
            for i in 0..n {
                mean[i] += if row[i].is_nan() { 0.0 } else { row[i] };
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= count);
        for k in 0..values.len() {
            let row = row(k);
            for i in 0..n {
                let off = if row[i].is_nan() { 0.0 } else { row[i] } - mean[i];
                spread[i] += off * off;
            }
        }
        spread.iter_mut().for_each(|sum| *sum = (*sum / (count - 1.0).max(1.0)).sqrt());
        let (mut sum, mut rest) = ([0.0; LANES], [0.0; LANES]);
        for k in 0..values.len() {
            let row = row(k);
            for i in 0..n {
                let far = (row[i] - mean[i]).abs() / spread[i] > gate.distance_limit;
                let dropped = row[i].is_nan() || (far && spread[i] > gate.std_limit);
                sum[i] += if dropped { 0.0 } else { row[i] };
                rest[i] += if dropped { 0.0 } else { 1.0 };
            }
        }
        for i in 0..n {
            means[i] = if rest[i] < least { f64::NAN } else { sum[i] / rest[i] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_gated_as_their_pixels() {
        // Every 13th value is missing, every 17th far out; 7 values, 75 pixels.
        let value = |k: usize, x: usize| match 5 * x + 3 * k {
            i if i % 13 == 0 => f64::NAN,
            i if i % 17 == 0 => 300.0,
            i => (i as f64).sin(),
        };
        let rows: Vec<Vec<f64>> = (0..7).map(|k| (0..75).map(|x| value(k, x)).collect()).collect();
        let slices: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let gate = GatedMean { distance_limit: 1.5, ..Default::default() };
        let mut means = vec![9.0; 75];
        gate.of_rows(&slices, &mut means);
        for (x, mean) in means.iter().enumerate() {
            let mut column: Vec<f64> = rows.iter().map(|row| row[x]).collect();
            assert_eq!(mean.to_bits(), gate.of(&mut column).to_bits(), "pixel {x}");
        }
        assert!(means.iter().any(|m| m.is_nan()) && means.iter().any(|m| m.abs() < 1.0));
    }

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
