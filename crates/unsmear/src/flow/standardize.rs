//! Brightness of a sequence brought to a common scale, so that contrast cannot matter.
//!
//! ```text
//! J = (I - mean I) / max |I - mean I|                      over all frames and pixels
//! ```
//!
//! in `f64`, before anything is rounded to the working type: a picture `a I + b` gives the same
//! `J`, and the mean does not eat the digits of the contrast. A sequence whose contrast is no more
//! than the rounding of its own brightness is blank and becomes 0.

use ndarray::{Array3, ArrayView3};

use crate::error::{Error, Result};
use crate::real::Real;

/// Contrast below this share of the largest |brightness| is rounding: a few thousand units of the
/// last place of `f64`. Not more, or a faint scene on a bright pedestal would be called blank.
const LEAST_CONTRAST: f64 = 1e-12;

/// The standardised sequence; see the [module](self).
///
/// # Errors
/// [`Error::Value`] when a sample is NaN or infinite.
pub fn standardize<T: Real>(frames: ArrayView3<'_, f64>) -> Result<Array3<T>> {
    if let Some((at, sample)) = frames.indexed_iter().find(|(_, sample)| !sample.is_finite()) {
        let (t, y, x) = at;
        let got = format!("{sample} at frame {t}, row {y}, column {x}");
        return Err(Error::value("frames", "finite everywhere", got));
    }
    let mean = frames.mean().unwrap_or(0.0);
    let largest = |offset: f64| frames.fold(0.0f64, |m, &i| m.max((i - offset).abs()));
    let contrast = largest(mean);
    if contrast <= LEAST_CONTRAST * largest(0.0) {
        return Ok(Array3::zeros(frames.raw_dim()));
    }
    Ok(frames.mapv(|i| T::of((i - mean) / contrast)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames() -> Array3<f64> {
        Array3::from_shape_fn((2, 3, 4), |(t, y, x)| (t + 2 * y * x) as f64)
    }

    #[test]
    fn gain_and_offset_do_not_matter() {
        let plain = standardize::<f64>(frames().view()).unwrap();
        let other = standardize::<f64>(frames().mapv(|i| 1e-9 * i + 4e-7).view()).unwrap();
        assert!(plain.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!((plain.fold(0.0f64, |m, j| m.max(j.abs())) - 1.0).abs() < 1e-15);
        // A contrast of 1e-8 of the brightness keeps 8 of its 16 digits.
        let faint = standardize::<f64>(frames().mapv(|i| 1e-6 * i + 1e3).view()).unwrap();
        assert!(plain.iter().zip(&faint).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn blank_is_zero_and_unknown_is_refused() {
        let blank = Array3::from_elem((2, 2, 2), 0.1f64);
        assert!(standardize::<f32>(blank.view()).unwrap().iter().all(|&j| j == 0.0));
        let mut bad = frames();
        bad[(1, 2, 3)] = f64::NAN;
        let error = standardize::<f32>(bad.view()).unwrap_err().to_string();
        assert_eq!(error, "frames must be finite everywhere, got NaN at frame 1, row 2, column 3");
    }
}
