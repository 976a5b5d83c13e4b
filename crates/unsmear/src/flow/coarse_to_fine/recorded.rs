//! Frames as they were recorded, and what the method reads of a row of them.
//!
//! ```text
//! grey = I of one channel,   0.299 R + 0.587 G + 0.114 B of three (Rec. 601 luma)
//! ```
//!
//! in `f64`, in the units of the samples. Integers stay integers until a row is read: a plane of
//! `f64` weighs eight times a picture of 8 bits, and nobody needs it.

use multiversion::multiversion;
use ndarray::ArrayView2;

/// Weights of red, green and blue.
pub(super) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// A type that pictures come in.
pub trait Sample: Copy + Send + Sync + 'static {
    /// The sample as a number, exactly.
    fn value(self) -> f64;
}

impl Sample for u8 {
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
}

impl Sample for u16 {
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
}

impl Sample for f32 {
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
}

impl Sample for f64 {
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
}

/// What is read of a frame (H, W, C).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reading {
    /// Brightness.
    Grey,
    /// One channel.
    Channel(usize),
}

/// Writes what is read of a row (W, C) to `out`.
pub(super) fn read_row<T: Sample>(row: ArrayView2<'_, T>, reading: Reading, out: &mut [f64]) {
    let channels = row.ncols();
    if let Some(packed) = row.as_slice() {
        match (reading, channels) {
            (Reading::Grey, 3) => luma(packed, out),
            (Reading::Channel(channel), 3) => pick(packed, channel, out),
            _ => out.iter_mut().zip(packed).for_each(|(out, s)| *out = s.value()),
        }
        return;
    }
    for (out, pixel) in out.iter_mut().zip(row.rows()) {
        *out = match (reading, channels) {
            (Reading::Grey, 3) => mixed([0, 1, 2].map(|channel| pixel[channel].value())),
            (Reading::Channel(channel), _) => pixel[channel].value(),
            _ => pixel[0].value(),
        };
    }
}

/// Written out, not as a product of matrices: the same sum in the same order everywhere.
#[inline(always)]
fn mixed([red, green, blue]: [f64; 3]) -> f64 {
    LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn luma<T: Sample>(packed: &[T], out: &mut [f64]) {
    for (out, pixel) in out.iter_mut().zip(packed.as_chunks::<3>().0) {
        *out = mixed([pixel[0].value(), pixel[1].value(), pixel[2].value()]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn pick<T: Sample>(packed: &[T], channel: usize, out: &mut [f64]) {
    for (out, pixel) in out.iter_mut().zip(packed.as_chunks::<3>().0) {
        *out = pixel[channel].value();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, s};

    #[test]
    fn packed_rows_and_others_read_alike() {
        let frame = Array3::from_shape_fn((2, 5, 3), |(y, x, c)| (40 * y + 7 * x + 31 * c) as u8);
        let mut wide = Array3::zeros((2, 5, 6));
        wide.slice_mut(s![.., .., ..;2]).assign(&frame);
        for reading in [Reading::Grey, Reading::Channel(2)] {
            let of = |row: ArrayView2<'_, u8>| {
                let mut out = [f64::NAN; 5];
                read_row(row, reading, &mut out);
                out
            };
            let (packed, apart) =
                (frame.index_axis(ndarray::Axis(0), 1), wide.slice(s![1, .., ..;2]));
            let read = of(packed.view());
            assert_eq!(read, of(apart));
            let pixel = [40.0, 71.0, 102.0];
            let first = if reading == Reading::Grey { mixed(pixel) } else { pixel[2] };
            assert_eq!(read[0], first);
        }
    }

    #[test]
    fn one_channel_is_grey_in_the_units_of_its_samples() {
        let row = ndarray::arr2(&[[3.5f32], [-2.0], [1e9]]);
        let mut out = [0.0; 3];
        read_row(row.view(), Reading::Grey, &mut out);
        assert_eq!(out, [3.5, -2.0, 1e9]);
    }
}
