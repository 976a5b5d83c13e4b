//! How strong a picture's detail is around each pixel: the constant of its local power spectrum.
//!
//! Natural pictures have spectra near `S(w) = c / |w|^2` (w in rad/px; D. J. Field, J. Opt. Soc. Am. A 4 (1987)
//! 2379-2394, [10.1364/JOSAA.4.002379](https://doi.org/10.1364/JOSAA.4.002379)), with a c that varies from sky to
//! foliage by a thousand. Smoothed by a Gaussian of deviation s, such a picture has the mean square gradient
//! `c / (4 pi s^2)`, to which white noise adds `sigma^2 / (4 pi s^4)`. Hence, with G a local mean,
//!
//! ```text
//! c(p) = DETAIL max(0, 4 pi s^2 G[|grad g_s * b|^2](p) - sigma^2 / s^2)
//! ```
//!
//! b is the blurred picture; DETAIL weighs what its blur hides against what local means exaggerate. It and the width
//! of G were set on five photographs at sigma = 1 grey level (c local instead of one for the picture: +0.5 dB in the
//! mean, +2 dB where large parts are smooth); a factor 2 in either costs 0.1 dB.

use ndarray::{Array2, ArrayView2, Axis};

use crate::border::Border;
use crate::control::Control;
use crate::convolve::{correlate_separable, gaussian_taps};
use crate::error::Result;
use crate::real::Real;

/// Deviation of the smoothing, px: noise's gradient is damped tenfold, edges survive.
const SMOOTHING: f64 = 1.5;

/// Deviation of the local mean, px.
const NEIGHBOURHOOD: f64 = 3.0;

/// Half length of Gaussian taps, in deviations.
const DEVIATIONS: usize = 4;

/// See the [module](self).
const DETAIL: f64 = 0.7;

/// Pixels on each side that the constant depends on: smoothing, differences, and the mean.
pub(super) const DETAIL_REACH: usize =
    (DEVIATIONS as f64 * (SMOOTHING + NEIGHBOURHOOD)) as usize + 1;

/// The constant c around each pixel of a blurred picture with noise `sigma`, in the picture's units squared; 0 where
/// nothing but noise is seen, NaN within [`DETAIL_REACH`] of unknown pixels.
pub(super) fn local_detail<T: Real>(
    image: &ArrayView2<'_, T>,
    sigma: f64,
    control: &Control,
) -> Result<Array2<T>> {
    let smooth = gaussian(image, SMOOTHING, control)?;
    let (height, width) = image.dim();
    let half = T::of(0.5);
    let energy = Array2::from_shape_fn((height, width), |(y, x)| {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let dx = half * (smooth[(y, right)] - smooth[(y, left)]);
        let dy = half * (smooth[(below, x)] - smooth[(above, x)]);
        dx * dx + dy * dy
    });
    let noise = T::of(sigma * sigma / (SMOOTHING * SMOOTHING));
    let scale = T::of(4.0 * std::f64::consts::PI * SMOOTHING * SMOOTHING);
    let share = T::of(DETAIL);
    let mut detail = gaussian(&energy.view(), NEIGHBOURHOOD, control)?;
    detail.mapv_inplace(|g| {
        let c = scale * g - noise;
        // Written so that an unknown stays unknown.
        if c < T::zero() { T::zero() } else { share * c }
    });
    Ok(detail)
}

fn gaussian<T: Real>(
    picture: &ArrayView2<'_, T>,
    deviation: f64,
    control: &Control,
) -> Result<Array2<T>> {
    let radius = (DEVIATIONS as f64 * deviation) as usize;
    let taps: Vec<T> = gaussian_taps(deviation, radius).into_iter().map(T::of).collect();
    let volume = picture.view().insert_axis(Axis(0));
    let all = [&[T::one()][..], &taps, &taps];
    Ok(correlate_separable(volume, all, Border::Replicate, control)?.remove_axis(Axis(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detail(picture: &Array2<f64>, sigma: f64) -> Array2<f64> {
        local_detail(&picture.view(), sigma, &Control::new()).unwrap()
    }

    #[test]
    fn grows_with_the_square_of_contrast_and_not_with_brightness() {
        let image = Array2::from_shape_fn((40, 50), |(y, x)| ((y * y + 3 * x) as f64 * 0.13).sin());
        let (c, scaled) = (detail(&image, 0.0), detail(&(&image * 3.0 + 10.0), 0.0));
        // Rounding of sums around 10 before differences of order 1e-2 are squared.
        assert!(c.iter().zip(&scaled).all(|(c, s)| (s - 9.0 * c).abs() < 1e-10 + 1e-10 * c));
        assert!(detail(&image, 100.0).iter().all(|&c| c == 0.0));
        assert!(detail(&Array2::from_elem((3, 1), 5.0), 0.0).iter().all(|&c| c == 0.0));
    }

    #[test]
    fn is_local() {
        let mut image = Array2::zeros((60, 60));
        image[(30, 30)] = f64::NAN;
        for ((y, x), c) in detail(&image, 0.0).indexed_iter() {
            let near = y.abs_diff(30) <= DETAIL_REACH && x.abs_diff(30) <= DETAIL_REACH;
            assert!(near || *c == 0.0);
        }
    }
}
