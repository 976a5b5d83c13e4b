//! Cubic B-spline interpolation whose every value depends on a bounded neighbourhood.
//!
//! ```text
//! s(y, x) = sum_kl c[k, l] B(y - k) B(x - l),      c = picture * a * a',      a_n = sqrt(3) z^|n|,  z = sqrt(3) - 2
//! ```
//!
//! with B the centred cubic B-spline. The filter `a` is the exact inverse of the samples of B (1/6, 4/6, 1/6); it is
//! cut at |n| <= [`PREFILTER_REACH`] and normalised, so that one unknown (NaN) pixel cannot reach farther and all
//! others keep their bits. |z|^reach = 4e-7 of the picture's contrast is lost by the cut: an 8-bit level over 10^4.
//! The picture is continued by its edge pixels (replicate), for the coefficients and for positions outside.
//!
//! Reference: M. Unser, A. Aldroubi, M. Eden, "B-spline signal processing: part I", IEEE Trans. Signal Processing 41
//! (1993) 821-833, [10.1109/78.193220](https://doi.org/10.1109/78.193220).
#![allow(
    clippy::inline_always,
    reason = "a helper gets its caller's vector instructions only when inlined"
)]

use multiversion::multiversion;
use ndarray::ArrayView2;

use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::Result;
use crate::real::Real;
use crate::tasks::filled;

/// Samples on each side that a coefficient depends on.
pub(crate) const PREFILTER_REACH: usize = 11;

/// Samples on each side that a value depends on: its four coefficients and theirs.
pub(crate) const VALUE_REACH: usize = PREFILTER_REACH + 2;

/// Coefficients kept beyond each edge: those under a spline centred on an edge pixel.
const PAD: usize = 2;

/// A picture prepared for interpolation; positions are relative to a pixel, which keeps `f32` accurate.
pub(crate) struct LocalSpline<T> {
    coefficients: Vec<T>,
    stride: usize,
}

impl<T: Real> LocalSpline<T> {
    /// Prepares a picture of at least one pixel.
    pub(crate) fn new(image: &ArrayView2<'_, T>, control: &Control) -> Result<Self> {
        let (height, width) = image.dim();
        let taps = prefilter_taps::<T>();
        let (rows, stride) = (height + 2 * PAD, width + 2 * PAD);
        let mut coefficients = filled(T::zero(), rows * stride);
        let padded_row = || vec![T::zero(); stride + 2 * PREFILTER_REACH];
        for_each_row_with(&mut coefficients, stride, control, padded_row, |row, out, line| {
            line.fill(T::zero());
            // Down the columns first, at this row of the result; then along it.
            let (middle, taps_down) = (&mut line[PREFILTER_REACH + PAD..][..width], &taps);
            for (k, &tap) in taps_down.iter().enumerate() {
                let y = (row + k).saturating_sub(PREFILTER_REACH + PAD).min(height - 1);
                match image.row(y).to_slice() {
                    Some(source) => add_scaled(middle, source, tap),
                    None => {
                        middle.iter_mut().zip(image.row(y)).for_each(|(m, &s)| *m += tap * s);
                    }
                }
            }
            let (first, last) = (middle[0], middle[width - 1]);
            line[..PREFILTER_REACH + PAD].fill(first);
            line[PREFILTER_REACH + PAD + width..].fill(last);
            out.fill(T::zero());
            for (k, &tap) in taps.iter().enumerate() {
                add_scaled(out, &line[k..k + stride], tap);
            }
        })?;
        Ok(Self { coefficients, stride })
    }

    /// Sum over the points of `path` of their values times `weights`, one weight for each pair of points.
    #[inline(always)]
    pub(crate) fn weighted_sum(&self, y: usize, x: usize, path: &Path<T>, weights: &[T]) -> T {
        // Four columns kept apart fill a vector register; they are added at the end.
        let mut columns = [T::zero(); 4];
        let first = (y * self.stride + x) as isize;
        let [wa, wb, wc, wd] = path.down.weights.each_ref();
        let [va, vb, vc, vd] = path.across.weights.each_ref();
        for (i, &weight) in weights.iter().flat_map(|w| [w, w]).enumerate() {
            let (row, column) = (path.down.whole[i], path.across.whole[i]);
            let top = (first + row as isize * self.stride as isize + column as isize) as usize;
            let patch = &self.coefficients[top..top + 3 * self.stride + 4];
            let (a, b) = (&patch[..4], &patch[self.stride..self.stride + 4]);
            let (c, d) = (&patch[2 * self.stride..2 * self.stride + 4], &patch[3 * self.stride..]);
            let across = [va[i], vb[i], vc[i], vd[i]];
            for j in 0..4 {
                let value = (wa[i] * a[j] + wb[i] * b[j]) + (wc[i] * c[j] + wd[i] * d[j]);
                columns[j] += weight * across[j] * value;
            }
        }
        (columns[0] + columns[1]) + (columns[2] + columns[3])
    }
}

/// Points near a pixel, prepared for all channels at once: offsets first, then [`Path::prepare`].
pub(crate) struct Path<T> {
    down: Axis<T>,
    across: Axis<T>,
}

/// One coordinate of the points of a path.
struct Axis<T> {
    offsets: Vec<T>,
    /// First coefficient under the spline, relative to the pixel's own place among the padded ones.
    whole: Vec<i32>,
    weights: [Vec<T>; 4],
}

