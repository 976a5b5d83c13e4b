//! Separable correlation of a volume (T, H, W) along its axes.
//!
//! With odd-length taps `w[0..2r+1]` centred on `w[r]`,
//!
//! ```text
//! out[i] = sum_j w[j] in[i + j - r],   j = 0..2r
//! ```
//!
//! along one axis, positions outside the volume following a [`Border`] rule. This is correlation:
//! for convolution, pass the taps reversed. A separable three-dimensional filter is three such
//! passes, t first: it alone can shrink the work to the frames that are needed.
//!
//! Sums run in the order of the taps in plain multiplications and additions, never fused, so the
//! result has the same bits on every processor and for any number of threads.

use multiversion::multiversion;
use ndarray::{Array3, ArrayView3, Axis};

use crate::array::for_each_row_with;
use crate::border::Border;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::real::Real;

/// Samples handled together: four registers of 16 `f32`, enough to hide the latency of additions.
const LANES: usize = 64;

/// Correlates `volume` (T, H, W) with `taps` along `axis` (0 = t, 1 = y, 2 = x).
///
/// # Errors
/// [`Error::Value`] for an empty or even number of taps or an axis above 2, [`Error::Cancelled`].
pub fn correlate_axis<T: Real>(
    volume: ArrayView3<'_, T>,
    taps: &[T],
    axis: usize,
    border: Border,
    control: &Control,
) -> Result<Array3<T>> {
    if taps.len().is_multiple_of(2) {
        return Err(Error::value("taps", "an odd number of values", taps.len()));
    }
    if axis > 2 {
        return Err(Error::value("axis", "0 (t), 1 (y) or 2 (x)", axis));
    }
    let volume = volume.as_standard_layout();
    let (frames, height, width) = volume.dim();
    let mut out = Array3::zeros(volume.raw_dim());
    if volume.is_empty() {
        return Ok(out);
    }
    let source = Lines { volume: volume.view(), border, radius: taps.len() / 2, axis };
    let row_of = |row: usize| [row / height, row % height];
    debug_assert_eq!(out.len(), frames * height * width);
    let packed = out.as_slice_mut().unwrap_or_default();
    for_each_row_with(
        packed,
        width,
        control,
        || source.scratch(),
        |row, out_row, scratch| weighted_sum(&source.gather(row_of(row), scratch), taps, out_row),
    )?;
    Ok(out)
}

/// Correlates with `taps[0]` along t, `taps[1]` along y and `taps[2]` along x.
///
/// # Errors
/// As [`correlate_axis`].
pub fn correlate_separable<T: Real>(
    volume: ArrayView3<'_, T>,
    taps: [&[T]; 3],
    border: Border,
    control: &Control,
) -> Result<Array3<T>> {
    let along_t = correlate_axis(volume, taps[0], 0, border, control)?;
    let along_y = correlate_axis(along_t.view(), taps[1], 1, border, control)?;
    correlate_axis(along_y.view(), taps[2], 2, border, control)
}

/// Unit-sum samples of a Gaussian of deviation `sigma` (samples) at `-radius..=radius`.
#[must_use]
pub fn gaussian_taps(sigma: f64, radius: usize) -> Vec<f64> {
    let r = radius as f64;
    let samples: Vec<f64> =
        (0..=2 * radius).map(|i| (-0.5 * ((i as f64 - r) / sigma).powi(2)).exp()).collect();
    let sum: f64 = samples.iter().sum();
    samples.into_iter().map(|s| s / sum).collect()
}

/// The shifted rows that a filter along one axis combines into one row of output.
struct Lines<'a, T> {
    volume: ArrayView3<'a, T>,
    border: Border,
    radius: usize,
    axis: usize,
}

impl<T: Real> Lines<'_, T> {
    /// A row with room for both borders (x axis), or a row of zeros (t and y axes).
    fn scratch(&self) -> Vec<T> {
        let width = self.volume.len_of(Axis(2));
        vec![T::zero(); width + if self.axis == 2 { 2 * self.radius } else { 0 }]
    }

    fn row(&self, t: usize, y: usize) -> &[T] {
        let (_, height, width) = self.volume.dim();
        let start = (t * height + y) * width;
        // In standard layout by construction, so the slice exists.
        &self.volume.to_slice().unwrap_or_default()[start..start + width]
    }

    fn gather<'s>(&'s self, [t, y]: [usize; 2], scratch: &'s mut [T]) -> Vec<&'s [T]> {
        let (frames, height, width) = self.volume.dim();
        let count = 2 * self.radius + 1;
        if self.axis == 2 {
            pad_row(self.row(t, y), self.radius, self.border, scratch);
            return (0..count).map(|j| &scratch[j..j + width]).collect();
        }
        let zeros: &'s [T] = scratch;
        let (centre, extent) = if self.axis == 0 { (t, frames) } else { (y, height) };
        (0..count)
            .map(|j| {
                let position = (centre + j) as isize - self.radius as isize;
                match self.border.index(position, extent) {
                    Some(i) if self.axis == 0 => self.row(i, y),
                    Some(i) => self.row(t, i),
                    None => zeros,
                }
            })
            .collect()
    }
}

