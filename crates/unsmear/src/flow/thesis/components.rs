//! Component velocities of one founding filter in every frame.
//!
//! Given the frames (T, H, W) and the filter `g` in space:
//!
//! ```text
//! R    = (frames * Gaussian taps along t) * g           ('same', zero beyond both ends)
//! dR   = R * [-1 8 0 -8 1] / 12 along x, y and t        ('same', zero beyond the edges)
//! grad phi = Im(conj(R) dR) / |R|^2
//! (un, vn) = -phi_t (phi_x, phi_y) / (phi_x^2 + phi_y^2)                       px/frame
//! ```
//!
//! With three frames the zeros beyond the ends shrink the time derivative to 4/9 at the middle
//! frame and 5/12 at the others, one of the reasons for speeds that are far too low.

use multiversion::multiversion;
use ndarray::Array3;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;

/// Complex responses (T, H, W), real and imaginary parts apart.
#[derive(Debug, Clone)]
pub struct Response {
    /// Real part.
    pub re: Array3<f64>,
    /// Imaginary part.
    pub im: Array3<f64>,
}

impl Response {
    /// All responses 0.
    #[must_use]
    pub fn zeros(shape: (usize, usize, usize)) -> Self {
        Self { re: Array3::zeros(shape), im: Array3::zeros(shape) }
    }

    /// Real and imaginary part of each frame, packed.
    pub(super) fn frames_mut(&mut self) -> impl Iterator<Item = [&mut [f64]; 2]> {
        let (_, height, width) = self.re.dim();
        let frame = (height * width).max(1);
        let [re, im] = [&mut self.re, &mut self.im]
            .map(|part| part.as_slice_mut().unwrap_or_default().chunks_mut(frame));
        re.zip(im).map(|(re, im)| [re, im])
    }
}

/// 'Same' convolution of the frames (T, H, W) with `taps` along t. It commutes with the filters in
/// space, and on real frames it is done once for all of them.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn filter_in_time(
    frames: &Array3<f64>,
    taps: &[f64],
    control: &Control,
) -> Result<Array3<f64>> {
    let frames = frames.as_standard_layout();
    let (count, height, width) = frames.dim();
    let mut filtered = Array3::zeros((count, height, width));
    let rows = filtered.as_slice_mut().unwrap_or_default();
    for_each_row(rows, width, control, |row, sums| {
        let t = row / height;
        for (s, frame) in frames.outer_iter().enumerate() {
            let lag = (t + taps.len() / 2).checked_sub(s);
            let Some(&tap) = lag.and_then(|lag| taps.get(lag)) else { continue };
            let samples = frame.row(row % height);
            sums.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += tap * sample);
        }
    })?;
    Ok(filtered)
}

/// `un` and `vn` in every frame (T, H, W), px/frame; NaN where there is no phase.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn component_velocities(response: &Response, control: &Control) -> Result<[Array3<f64>; 2]> {
    let shape = response.re.dim();
    let [mut un, mut vn] = [(); 2].map(|()| Array3::zeros(shape));
    let mut phi_t = vec![0.0; shape.2];
    let rows = un.rows_mut().into_iter().zip(vn.rows_mut());
    let places = (0..shape.0).flat_map(|t| (0..shape.1).map(move |y| (t, y)));
    let mut rates = PhaseRates::new(response);
    for ((t, y), (mut un, mut vn)) in places.zip(rows) {
        control.check()?;
        let (un, vn) =
            (un.as_slice_mut().unwrap_or_default(), vn.as_slice_mut().unwrap_or_default());
        rates.of_row(t, y, [un, vn, &mut phi_t]);
        along_the_normal(un, vn, &phi_t);
    }
    Ok([un, vn])
}

/// `phi_x`, `phi_y` (rad/px) and `phi_t` (rad/frame) in every frame (T, H, W); NaN where `R = 0`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn phase_gradient(response: &Response, control: &Control) -> Result<[Array3<f64>; 3]> {
    let (frames, height, width) = response.re.dim();
    let mut phi = [(); 3].map(|()| vec![0.0; frames * height * width]);
    let mut rates = PhaseRates::new(response);
    for (t, y) in (0..frames).flat_map(|t| (0..height).map(move |y| (t, y))) {
        control.check()?;
        let at = (t * height + y) * width;
        rates.of_row(t, y, phi.each_mut().map(|phi| &mut phi[at..at + width]));
    }
    let shape = (frames, height, width);
    Ok(phi.map(|phi| Array3::from_shape_vec(shape, phi).unwrap_or_default()))
}

/// The phase gradient, row by row.
struct PhaseRates<'a> {
    parts: Row<'a>,
    shape: (usize, usize, usize),
    zeros: Vec<f64>,
    padded: [Vec<f64>; 2],
}

