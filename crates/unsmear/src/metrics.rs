//! How far an estimate is from the truth: maps for flow, single numbers for pictures.
//!
//! For an estimate `(u, v)` and a truth `(U, V)` in px/frame:
//!
//! | map | equation |
//! |---|---|
//! | angular error | angle between `(u, v, 1)` and `(U, V, 1)`, degrees (Barron, Fleet & Beauchemin 1994) |
//! | direction error | angle between `(u, v)` and `(U, V)`, degrees; undefined (NaN) where either is 0 |
//! | endpoint error | `hypot(u - U, v - V)`, px/frame |
//! | magnitude error | `|hypot(u, v) - hypot(U, V)|`, px/frame |
//!
//! A map is NaN wherever the estimate or the truth is. Angles come from
//! `atan2(|a x b|, a . b)`, which keeps full precision at small angles where `acos` loses half the
//! digits.
//!
//! `psnr = 10 log10(range^2 / mean (a - b)^2)` in dB; the structural similarity is that of Wang et
//! al. 2004 (doi 10.1109/TIP.2003.819861): an 11 x 11 Gaussian window of deviation 1.5,
//! `K1 = .01`, `K2 = .03`, population covariances, averaged over the windows that fit inside.

use ndarray::{Array2, ArrayView2, Axis, Zip};

use crate::array::require_same;
use crate::border::Border;
use crate::control::Control;
use crate::convolve::{correlate_separable, gaussian_taps};
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::real::Real;

/// Deviation of the similarity's Gaussian window, px (Wang et al. 2004).
const SSIM_SIGMA: f64 = 1.5;
/// Half width of that window, px: 11 x 11 in all.
const SSIM_RADIUS: usize = 5;
/// Stabilisers of the similarity's two ratios, relative to the range (Wang et al. 2004).
const SSIM_K: [f64; 2] = [0.01, 0.03];

/// Angle between `(u, v, 1)` and the truth's, degrees, shape (H, W); see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when the fields differ in shape.
pub fn angular_error<T: Real>(
    flow: FlowView<'_, T>,
    truth: FlowView<'_, T>,
) -> Result<Array2<f64>> {
    map(flow, truth, |[u, v], [tu, tv]| {
        let cross = ((v - tv).powi(2) + (tu - u).powi(2) + (u * tv - v * tu).powi(2)).sqrt();
        cross.atan2(u * tu + v * tv + 1.0).to_degrees()
    })
}

/// Angle between `(u, v)` and the truth's, degrees, shape (H, W); see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when the fields differ in shape.
pub fn direction_error<T: Real>(
    flow: FlowView<'_, T>,
    truth: FlowView<'_, T>,
) -> Result<Array2<f64>> {
    map(flow, truth, |[u, v], [tu, tv]| {
        if (u == 0.0 && v == 0.0) || (tu == 0.0 && tv == 0.0) {
            return f64::NAN;
        }
        (u * tv - v * tu).abs().atan2(u * tu + v * tv).to_degrees()
    })
}

/// Distance between the end points, px/frame, shape (H, W); see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when the fields differ in shape.
pub fn endpoint_error<T: Real>(
    flow: FlowView<'_, T>,
    truth: FlowView<'_, T>,
) -> Result<Array2<f64>> {
    map(flow, truth, |[u, v], [tu, tv]| (u - tu).hypot(v - tv))
}

/// Difference of the speeds, px/frame, shape (H, W); see the [module](self).
///
/// # Errors
/// [`Error::Shape`] when the fields differ in shape.
pub fn magnitude_error<T: Real>(
    flow: FlowView<'_, T>,
    truth: FlowView<'_, T>,
) -> Result<Array2<f64>> {
    map(flow, truth, |[u, v], [tu, tv]| (u.hypot(v) - tu.hypot(tv)).abs())
}

fn map<T: Real>(
    flow: FlowView<'_, T>,
    truth: FlowView<'_, T>,
    error: impl Fn([f64; 2], [f64; 2]) -> f64,
) -> Result<Array2<f64>> {
    require_same("truth", &truth.u, flow.dim())?;
    Ok(Array2::from_shape_fn(flow.dim(), |(y, x)| {
        let [estimate, truth] = [flow.at(y, x), truth.at(y, x)].map(|c| c.map(T::as_f64));
        if estimate.iter().chain(&truth).any(|c| c.is_nan()) {
            return f64::NAN;
        }
        error(estimate, truth)
    }))
}

/// Peak signal-to-noise ratio, dB; infinite for equal pictures, NaN when a pixel of either is NaN.
///
/// # Errors
/// [`Error::Shape`] when the pictures differ in shape or are empty, [`Error::Value`] when
/// `data_range` (the distance from black to white) is not positive.
pub fn psnr(a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>, data_range: f64) -> Result<f64> {
    check_pair(&a, &b, data_range, 1)?;
    let sum = Zip::from(&a).and(&b).fold(0.0, |sum, a, b| sum + (a - b).powi(2));
    Ok(10.0 * (data_range.powi(2) * a.len() as f64 / sum).log10())
}