/// Copies `row` into the middle of `padded` (length `row.len() + 2 radius`) and continues it.
pub(crate) fn pad_row<T: Real>(row: &[T], radius: usize, border: Border, padded: &mut [T]) {
    let n = row.len();
    padded[radius..radius + n].copy_from_slice(row);
    for j in 0..radius {
        let before = border.index(j as isize - radius as isize, n);
        padded[j] = before.map_or_else(T::zero, |i| row[i]);
        let after = border.index((n + j) as isize, n);
        padded[radius + n + j] = after.map_or_else(T::zero, |i| row[i]);
    }
}

/// `out[x] = sum_j weights[j] rows[j][x]`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn weighted_sum<T: Real>(rows: &[&[T]], weights: &[T], out: &mut [T]) {
    for start in (0..out.len()).step_by(LANES) {
        let end = (start + LANES).min(out.len());
        let out = &mut out[start..end];
        if out.len() == LANES {
            let mut sum = [T::zero(); LANES];
            for (row, &weight) in rows.iter().zip(weights) {
                let row = &row[start..end];
                for i in 0..LANES {
                    sum[i] += weight * row[i];
                }
            }
            out.copy_from_slice(&sum);
        } else {
            out.fill(T::zero());
            for (row, &weight) in rows.iter().zip(weights) {
                for (sum, &sample) in out.iter_mut().zip(&row[start..end]) {
                    *sum += weight * sample;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, one sample at a time.
    fn direct(v: &Array3<f64>, taps: &[f64], axis: usize, border: Border) -> Array3<f64> {
        let radius = (taps.len() / 2) as isize;
        Array3::from_shape_fn(v.raw_dim(), |(t, y, x)| {
            let mut sum = 0.0;
            for (j, &w) in taps.iter().enumerate() {
                let mut at = [t, y, x];
                let position = at[axis] as isize + j as isize - radius;
                if let Some(i) = border.index(position, v.shape()[axis]) {
                    at[axis] = i;
                    sum += w * v[at];
                }
            }
            sum
        })
    }

    fn wavy(shape: [usize; 3]) -> Array3<f64> {
        Array3::from_shape_fn(shape, |(t, y, x)| {
            ((t * 131 + y * 17 + x * 7) as f64 * 0.61).sin() + 0.1 * x as f64
        })
    }

    proptest! {
        // Same sums in the same order up to the chunk loop: equal to the last bit.
        #[test]
        fn equals_the_definition(
            t in 1usize..4, y in 1usize..9, x in 1usize..80, radius in 0usize..6, axis in 0usize..3,
        ) {
            let v = wavy([t, y, x]);
            let taps: Vec<f64> = (0..=2 * radius).map(|j| (j as f64 * 1.7).cos()).collect();
            for border in [Border::Replicate, Border::Reflect, Border::Zero] {
                let got = correlate_axis(v.view(), &taps, axis, border, &Control::new()).unwrap();
                let want = direct(&v, &taps, axis, border);
                let worst = (&got - &want).mapv(f64::abs).fold(0.0, |a: f64, &b| a.max(b));
                prop_assert_eq!(worst, 0.0);
            }
        }
    }

    #[test]
    fn constants_stay_constant_under_unit_sum_taps() {
        let v = Array3::from_elem((3, 4, 70), 2.5);
        let taps = gaussian_taps(1.3, 4);
        let taps = [&taps[..], &taps[..], &taps[..]];
        for border in [Border::Replicate, Border::Reflect] {
            let out = correlate_separable(v.view(), taps, border, &Control::new()).unwrap();
            assert!(out.iter().all(|&s| (s - 2.5).abs() < 1e-14));
        }
    }

    #[test]
    fn refuses_even_taps_and_unknown_axes() {
        let v = Array3::<f32>::zeros((1, 1, 1));
        let run = |taps: &[f32], axis| {
            correlate_axis(v.view(), taps, axis, Border::Zero, &Control::new())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(run(&[1.0, 1.0], 0), "taps must be an odd number of values, got 2");
        assert_eq!(run(&[1.0], 3), "axis must be 0 (t), 1 (y) or 2 (x), got 3");
    }
}
