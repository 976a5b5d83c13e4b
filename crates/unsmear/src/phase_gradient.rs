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
//! [`crate::spatiotemporal`]), or phases are compared: [`crate::phase_rate`].
//!
//! NaN where `R = 0`, which has no phase. Source: Fleet & Jepson 1990 (doi 10.1007/BF00056772),
//! section 3. The founding method differentiates `R` itself with zeros beyond the edge.

use ndarray::Array4;

use crate::array::for_each_row_with;
use crate::control::Control;
use crate::demodulation::{REACH, Stencil};
use crate::error::Result;
use crate::gabor::Responses;
use crate::phase_rate::square;
use crate::real::Real;

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
}
