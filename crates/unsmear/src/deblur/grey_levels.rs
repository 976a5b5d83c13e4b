//! One scale for pictures of every type: grey levels of a picture of ordinary contrast.
//!
//! ```text
//! grey = (value - mean) * CONTRAST / s,      s^2 = mean over channels of the variance of the known samples
//! ```
//!
//! A strength of the prior, a rounding of its edges and a floor of the noise mean something only against the contrast
//! of the picture. Measured in its own contrast they make the restoration of a I + b that of I, times a plus b, whatever
//! the type of the samples. [`CONTRAST`] is that of photographs with 8 bits. A constant picture keeps its scale.

use ndarray::{Array2, ArrayView2};

use crate::real::Real;

/// Standard deviation that every picture is brought to, grey levels.
const CONTRAST: f64 = 50.0;

/// The map between the samples of a picture and grey levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GreyLevels {
    mean: f64,
    /// Grey levels per unit of the picture.
    scale: f64,
}

impl GreyLevels {
    /// The scale of the picture with these channels.
    pub(super) fn of<T: Real>(channels: &[ArrayView2<'_, T>]) -> Self {
        let (mut means, mut variance) = (0.0, 0.0);
        for channel in channels {
            let known = || channel.iter().map(|s| s.as_f64()).filter(|s| s.is_finite());
            let count = known().count().max(1) as f64;
            let mean = known().sum::<f64>() / count;
            means += mean;
            variance += known().map(|s| (s - mean).powi(2)).sum::<f64>() / count;
        }
        let count = channels.len() as f64;
        let deviation = (variance / count).sqrt();
        let scale = if deviation > 0.0 { CONTRAST / deviation } else { 1.0 };
        Self { mean: means / count, scale }
    }

    /// Grey levels per unit of the picture.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// A value of the picture in grey levels.
    pub(super) fn grey(&self, value: f64) -> f64 {
        (value - self.mean) * self.scale
    }

    /// Grey levels as a value of the picture.
    pub(super) fn value(&self, grey: f64) -> f64 {
        grey / self.scale + self.mean
    }

    /// A channel in grey levels; NaN stays.
    pub(super) fn plane<T: Real>(&self, channel: &ArrayView2<'_, T>) -> Array2<f32> {
        channel.map(|s| self.grey(s.as_f64()) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contrast_and_brightness_are_taken_out() {
        let image = Array2::from_shape_fn((9, 8), |(y, x)| ((y * 8 + x * 5) % 13) as f64);
        let other = 3.0e-3 * &image - 70.0;
        let (a, b) = (GreyLevels::of(&[image.view()]), GreyLevels::of(&[other.view()]));
        let (a, b) = (a.plane(&image.view()), b.plane(&other.view()));
        // Rounding of a mean 2e4 times the contrast.
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-3));
        let mean = a.mean().unwrap();
        let square = a.mapv(|s| (s - mean).powi(2)).mean().unwrap();
        assert!((f64::from(square).sqrt() - CONTRAST).abs() < 1e-3);
    }

    #[test]
    fn unknown_samples_and_constants_do_no_harm() {
        let mut image = Array2::from_elem((4, 4), 7.0f32);
        image[(1, 1)] = f32::NAN;
        let levels = GreyLevels::of(&[image.view()]);
        assert_eq!((levels.scale(), levels.grey(9.0), levels.value(2.0)), (1.0, 2.0, 9.0));
        assert!(levels.plane(&image.view())[(1, 1)].is_nan());
    }
}