impl<T: Real> Path<T> {
    /// Room for `points` points.
    pub(crate) fn new(points: usize) -> Self {
        let axis = || Axis {
            offsets: Vec::with_capacity(points),
            whole: vec![0; points],
            weights: [(); 4].map(|()| vec![T::zero(); points]),
        };
        Self { down: axis(), across: axis() }
    }

    /// Forgets the points.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.down.offsets.clear();
        self.across.offsets.clear();
    }

    /// Adds the point at `dx`, `dy` px from the pixel; it must lie within the picture.
    #[inline(always)]
    pub(crate) fn push(&mut self, [dx, dy]: [T; 2]) {
        self.down.offsets.push(dy);
        self.across.offsets.push(dx);
    }

    /// Computes places and weights of the points.
    #[inline(always)]
    pub(crate) fn prepare(&mut self) {
        self.down.prepare();
        self.across.prepare();
    }
}

impl<T: Real> Axis<T> {
    #[inline(always)]
    fn prepare(&mut self) {
        let n = self.offsets.len();
        if self.whole.len() < n {
            self.whole.resize(n, 0);
            self.weights.iter_mut().for_each(|w| w.resize(n, T::zero()));
        }
        let (offsets, whole) = (&self.offsets[..n], &mut self.whole[..n]);
        let [a, b, c, d] = &mut self.weights;
        let (a, b, c, d) = (&mut a[..n], &mut b[..n], &mut c[..n], &mut d[..n]);
        for i in 0..n {
            let floor = offsets[i].floor();
            // The coefficient before the cell: -1, and the padding.
            whole[i] = floor.as_i32() + (PAD as i32 - 1);
            [a[i], b[i], c[i], d[i]] = spline_weights(offsets[i] - floor);
        }
    }
}

/// B(f + 1), B(f), B(1 - f), B(2 - f) for f in [0, 1].
#[inline(always)]
fn spline_weights<T: Real>(f: T) -> [T; 4] {
    let (sixth, half, two_thirds) = (T::of(1.0 / 6.0), T::of(0.5), T::of(2.0 / 3.0));
    let g = T::one() - f;
    let (ff, gg) = (f * f, g * g);
    [
        gg * g * sixth,
        two_thirds - half * ff * (T::one() + g),
        two_thirds - half * gg * (T::one() + f),
        ff * f * sixth,
    ]
}

fn prefilter_taps<T: Real>() -> Vec<T> {
    let pole = 3f64.sqrt() - 2.0;
    let reach = PREFILTER_REACH as i32;
    let taps: Vec<f64> = (-reach..=reach).map(|n| pole.powi(n.abs())).collect();
    let total: f64 = taps.iter().sum();
    taps.into_iter().map(|tap| T::of(tap / total)).collect()
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_scaled<T: Real>(out: &mut [T], source: &[T], tap: T) {
    for (sum, &sample) in out.iter_mut().zip(source) {
        *sum += tap * sample;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn value<T: Real>(spline: &LocalSpline<T>, y: usize, x: usize, offset: [f64; 2]) -> T {
        let mut path = Path::new(1);
        // One weight stands for two points.
        path.push(offset.map(T::of));
        path.push(offset.map(T::of));
        path.prepare();
        T::of(0.5) * spline.weighted_sum(y, x, &path, &[T::one()])
    }

    #[test]
    fn passes_through_the_samples_and_reproduces_planes() {
        let image = Array2::from_shape_fn((31, 40), |(y, x)| ((y * 7 + x * x) % 23) as f64);
        let spline = LocalSpline::new(&image.view(), &Control::new()).unwrap();
        for ((y, x), &sample) in image.indexed_iter() {
            // Both prefilters are cut at |z|^12 = 1.4e-7 of a contrast of 23.
            assert!((value(&spline, y, x, [0.0, 0.0]) - sample).abs() < 1e-4);
        }
        let plane = Array2::from_shape_fn((40, 40), |(y, x)| 2.0 * y as f64 - 0.5 * x as f64);
        let spline = LocalSpline::new(&plane.view(), &Control::new()).unwrap();
        let value = value(&spline, 20, 20, [0.7, -1.3]);
        assert!((value - (2.0 * 18.7 - 0.5 * 20.7)).abs() < 1e-4);
    }

    #[test]
    fn an_unknown_pixel_stays_within_reach_and_leaves_the_rest_bit_equal() {
        let mut image = Array2::from_shape_fn((50, 50), |(y, x)| ((y * 5 + x * 3) % 17) as f32);
        let clean = LocalSpline::new(&image.view(), &Control::new()).unwrap();
        image[(25, 25)] = f32::NAN;
        let holed = LocalSpline::new(&image.view(), &Control::new()).unwrap();
        for (y, x) in (0..49usize).flat_map(|y| (0..49usize).map(move |x| (y, x))) {
            let near = y.abs_diff(25) <= VALUE_REACH && x.abs_diff(25) <= VALUE_REACH;
            let (a, b) = (value(&clean, y, x, [0.6, 0.4]), value(&holed, y, x, [0.6, 0.4]));
            assert!(b.to_bits() == a.to_bits() || (near && b.is_nan()), "{y} {x}");
        }
    }
}
