//! Brightness of the frames brought to a common scale, so that gain and offset cannot matter.
//!
//! ```text
//! J = 64 (I - m)/s,   m = mean I,   s^2 = mean (I - m)^2        over the known samples of all frames
//! ```
//!
//! computed in `f64` before anything is rounded, the sums row by row about a sample `p` of the picture,
//! `s^2 = mean (I - p)^2 - (m - p)^2`. The standard deviation of photographs in 8 bit is 30
//! to 75 grey levels, so `J` reads as grey levels of an ordinary exposure; the floors of the
//! method (amplitudes, edges, the guide's tolerance), which are grey levels, thereby follow the
//! contrast of the sequence: integers of any depth and floats of any scale give the same flow. The
//! price: in a sequence of hardly any contrast, noise counts as contrast.
//!
//! Unknown samples (NaN, infinite) take no part. A sequence whose contrast is no more than the
//! rounding of its own brightness is blank: all 0.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use multiversion::multiversion;
use ndarray::{Array2, ArrayView3, ArrayView4, Axis};
use rayon::prelude::*;

use super::recorded::{Reading, Sample, read_row};
use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::Result;
use crate::tasks::filled_picture;

/// Standard deviation after standardising, grey levels.
const TYPICAL: f64 = 64.0;
/// Contrast below this share of the largest |brightness| is rounding of single precision input.
const LEAST_CONTRAST: f64 = 1e-6;
/// Sums side by side within a row: those of a vector register, several times over.
const LANES: usize = 16;

/// The line `a (I - m)` that standardises a sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contrast {
    mean: f64,
    gain: f64,
}

/// Sums over known samples about the pivot.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    sum: f64,
    squares: f64,
    /// Of |I| itself.
    largest: f64,
}

impl Contrast {
    /// Measured over the brightness of all frames (T, H, W, C).
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn measure<T: Sample>(frames: ArrayView4<'_, T>, control: &Control) -> Result<Self> {
        let (count, height, width, _) = frames.dim();
        let mut first = [0.0];
        let corner = frames.slice(ndarray::s![0, 0, ..1, ..]);
        read_row(corner, Reading::Grey, &mut first);
        let pivot = if first[0].is_finite() { first[0] } else { 0.0 };
        let rows: Vec<Moments> = (0..count * height)
            .into_par_iter()
            .with_min_len(LANES)
            .map_init(
                || vec![0.0; width],
                |values, row| {
                    control.check()?;
                    let frame = frames.index_axis(Axis(0), row / height);
                    read_row(frame.index_axis_move(Axis(0), row % height), Reading::Grey, values);
                    Ok(Moments::of(values, pivot))
                },
            )
            .collect::<Result<_>>()?;
        // Row after row, whoever summed them.
        let all = rows.into_iter().fold(Moments::default(), Moments::and);
        let count = all.count.max(1.0);
        let offset = all.sum / count;
        let spread = (all.squares / count - offset * offset).max(0.0).sqrt();
        let blank = !(spread > LEAST_CONTRAST * all.largest);
        let mean = if all.count == 0.0 { 0.0 } else { pivot + offset };
        Ok(Self { mean, gain: if blank { 0.0 } else { TYPICAL / spread } })
    }

    /// Whether there is no contrast at all.
    pub(super) fn is_blank(&self) -> bool {
        self.gain == 0.0
    }

    /// A frame (H, W, C) standardised, unknown samples NaN; and whether there are such.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn apply<T: Sample>(
        &self,
        frame: ArrayView3<'_, T>,
        reading: Reading,
        control: &Control,
    ) -> Result<(Array2<f32>, bool)> {
        let (height, width, _) = frame.dim();
        let mut out = filled_picture(0.0, (height, width));
        let unknown = AtomicBool::new(false);
        let samples = out.as_slice_mut().unwrap_or_default();
        for_each_row_with(
            samples,
            width,
            control,
            || vec![0.0; width],
            |y, out, values| {
                read_row(frame.index_axis(Axis(0), y), reading, values);
                if !standardise(values, self.mean, self.gain, out) {
                    unknown.store(true, Relaxed);
                }
            },
        )?;
        Ok((out, unknown.into_inner()))
    }
}