impl<'a> PhaseRates<'a> {
    fn new(response: &'a Response) -> Self {
        let width = response.re.dim().2;
        Self {
            parts: [&response.re, &response.im].map(|part| part.as_slice().unwrap_or_default()),
            shape: response.re.dim(),
            zeros: vec![0.0; width],
            padded: [vec![0.0; width + 4], vec![0.0; width + 4]],
        }
    }

    fn of_row(&mut self, t: usize, y: usize, phi: [&mut [f64]; 3]) {
        let (frames, height, width) = self.shape;
        let (parts, zeros) = (self.parts, self.zeros.as_slice());
        let row = |t: Option<usize>, y: Option<usize>| match (t, y) {
            (Some(t), Some(y)) if t < frames && y < height => {
                parts.map(|part| &part[(t * height + y) * width..][..width])
            }
            _ => [zeros; 2],
        };
        let here = row(Some(t), Some(y));
        let padded = &mut self.padded;
        padded.iter_mut().zip(here).for_each(|(p, row)| p[2..2 + width].copy_from_slice(row));
        let step = |position: usize, by: isize| position.checked_add_signed(by);
        let neighbours = [
            [0, 1, 3, 4].map(|i| [0, 1].map(|part| &padded[part][i..i + width])),
            [-2, -1, 1, 2].map(|by| row(Some(t), step(y, by))),
            [-2, -1, 1, 2].map(|by| row(step(t, by), Some(y))),
        ];
        for (phi, along) in phi.into_iter().zip(neighbours) {
            phase_rate(here, along, phi);
        }
    }
}

/// Real and imaginary part of a row.
type Row<'a> = [&'a [f64]; 2];

/// Rows cut to one length, which the compiler then knows.
#[inline(always)]
fn cut(rows: [Row<'_>; 4], n: usize) -> [Row<'_>; 4] {
    rows.map(|[re, im]| [&re[..n], &im[..n]])
}

/// Turns `phi_x`, `phi_y` into the velocity along them.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn along_the_normal(phi_x: &mut [f64], phi_y: &mut [f64], phi_t: &[f64]) {
    let n = phi_t.len();
    let (phi_x, phi_y) = (&mut phi_x[..n], &mut phi_y[..n]);
    for x in 0..n {
        let scale = -phi_t[x] / (phi_x[x] * phi_x[x] + phi_y[x] * phi_y[x]);
        phi_x[x] *= scale;
        phi_y[x] *= scale;
    }
}

/// Five-point derivative from the samples at -2, -1, 1 and 2.
#[inline(always)]
fn slope(a: f64, b: f64, c: f64, d: f64) -> f64 {
    (c - b) * (8.0 / 12.0) - (d - a) / 12.0
}

/// `Im(conj(R) dR) / |R|^2` of a row, from its neighbours at -2, -1, 1 and 2.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn phase_rate([re, im]: Row<'_>, along: [Row<'_>; 4], phi: &mut [f64]) {
    let n = phi.len();
    let (re, im) = (&re[..n], &im[..n]);
    let [[a_re, a_im], [b_re, b_im], [c_re, c_im], [d_re, d_im]] = cut(along, n);
    for x in 0..n {
        let slope_re = slope(a_re[x], b_re[x], c_re[x], d_re[x]);
        let slope_im = slope(a_im[x], b_im[x], c_im[x], d_im[x]);
        let power = re[x] * re[x] + im[x] * im[x];
        phi[x] = (re[x] * slope_im - im[x] * slope_re) / power;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow plane wave `exp(i (kx x - w t))` in the interior of many frames: the stencil measures
    /// it to fifth order, and its normal velocity is w / kx.
    #[test]
    fn a_moving_wave_has_its_normal_velocity() {
        let (kx, omega) = (0.1, 0.05);
        let wave = |t: usize, x: usize| kx * x as f64 - omega * t as f64;
        let shape = (5, 5, 9);
        let response = Response {
            re: Array3::from_shape_fn(shape, |(t, _, x)| wave(t, x).cos()),
            im: Array3::from_shape_fn(shape, |(t, _, x)| wave(t, x).sin()),
        };
        let [un, vn] = component_velocities(&response, &Control::new()).unwrap();
        assert!((un[(2, 2, 4)] - omega / kx).abs() < 1e-5);
        assert!(vn[(2, 2, 4)].abs() < 1e-12);
    }

    #[test]
    fn time_filter_is_a_same_convolution() {
        let frames = Array3::from_shape_fn((3, 1, 2), |(t, _, x)| (t + 4 * x) as f64);
        let filtered = filter_in_time(&frames, &[0.25, 0.5, 0.25], &Control::new()).unwrap();
        assert_eq!(filtered.as_slice().unwrap(), [0.25, 3.25, 1.0, 5.0, 1.25, 4.25]);
    }
}
