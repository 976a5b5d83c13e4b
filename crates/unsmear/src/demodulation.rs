//! The derivative of a response along one axis, its carrier taken out.
//!
//! `R` oscillates near the wavenumber `k` of its filter; `z(n) = R(x + n) exp(-i k n)` varies slowly:
//!
//! ```text
//! D z = (z(-2) - 8 z(-1) + 8 z(1) - z(2)) / 12,      rate = k + Im(conj(R) D z) / |R|^2   rad/px
//! ```
//!
//! Beyond the edge of the picture `z` goes on in a straight line through its last two values (a
//! single sample: in a constant). NaN where `R = 0`.

use multiversion::multiversion;

use crate::gabor::Responses;
use crate::phase_rate::ComplexRow;
use crate::real::Real;

/// Reach of the derivative, px.
pub(crate) const REACH: usize = 2;
/// Offsets and weights of the five-point derivative, in twelfths; the middle weight is 0.
const STENCIL: [(i32, f64); 4] = [(-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)];

/// The demodulating derivative along one axis: weights `w_n exp(-i k n)`.
#[derive(Debug, Clone)]
pub(crate) struct Stencil<T> {
    wavenumber: f64,
    cosines: [T; 4],
    sines: [T; 4],
}

impl<T: Real> Stencil<T> {
    pub(crate) fn new(wavenumber: f64) -> Self {
        let weight = |f: fn(f64) -> f64| {
            STENCIL.map(|(n, twelfths)| T::of(twelfths / 12.0 * f(wavenumber * f64::from(n))))
        };
        Self { wavenumber, cosines: weight(f64::cos), sines: weight(f64::sin) }
    }

    pub(crate) fn rate(
        &self,
        [re, im]: [&[T]; 2],
        rows: &[ComplexRow<'_, T>; 4],
        power: &[T],
        out: &mut [T],
    ) {
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
    pub(crate) fn shifted<'s>(
        &self,
        re: &[T],
        im: &[T],
        scratch: &'s mut [T],
    ) -> [ComplexRow<'s, T>; 4] {
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
    pub(crate) fn neighbours<'s>(
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