/// Mean structural similarity, at most 1; NaN when a pixel of either picture is NaN.
///
/// # Errors
/// As [`psnr`], with a least size of 11 x 11.
pub fn ssim(a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>, data_range: f64) -> Result<f64> {
    check_pair(&a, &b, data_range, 2 * SSIM_RADIUS + 1)?;
    let [mean_a, mean_b] = [local_mean(&a.to_owned())?, local_mean(&b.to_owned())?];
    let var_a = local_mean(&(&a * &a))? - &mean_a * &mean_a;
    let var_b = local_mean(&(&b * &b))? - &mean_b * &mean_b;
    let covariance = local_mean(&(&a * &b))? - &mean_a * &mean_b;
    let [c1, c2] = SSIM_K.map(|k| (k * data_range).powi(2));
    let luminance = (2.0 * &mean_a * &mean_b + c1) / (&mean_a * &mean_a + &mean_b * &mean_b + c1);
    let structure = (2.0 * covariance + c2) / (var_a + var_b + c2);
    Ok((luminance * structure).mean().unwrap_or(f64::NAN))
}

/// Gaussian-weighted mean over each window that lies inside the picture.
fn local_mean(picture: &Array2<f64>) -> Result<Array2<f64>> {
    let taps = gaussian_taps(SSIM_SIGMA, SSIM_RADIUS);
    let volume = picture.view().insert_axis(Axis(0));
    let mean =
        correlate_separable(volume, [&[1.0], &taps, &taps], Border::Replicate, &Control::new())?;
    let r = SSIM_RADIUS as isize;
    Ok(mean.index_axis_move(Axis(0), 0).slice_move(ndarray::s![r..-r, r..-r]))
}

fn check_pair(
    a: &ArrayView2<'_, f64>,
    b: &ArrayView2<'_, f64>,
    data_range: f64,
    least: usize,
) -> Result<()> {
    let (height, width) = a.dim();
    if height < least || width < least {
        return Err(Error::shape("a", format!("(H >= {least}, W >= {least})"), a.shape()));
    }
    require_same("b", b, a.dim())?;
    require("data_range", data_range, "> 0", |r| r > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;

    fn field(u: f64, v: f64) -> FlowField<f64> {
        FlowField::new(Array2::from_elem((2, 3), u), Array2::from_elem((2, 3), v)).unwrap()
    }

    fn all(map: &Array2<f64>, value: f64) -> bool {
        map.iter().all(|&e| (e - value).abs() < 1e-12)
    }

    #[test]
    fn errors_of_known_pairs() {
        let (a, b) = (field(3.0, 4.0), field(0.0, 0.0));
        let (a, b) = (a.view(), b.view());
        assert!(all(&endpoint_error(a, b).unwrap(), 5.0));
        assert!(all(&magnitude_error(a, b).unwrap(), 5.0));
        // tan of the angle between (3, 4, 1) and (0, 0, 1) is 5.
        assert!(all(&angular_error(a, b).unwrap(), 5f64.atan().to_degrees()));
        assert!(direction_error(a, b).unwrap().iter().all(|e| e.is_nan()), "no direction at rest");
        let (left, up) = (field(-2.0, 0.0), field(0.0, -1.0));
        assert!(all(&direction_error(left.view(), up.view()).unwrap(), 90.0));
        assert!(all(&direction_error(left.view(), field(1.0, 0.0).view()).unwrap(), 180.0));
    }

    #[test]
    fn small_angles_keep_their_digits() {
        let (a, b) = (field(1.0, 0.0), field(1.0, 1e-9));
        let error = angular_error(a.view(), b.view()).unwrap()[(0, 0)];
        let expected = (1e-9 / 2f64.sqrt()).to_degrees();
        assert!((error / expected - 1.0).abs() < 1e-9);
    }

    #[test]
    fn unknown_stays_unknown_and_shapes_must_agree() {
        let mut unknown = field(1.0, 1.0);
        unknown.v[(1, 2)] = f64::NAN;
        let map = endpoint_error(unknown.view(), field(1.0, 1.0).view()).unwrap();
        assert!(map[(1, 2)].is_nan() && map.iter().filter(|e| e.is_nan()).count() == 1);
        let small = FlowField::<f64>::unknown((1, 3));
        assert!(angular_error(small.view(), field(0.0, 0.0).view()).is_err());
    }

    #[test]
    fn picture_errors_of_known_pairs() {
        let a = Array2::from_shape_fn((16, 18), |(y, x)| (y * x % 7) as f64);
        assert!(psnr(a.view(), a.view(), 7.0).unwrap().is_infinite());
        let b = &a + 0.7;
        assert!((psnr(a.view(), b.view(), 7.0).unwrap() - 20.0).abs() < 1e-12);
        assert!((ssim(a.view(), a.view(), 7.0).unwrap() - 1.0).abs() < 1e-12);
        assert!(ssim(a.view(), b.view(), 7.0).unwrap() < 1.0);
        assert!(ssim(a.slice(ndarray::s![..10, ..]), b.slice(ndarray::s![..10, ..]), 7.0).is_err());
        assert!(psnr(a.view(), b.view(), 0.0).is_err());
    }
}
