//! Phase gradient of complex filter responses, without unwrapping.
//!
//! For a response `R = |R| exp(i phi)`,
//!
//! ```text
//! grad phi = Im(conj(R) grad R) / |R|^2          rad/px, rad/px, rad/frame
//! ```
//!
//! `R` oscillates near the wavevector `k` of its filter, which difference formulas resolve badly,
//! so the carrier is taken out first: `z(n) = R(x + n) exp(-i k n)` varies slowly, and
//!
//! ```text
//! phi_x = k + Im(conj(R) D z) / |R|^2,   D z = (z(-2) - 8 z(-1) + 8 z(1) - z(2)) / 12
//! ```
//!
//! On a plane wave at `k + d` this gives `k + d - d^5 / 30 + ...`. Beyond the edge of the picture
//! `z` goes on in a straight line. In time the slope comes from the filter itself (see
//! [`crate::temporal`]): [`rate_of_phase`].
//!
//! NaN where `R = 0`, which has no phase. Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772),
//! section 3. The founding method differentiates `R` itself with zeros beyond the edge.

use multiversion::multiversion;
use ndarray::Array4;

use crate::array::for_each_row_with;
use crate::control::Control;
use crate::error::Result;
use crate::gabor::Responses;
use crate::real::Real;

/// Reach of the derivative, px.
const REACH: usize = 2;
/// Offsets and weights of the five-point derivative, in twelfths; the middle weight is 0.
const STENCIL: [(i32, f64); 4] = [(-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)];

/// `phi_x`, `phi_y` and squared amplitude of `N` responses (H, W), rows of all filters side by side.
#[derive(Debug, Clone)]
pub struct PhaseGradient<T> {
    data: Vec<T>,
    filters: usize,
    width: usize,
}

/// One row of one filter of a [`PhaseGradient`].
#[derive(Debug, Clone, Copy)]
pub struct PhaseRow<'a, T> {
    /// `d phi / d x`, rad/px; NaN where the response is 0.
    pub phi_x: &'a [T],
    /// `d phi / d y`, rad/px; NaN where the response is 0.
    pub phi_y: &'a [T],
    /// `|R|^2`.
    pub power: &'a [T],
}

impl<T: Real> PhaseGradient<T> {
    /// The gradient of all responses; `wavevectors` are those of their filters, rad/px.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    ///
    /// # Panics
    /// When there are fewer wavevectors than responses.
    pub fn new(
        responses: &Responses<T>,
        wavevectors: &[[f64; 2]],
        control: &Control,
    ) -> Result<Self> {
        let (filters, height, width) = responses.dim();
        let stencils: Vec<[Stencil<T>; 2]> =
            wavevectors[..filters].iter().map(|k| k.map(Stencil::new)).collect();
        let mut data = vec![T::zero(); 3 * filters * height * width];
        for_each_row_with(
            &mut data,
            3 * filters * width,
            control,
            || vec![T::zero(); 2 * (width + 2 * REACH) * (2 * REACH + 1)],
            |y, out, scratch| {
                for (filter, out) in out.chunks_mut(3 * width).enumerate() {
                    let (phi_x, rest) = out.split_at_mut(width);
                    let (phi_y, power) = rest.split_at_mut(width);
                    let (re, im) = responses.row(filter, y);
                    square(re, im, power);
                    let [along_x, along_y] = &stencils[filter];
                    let rows = along_x.shifted(re, im, scratch);
                    along_x.rate([re, im], &rows, power, phi_x);
                    let rows = along_y.neighbours(responses, filter, y, height, scratch);
                    along_y.rate([re, im], &rows, power, phi_y);
                }
            },
        )?;
        Ok(Self { data, filters, width })
    }

    /// `phi_x`, `phi_y` and squared amplitude of all responses, (3, N, H, W), nothing copied: in
    /// memory the rows of all filters lie side by side, (H, N, 3, W).
    #[must_use]
    pub fn into_array(self) -> Array4<T> {
        let row = 3 * self.filters * self.width;
        let height = self.data.len().checked_div(row).unwrap_or(0);
        let shape = (height, self.filters, 3, self.width);
        Array4::from_shape_vec(shape, self.data).unwrap_or_default().permuted_axes([2, 1, 0, 3])
    }