impl Moments {
    fn of(values: &[f64], pivot: f64) -> Self {
        let mut lanes = [[0.0; LANES]; 4];
        let [count, sum, squares, largest] = &mut lanes;
        let (blocks, rest) = values.as_chunks::<LANES>();
        add(blocks, pivot, count, sum, squares, largest);
        let mut last = [f64::NAN; LANES];
        last[..rest.len()].copy_from_slice(rest);
        add(&[last], pivot, count, sum, squares, largest);
        let [count, sum, squares] = [count, sum, squares].map(|lanes| lanes.iter().sum());
        Self { count, sum, squares, largest: largest.iter().copied().fold(0.0, f64::max) }
    }

    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
            largest: self.largest.max(other.largest),
        }
    }
}

/// Adds known values, their distances from `pivot` and the squares of these, lane by lane.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(
    blocks: &[[f64; LANES]],
    pivot: f64,
    count: &mut [f64; LANES],
    sum: &mut [f64; LANES],
    squares: &mut [f64; LANES],
    largest: &mut [f64; LANES],
) {
    for block in blocks {
        for lane in 0..LANES {
            let value = block[lane];
            let known = value.abs() < f64::INFINITY;
            let offset = if known { value - pivot } else { 0.0 };
            let size = if known { value.abs() } else { 0.0 };
            count[lane] += if known { 1.0 } else { 0.0 };
            sum[lane] += offset;
            squares[lane] += offset * offset;
            largest[lane] = if size > largest[lane] { size } else { largest[lane] };
        }
    }
}

/// `gain (s - mean)`, NaN where unknown; whether all are known.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn standardise(values: &[f64], mean: f64, gain: f64, out: &mut [f32]) -> bool {
    let n = out.len();
    let mut unknown = 0;
    for x in 0..n {
        let known = values[..n][x].abs() < f64::INFINITY;
        out[x] = if known { ((values[x] - mean) * gain) as f32 } else { f32::NAN };
        unknown += u32::from(!known);
    }
    unknown == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array4, Zip};

    fn measured(frames: &Array4<f64>) -> Contrast {
        Contrast::measure(frames.view(), &Control::new()).unwrap()
    }

    #[test]
    fn gain_and_offset_cancel() {
        let frames = Array4::from_shape_fn((2, 5, 6, 1), |(t, y, x, _)| (t + 3 * y * x) as f64);
        let other = frames.mapv(|s| 1e-3 * s + 4.0);
        let standard = |f: &Array4<f64>| {
            let frame = f.index_axis(Axis(0), 1);
            measured(f).apply(frame, Reading::Grey, &Control::new()).unwrap()
        };
        let ((one, _), (two, _)) = (standard(&frames), standard(&other));
        assert!(one.iter().zip(&two).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    /// The sums about a pivot are the definition, far from 0 too.
    #[test]
    fn mean_and_deviation_are_those_of_the_definition() {
        let frames =
            Array4::from_shape_fn((2, 7, 21, 1), |(t, y, x, _)| 1e6 + ((t + y * y + x) % 9) as f64);
        let mean = frames.mean().unwrap();
        let spread = frames.mapv(|s| (s - mean).powi(2)).mean().unwrap().sqrt();
        let found = measured(&frames);
        // Sums of 294 numbers below 100 in double precision.
        assert!((found.mean - mean).abs() < 1e-9);
        assert!((found.gain * spread / TYPICAL - 1.0).abs() < 1e-12);
    }

    #[test]
    fn unknown_samples_do_not_count_and_blank_is_told() {
        let frames = Array4::from_shape_fn((1, 4, 4, 1), |(_, y, x, _)| (y * x) as f64);
        let mut wider = Array4::from_elem((1, 4, 5, 1), f64::NAN);
        Zip::from(wider.slice_mut(ndarray::s![.., .., ..4, ..]))
            .and(&frames)
            .for_each(|w, f| *w = *f);
        let contrast = measured(&frames);
        assert_eq!(measured(&wider), contrast);
        assert!((contrast.mean - frames.mean().unwrap()).abs() < 1e-15);
        let apply = |f: &Array4<f64>| {
            contrast.apply(f.index_axis(Axis(0), 0), Reading::Grey, &Control::new()).unwrap()
        };
        assert!(apply(&wider).1 && apply(&wider).0[(2, 4)].is_nan() && !apply(&frames).1);
        assert!(measured(&Array4::from_elem((1, 3, 3, 1), 0.1)).is_blank());
        assert!(measured(&Array4::from_elem((1, 3, 3, 1), f64::NAN)).is_blank());
    }
}
