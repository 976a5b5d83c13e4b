//! Component velocities of one founding filter in every frame.
//!
//! Given the spatial responses of the frames (T, H, W), in this order:
//!
//! ```text
//! R    = responses * Gaussian taps along t             ('same', zero beyond both ends)
//! dR   = R * [-1 8 0 -8 1] / 12 along x, y and t        ('same', zero beyond the edges)
//! grad phi = Im(conj(R) dR) / |R|^2
//! (un, vn) = -phi_t (phi_x, phi_y) / (phi_x^2 + phi_y^2)                       px/frame
//! ```
//!
//! With three frames the zeros beyond the ends shrink the time derivative to 4/9 at the middle
//! frame and 5/12 at the others, one of the reasons for speeds that are far too low.

use multiversion::multiversion;
use ndarray::{Array2, Array3, Zip};

use crate::control::Control;
use crate::error::Result;
use crate::fourier::Complex64;

/// Complex responses (T, H, W), real and imaginary parts apart.
#[derive(Debug, Clone)]
pub struct Response {
    /// Real part.
    pub re: Array3<f64>,
    /// Imaginary part.
    pub im: Array3<f64>,
}

/// 'Same' convolution of the spatial responses with `taps` along the frames.
#[must_use]
pub fn filter_in_time(responses: &[Array2<Complex64>], taps: &[f64]) -> Response {
    let (height, width) = responses.first().map_or((0, 0), Array2::dim);
    let shape = (responses.len(), height, width);
    let (mut re, mut im) = (Array3::zeros(shape), Array3::zeros(shape));
    for (t, (mut re, mut im)) in re.outer_iter_mut().zip(im.outer_iter_mut()).enumerate() {
        for (s, response) in responses.iter().enumerate() {
            let lag = (t + taps.len() / 2).checked_sub(s);
            let Some(&tap) = lag.and_then(|lag| taps.get(lag)) else { continue };
            re.zip_mut_with(response, |sum, r| *sum += tap * r.re);
            im.zip_mut_with(response, |sum, r| *sum += tap * r.im);
        }
    }
    Response { re, im }
}

/// `un` and `vn` in every frame (T, H, W), px/frame; NaN where there is no phase.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn component_velocities(response: &Response, control: &Control) -> Result<[Array3<f64>; 2]> {
    let [mut un, mut vn, phi_t] = phase_gradient(response, control)?;
    Zip::from(&mut un).and(&mut vn).and(&phi_t).for_each(|phi_x, phi_y, phi_t| {
        let scale = -phi_t / (*phi_x * *phi_x + *phi_y * *phi_y);
        *phi_x *= scale;
        *phi_y *= scale;
    });
    Ok([un, vn])
}

/// `phi_x`, `phi_y` (rad/px) and `phi_t` (rad/frame) in every frame (T, H, W); NaN where `R = 0`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn phase_gradient(response: &Response, control: &Control) -> Result<[Array3<f64>; 3]> {
    let (frames, height, width) = response.re.dim();
    let mut phi = [(); 3].map(|()| vec![0.0; frames * height * width]);
    let zeros = vec![0.0; width];
    let mut padded = [vec![0.0; width + 4], vec![0.0; width + 4]];
    let parts = [&response.re, &response.im].map(|part| part.as_slice().unwrap_or_default());
    let row = |t: Option<usize>, y: Option<usize>| match (t, y) {
        (Some(t), Some(y)) if t < frames && y < height => {
            parts.map(|part| &part[(t * height + y) * width..][..width])
        }
        _ => [zeros.as_slice(); 2],
    };
    for (t, y) in (0..frames).flat_map(|t| (0..height).map(move |y| (t, y))) {
        control.check()?;
        let here = row(Some(t), Some(y));
        padded.iter_mut().zip(here).for_each(|(p, row)| p[2..2 + width].copy_from_slice(row));
        let step = |position: usize, by: isize| position.checked_add_signed(by);
        let neighbours = [
            [0, 1, 3, 4].map(|i| [0, 1].map(|part| &padded[part][i..i + width])),
            [-2, -1, 1, 2].map(|by| row(Some(t), step(y, by))),
            [-2, -1, 1, 2].map(|by| row(step(t, by), Some(y))),
        ];
        for (phi, along) in phi.iter_mut().zip(neighbours) {
            phase_rate(here, along, &mut phi[(t * height + y) * width..][..width]);
        }
    }
    let shape = (frames, height, width);
    Ok(phi.map(|phi| Array3::from_shape_vec(shape, phi).unwrap_or_default()))
}

/// Real and imaginary part of a row.
type Row<'a> = [&'a [f64]; 2];

/// Rows cut to one length, which the compiler then knows.
#[inline(always)]
fn cut(rows: [Row<'_>; 4], n: usize) -> [Row<'_>; 4] {
    rows.map(|[re, im]| [&re[..n], &im[..n]])
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
        let frames: Vec<_> =
            (0..3).map(|t| Array2::from_elem((1, 1), Complex64::new(f64::from(t), 1.0))).collect();
        let response = filter_in_time(&frames, &[0.25, 0.5, 0.25]);
        assert_eq!(response.re.as_slice().unwrap(), [0.25, 1.0, 1.25]);
        assert_eq!(response.im.as_slice().unwrap(), [0.75, 1.0, 0.75]);
    }
}