    /// Row `y` of filter `filter`.
    #[inline]
    #[must_use]
    pub fn row(&self, filter: usize, y: usize) -> PhaseRow<'_, T> {
        let start = (y * self.filters + filter) * 3 * self.width;
        let (phi_x, rest) = self.data[start..start + 3 * self.width].split_at(self.width);
        let (phi_y, power) = rest.split_at(self.width);
        PhaseRow { phi_x, phi_y, power }
    }
}

/// `Im(conj(R) dR) / |R|^2 + offset` for a row: the rate of phase along the direction in which `dR`
/// is the (demodulated) derivative; NaN where `R = 0`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn rate_of_phase<T: Real>(
    [re, im]: [&[T]; 2],
    [d_re, d_im]: [&[T]; 2],
    power: &[T],
    offset: T,
    out: &mut [T],
) {
    let n = out.len();
    let (re, im, d_re, d_im, power) = (&re[..n], &im[..n], &d_re[..n], &d_im[..n], &power[..n]);
    for x in 0..n {
        out[x] = (re[x] * d_im[x] - im[x] * d_re[x]) / power[x] + offset;
    }
}

/// The demodulating derivative along one axis: weights `w_n exp(-i k n)`.
#[derive(Debug, Clone)]
struct Stencil<T> {
    wavenumber: f64,
    cosines: [T; 4],
    sines: [T; 4],
}

/// `arg(conj(R) R')` of a row: the phase advance from one frame to the next, rad in (-pi, pi].
///
/// Exact for any uniform shift below half a wavelength; exactly 0 for equal responses.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn phase_step<T: Real>(first: ComplexRow<'_, T>, second: ComplexRow<'_, T>, out: &mut [T]) {
    let n = out.len();
    let ((a_re, a_im), (b_re, b_im)) = (first, second);
    let (a_re, a_im, b_re, b_im) = (&a_re[..n], &a_im[..n], &b_re[..n], &b_im[..n]);
    for x in 0..n {
        let across = a_re[x] * b_im[x] - a_im[x] * b_re[x];
        let along = a_re[x] * b_re[x] + a_im[x] * b_im[x];
        out[x] = T::angle(across, along);
    }
}

/// Real and imaginary part of a row.
pub type ComplexRow<'a, T> = (&'a [T], &'a [T]);

impl<T: Real> Stencil<T> {
    fn new(wavenumber: f64) -> Self {
        let weight = |f: fn(f64) -> f64| {
            STENCIL.map(|(n, twelfths)| T::of(twelfths / 12.0 * f(wavenumber * f64::from(n))))
        };
        Self { wavenumber, cosines: weight(f64::cos), sines: weight(f64::sin) }
    }

    fn rate(&self, [re, im]: [&[T]; 2], rows: &[ComplexRow<'_, T>; 4], power: &[T], out: &mut [T]) {
        let k = T::of(self.wavenumber);
        demodulated_rate(re, im, rows, [&self.cosines, &self.sines], power, k, out);
    }

    /// What `z` in a straight line through its values `first` (at the edge) and `second` (next to
    /// it) makes of the sample `m` beyond the edge; `inwards` is the sign of the step from edge to
    /// inside.
    fn beyond(&self, m: i32, inwards: f64, first: [T; 2], second: [T; 2]) -> [T; 2] {
        let steps = T::of(f64::from(m));
        let turned = rotate(second, -self.wavenumber * inwards);
        let line = [0, 1].map(|i| (steps + T::one()) * first[i] - steps * turned[i]);
        rotate(line, -self.wavenumber * inwards * f64::from(m))
    }

    /// The row itself, shifted by each offset of the stencil, continued beyond both ends.
    fn shifted<'s>(&self, re: &[T], im: &[T], scratch: &'s mut [T]) -> [ComplexRow<'s, T>; 4] {
        let n = re.len();
        let length = n + 2 * REACH;
        let (padded_re, padded_im) = scratch[..2 * length].split_at_mut(length);
        padded_re[REACH..REACH + n].copy_from_slice(re);
        padded_im[REACH..REACH + n].copy_from_slice(im);
        let at = |x: usize| [re[x], im[x]];
        // A single column has no second sample: `z` is taken as constant.
        let (next, previous) = (1.min(n - 1), n.saturating_sub(2));
        let turn = if n == 1 { self.wavenumber } else { 0.0 };
        for m in 1..=REACH {
            let before = self.beyond(m as i32, 1.0, at(0), rotate(at(next), turn));
            let after = self.beyond(m as i32, -1.0, at(n - 1), rotate(at(previous), -turn));
            [padded_re[REACH - m], padded_im[REACH - m]] = before;
            [padded_re[REACH + n - 1 + m], padded_im[REACH + n - 1 + m]] = after;
        }
        let (padded_re, padded_im) = (&*padded_re, &*padded_im);
        STENCIL.map(|(offset, _)| {
            let start = (REACH as i32 + offset) as usize;
            (&padded_re[start..start + n], &padded_im[start..start + n])
        })
    }

