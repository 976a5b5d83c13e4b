//! Brightness of the frames brought to a common scale, so that gain and offset cannot matter.
//!
//! ```text
//! J = 64 (I - m)/s,   m = mean I,   s^2 = mean (I - m)^2        over the known samples of all frames
//! ```
//!
//! computed in `f64` before anything is rounded. The standard deviation of photographs in 8 bit is 30
//! to 75 grey levels, so `J` reads as grey levels of an ordinary exposure; the floors of the
//! method (amplitudes, edges, the guide's tolerance), which are grey levels, thereby follow the
//! contrast of the sequence: integers of any depth and floats of any scale give the same flow. The
//! price: in a sequence of hardly any contrast, noise counts as contrast.
//!
//! Unknown samples (NaN, infinite) take no part. A sequence whose contrast is no more than the
//! rounding of its own brightness is blank: all 0.

use ndarray::{Array2, ArrayView2, ArrayView3, Axis};

/// Standard deviation after standardising, grey levels.
const TYPICAL: f64 = 64.0;
/// Contrast below this share of the largest |brightness| is rounding of single precision input.
const LEAST_CONTRAST: f64 = 1e-6;

/// The line `a (I - m)` that standardises a sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contrast {
    mean: f64,
    gain: f64,
}

impl Contrast {
    /// Measured over all samples (T, H, W).
    pub(super) fn measure(frames: ArrayView3<'_, f64>) -> Self {
        let known = || frames.iter().copied().filter(|s| s.is_finite());
        let (count, sum) = known().fold((0usize, 0.0), |(n, sum), s| (n + 1, sum + s));
        let mean = if count == 0 { 0.0 } else { sum / count as f64 };
        let (spread, largest) = known().fold((0.0, 0.0f64), |(spread, largest), s| {
            (spread + (s - mean).powi(2), largest.max(s.abs()))
        });
        let spread = (spread / count.max(1) as f64).sqrt();
        let blank = !(spread > LEAST_CONTRAST * largest);
        Self { mean, gain: if blank { 0.0 } else { TYPICAL / spread } }
    }

    /// Whether there is no contrast at all.
    pub(super) fn is_blank(&self) -> bool {
        self.gain == 0.0
    }

    /// A frame standardised; unknown samples stay unknown (NaN).
    pub(super) fn apply(&self, frame: ArrayView2<'_, f64>) -> Array2<f32> {
        frame.mapv(|s| if s.is_finite() { ((s - self.mean) * self.gain) as f32 } else { f32::NAN })
    }

    /// The channels (C, H, W) of a picture, in the scale of the sequence.
    pub(super) fn channels(&self, picture: ArrayView3<'_, f64>) -> Vec<Array2<f32>> {
        picture.axis_iter(Axis(0)).map(|channel| self.apply(channel)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn gain_and_offset_cancel() {
        let frames = Array3::from_shape_fn((2, 5, 6), |(t, y, x)| (t + 3 * y * x) as f64);
        let other = frames.mapv(|s| 1e-3 * s + 4.0);
        let standard =
            |f: &Array3<f64>| Contrast::measure(f.view()).apply(f.index_axis(Axis(0), 1));
        let (one, two) = (standard(&frames), standard(&other));
        assert!(one.iter().zip(&two).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    #[test]
    fn unknown_samples_do_not_count_and_blank_is_told() {
        let mut frames = Array3::from_shape_fn((1, 4, 4), |(_, y, x)| (y * x) as f64);
        let contrast = Contrast::measure(frames.view());
        let mean = frames.mean().unwrap();
        frames = Array3::from_shape_fn(
            (1, 4, 5),
            |(_, y, x)| {
                if x == 4 { f64::NAN } else { (y * x) as f64 }
            },
        );
        assert_eq!(Contrast::measure(frames.view()), contrast);
        assert!((contrast.mean - mean).abs() < 1e-15);
        assert!(Contrast::measure(Array3::from_elem((1, 3, 3), 0.1).view()).is_blank());
    }
}
