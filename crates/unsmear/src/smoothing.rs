//! A Gaussian over a picture, along both axes in one go.
//!
//! ```text
//! out(y, x) = sum_jk g_j g_k in(y + j, x + k),    g_j = exp(-j^2/(2 s^2)) / sum,   |j| <= ceil(4 s)
//! ```
//!
//! reflected at the edge. Rows are done in bands, each along x and then along y, so that what lies between stays in
//! cache. Units: those of the samples; `s` in px. A NaN spreads over the reach of the filter. The form for filters of
//! any shape and for volumes is [`crate::convolve`].

use std::ops::RangeInclusive;

use ndarray::{Array2, ArrayView2};

use crate::border::Border;
use crate::control::Control;
use crate::convolve::{gaussian_taps, pad_row, weighted_sum};
use crate::error::Result;
use crate::real::Real;
use crate::tasks::{cut, filled_picture, for_each_task, runs};

/// Where the taps of [`smooth`] end, in deviations: what is cut off weighs less than 1e-4.
const SUPPORT: f64 = 4.0;
/// Rows that [`smooth`] does along both axes at once, so that what lies between stays in cache: with the widest filter
/// in use a quarter of the rows is done twice.
const BAND: RangeInclusive<usize> = 24..=64;

/// Taps of [`smooth`] to each side of the middle.
pub(crate) fn support(sigma: f64) -> usize {
    (SUPPORT * sigma).ceil() as usize
}

/// `picture` convolved with a Gaussian of deviation `sigma` px, reflected at the edge.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn smooth<T: Real>(
    picture: ArrayView2<'_, T>,
    sigma: f64,
    control: &Control,
) -> Result<Array2<T>> {
    let radius = support(sigma);
    let taps: Vec<T> = gaussian_taps(sigma, radius).into_iter().map(T::of).collect();
    let (height, width) = picture.dim();
    let mut out = filled_picture(T::zero(), (height, width));
    if picture.is_empty() {
        return Ok(out);
    }
    let picture = picture.as_standard_layout();
    let source = picture.as_slice().unwrap_or_default();
    let target = out.as_slice_mut().unwrap_or_default();
    let runs = runs(height, BAND);
    for_each_task(cut(target, width, &runs), runs.len(), |(first, rows)| {
        let end = first + rows.len() / width;
        let (top, bottom) = (first.saturating_sub(radius), (end + radius).min(height));
        let mut across = vec![T::zero(); (bottom - top) * width];
        let mut padded = vec![T::zero(); width + 2 * radius];
        for (y, line) in (top..bottom).zip(across.chunks_exact_mut(width)) {
            control.check()?;
            pad_row(&source[y * width..(y + 1) * width], radius, Border::Reflect, &mut padded);
            let shifted: Vec<&[T]> = padded.windows(width).collect();
            weighted_sum(&shifted, &taps, line);
        }
        for (y, out) in (first..end).zip(rows.chunks_exact_mut(width)) {
            let lines: Vec<&[T]> = (0..taps.len())
                .map(|j| {
                    // Reflection stays within the radius of the band, or the band is all there is.
                    let at = Border::Reflect.index((y + j) as isize - radius as isize, height);
                    &across[(at.unwrap_or_default() - top) * width..][..width]
                })
                .collect();
            weighted_sum(&lines, &taps, out);
        }
        Ok(())
    })?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolve::correlate_separable;
    use ndarray::Axis;

    /// Bands of rows do not show: along x, then along y.
    #[test]
    fn smoothing_is_separable_correlation() {
        let control = Control::new();
        for (size, sigma) in [((150, 9), 1.3), ((64, 3), 0.9), ((5, 30), 2.0), ((1, 1), 2.0)] {
            let picture =
                Array2::from_shape_fn(size, |(y, x)| ((y * y + 3 * x * y + x) % 19) as f64);
            let smoothed = smooth(picture.view(), sigma, &control).unwrap();
            let radius = (SUPPORT * sigma).ceil() as usize;
            let taps = gaussian_taps(sigma, radius);
            let expected = correlate_separable(
                picture.view().insert_axis(Axis(0)),
                [&[1.0], &taps, &taps],
                Border::Reflect,
                &control,
            )
            .unwrap();
            // Sums of values up to 18 in another order of the axes.
            let error = &smoothed - &expected.index_axis_move(Axis(0), 0);
            assert!(error.iter().all(|e| e.abs() < 1e-13), "{size:?}");
        }
    }
}