    /// The rows above and below, continued beyond the top and the bottom.
    fn neighbours<'s>(
        &self,
        responses: &'s Responses<T>,
        filter: usize,
        y: usize,
        height: usize,
        scratch: &'s mut [T],
    ) -> [ComplexRow<'s, T>; 4] {
        let width = responses.dim().2;
        let mut spare = scratch.chunks_mut(2 * width.max(1));
        STENCIL.map(|(offset, _)| {
            let row = y as isize + offset as isize;
            if (0..height as isize).contains(&row) {
                return responses.row(filter, row as usize);
            }
            let (edge, inwards, m) = if row < 0 {
                (0, 1.0, -row as i32)
            } else {
                (height - 1, -1.0, (row + 1) as i32 - height as i32)
            };
            let inner = if height == 1 { 0 } else { (edge as f64 + inwards) as usize };
            let turn = if height == 1 { self.wavenumber * inwards } else { 0.0 };
            let (first, second) = (responses.row(filter, edge), responses.row(filter, inner));
            let (re, im) = spare.next().unwrap_or_default().split_at_mut(width);
            for x in 0..width {
                let inner = rotate([second.0[x], second.1[x]], turn);
                [re[x], im[x]] = self.beyond(m, inwards, [first.0[x], first.1[x]], inner);
            }
            (&*re, &*im)
        })
    }
}

/// A complex number times `exp(i angle)`.
fn rotate<T: Real>([re, im]: [T; 2], angle: f64) -> [T; 2] {
    let (sin, cos) = angle.sin_cos();
    let (sin, cos) = (T::of(sin), T::of(cos));
    [re * cos - im * sin, re * sin + im * cos]
}

/// `k + Im(conj(R) D z) / |R|^2` with `D z = sum_n (c_n - i s_n) R(+n)`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn demodulated_rate<T: Real>(
    re: &[T],
    im: &[T],
    rows: &[ComplexRow<'_, T>; 4],
    [cosines, sines]: [&[T; 4]; 2],
    power: &[T],
    wavenumber: T,
    out: &mut [T],
) {
    let n = out.len();
    let (re, im, power) = (&re[..n], &im[..n], &power[..n]);
    let [(a_re, a_im), (b_re, b_im), (c_re, c_im), (d_re, d_im)] = *rows;
    let (a_re, a_im, b_re, b_im) = (&a_re[..n], &a_im[..n], &b_re[..n], &b_im[..n]);
    let (c_re, c_im, d_re, d_im) = (&c_re[..n], &c_im[..n], &d_re[..n], &d_im[..n]);
    for x in 0..n {
        let slope_re = cosines[0] * a_re[x]
            + sines[0] * a_im[x]
            + (cosines[1] * b_re[x] + sines[1] * b_im[x])
            + (cosines[2] * c_re[x] + sines[2] * c_im[x])
            + (cosines[3] * d_re[x] + sines[3] * d_im[x]);
        let slope_im = cosines[0] * a_im[x] - sines[0] * a_re[x]
            + (cosines[1] * b_im[x] - sines[1] * b_re[x])
            + (cosines[2] * c_im[x] - sines[2] * c_re[x])
            + (cosines[3] * d_im[x] - sines[3] * d_re[x]);
        out[x] = (re[x] * slope_im - im[x] * slope_re) / power[x] + wavenumber;
    }
}

/// `out = re^2 + im^2`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn square<T: Real>(re: &[T], im: &[T], out: &mut [T]) {
    let n = out.len();
    let (re, im) = (&re[..n], &im[..n]);
    for x in 0..n {
        out[x] = re[x] * re[x] + im[x] * im[x];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Responses that are one plane wave at `k`, amplitude 3.
    fn plane_wave(k: [f64; 2], height: usize, width: usize) -> Responses<f64> {
        let mut responses = Responses::zeros(1, height, width);
        for y in 0..height {
            let (re, im) = responses.row_mut(0, y);
            for x in 0..width {
                let phase = k[0] * x as f64 + k[1] * y as f64 + 0.4;
                re[x] = 3.0 * phase.cos();
                im[x] = 3.0 * phase.sin();
            }
        }
        responses
    }

    #[test]
    fn a_plane_wave_has_its_wavevector_as_gradient() {
        let tuned = [0.7, -0.55];
        for (height, width) in [(7, 9), (2, 2), (1, 5), (5, 1), (3, 3)] {
            let responses = plane_wave(tuned, height, width);
            let gradient = PhaseGradient::new(&responses, &[tuned], &Control::new()).unwrap();
            for y in 0..height {
                let row = gradient.row(0, y);
                for x in 0..width {
                    // Tuned exactly: `z` is constant and every border rule exact.
                    assert!((row.phi_x[x] - tuned[0]).abs() < 1e-13, "{height}x{width} {y},{x}");
                    assert!((row.phi_y[x] - tuned[1]).abs() < 1e-13, "{height}x{width} {y},{x}");
                    assert!((row.power[x] - 9.0).abs() < 1e-13);
                }
            }
            let array = gradient.into_array();
            assert_eq!(array.shape(), [3, 1, height, width]);
            assert!((array[(1, 0, height - 1, width - 1)] - tuned[1]).abs() < 1e-13);
        }
    }

    #[test]
    fn detuned_waves_are_measured_to_fifth_order() {
        let (tuned, offset) = ([0.9, 0.3], 0.3);
        let responses = plane_wave([tuned[0] + offset, tuned[1] - offset], 9, 9);
        let gradient = PhaseGradient::new(&responses, &[tuned], &Control::new()).unwrap();
        let row = gradient.row(0, 4);
        // (8 sin d - sin 2d) / 6 is what the stencil makes of d.
        let seen = (8.0 * offset.sin() - (2.0 * offset).sin()) / 6.0;
        assert!((row.phi_x[4] - tuned[0] - seen).abs() < 1e-13);
        assert!((row.phi_y[4] - tuned[1] + seen).abs() < 1e-13);
        assert!((seen - offset).abs() < offset.powi(5) / 25.0);
    }

    #[test]
    fn no_response_no_phase() {
        let responses = Responses::<f32>::zeros(1, 4, 4);
        let gradient = PhaseGradient::new(&responses, &[[1.0, 0.0]], &Control::new()).unwrap();
        assert!(
            gradient.row(0, 2).phi_x.iter().chain(gradient.row(0, 2).phi_y).all(|p| p.is_nan())
        );
    }

    #[test]
    fn rate_is_that_of_a_rotating_phasor() {
        let (re, im) = ([2.0, 0.0], [0.0, 1.0]);
        let (d_re, d_im) = ([0.0, -0.25], [0.5, 0.0]);
        let mut rate = [0.0; 2];
        rate_of_phase([&re, &im], [&d_re, &d_im], &[4.0, 1.0], 1.0, &mut rate);
        assert_eq!(rate, [1.25, 1.25]);
    }
}
