//! What a known motion does to a sharp picture: the mean along each pixel's streamline during the exposure.
//!
//! ```text
//! b(p) = 1/e integral_{-e/2}^{e/2} x(X_p(t)) dt,        dX_p/dt = v(X_p),  X_p(0) = p
//! ```
//!
//! v is the flow in px/frame taken as a steady field of velocity, e the exposure as a fraction of the frame interval,
//! t = 0 its middle. (The content now at p was at `X_p(-t)` and will be at `X_p(t)`; by symmetry of the exposure the sign
//! does not matter.) x is interpolated by the cubic spline of `local_spline.rs`, continued by its edge pixels, and the
//! integral is Simpson's rule with at least two intervals per px of blur, whose relative error at w rad/px along the
//! path is `(w/2)^4 / 180`: 0.04 % at w = 1. Pixels without motion, or of unknown (NaN) motion, are copied.
//!
//! A constant stays constant; the operator is linear in x. Same convention as J. Bardsley et al., "Blind iterative
//! restoration of images with spatially-varying blur", Opt. Express 14 (2006) 1767-1782,
//! [10.1364/OE.14.001767](https://doi.org/10.1364/OE.14.001767), section 2: gather, not scatter.

use multiversion::multiversion;
use ndarray::{Array2, ArrayView2};

use crate::array::{for_each_row, require_same};
use crate::control::Control;
use crate::error::{Error, Result, require};
use crate::flow_field::FlowView;
use crate::local_spline::{LocalSpline, Path};
use crate::psf::LONGEST_MOTION;
use crate::real::Real;
use crate::streamline::Streamlines;

/// Blurs `image` by `flow` (px/frame) during `exposure` (fraction of the frame interval, > 0).
///
/// # Errors
/// [`Error::Shape`] when the shapes differ or are empty; [`Error::Value`] for an exposure that is not positive, or
/// blur longer than [`LONGEST_MOTION`]; [`Error::Cancelled`].
pub fn blur<T: Real>(
    image: &ArrayView2<'_, T>,
    flow: &FlowView<'_, T>,
    exposure: f64,
    control: &Control,
) -> Result<Array2<T>> {
    require("exposure", exposure, "finite and positive", |e| e > 0.0)?;
    if image.is_empty() {
        return Err(Error::shape("image", "(H >= 1, W >= 1)", image.shape()));
    }
    require_same("flow", &flow.u, image.dim())?;
    for (&u, &v) in flow.u.iter().zip(flow.v.iter()) {
        let length = exposure * u.as_f64().hypot(v.as_f64());
        if length > LONGEST_MOTION {
            let expected = "at most 4096 px long within the exposure (or NaN for unknown)";
            return Err(Error::value("flow", expected, length));
        }
    }
    let spline = LocalSpline::new(image, control)?;
    let lines = Streamlines::new(flow);
    let (height, width) = image.dim();
    let mut out: Vec<T> = image.iter().copied().collect();
    control.expect(height);
    for_each_row(&mut out, width, control, |y, row| {
        blur_row(&spline, &lines, exposure, y, row);
        // A cancelled run is noticed by the helper before its next row.
        let _ = control.advance();
    })?;
    Array2::from_shape_vec((height, width), out)
        .map_err(|_| Error::shape("image", "(H, W)", image.shape()))
}

/// Replaces the pixels of row `y` that move.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn blur_row<T: Real>(
    spline: &LocalSpline<T>,
    lines: &Streamlines<T>,
    exposure: f64,
    y: usize,
    row: &mut [T],
) {
    let (mut path, mut weights) = (Path::new(0), Vec::new());
    for (x, sample) in row.iter_mut().enumerate() {
        let motion = lines.motion(y, x);
        let speed = (motion[0] * motion[0] + motion[1] * motion[1]).sqrt();
        let length = exposure * speed.as_f64();
        if !(length > 0.0 && length.is_finite()) {
            continue;
        }
        // Strides of at most a pixel on either side of the middle, each of two intervals.
        let strides = (0.5 * length).ceil() as usize;
        let time = T::of(0.5 * exposure / strides as f64);
        path.clear();
        let mut ahead = lines.start(y, x, motion, speed);
        let mut behind = ahead;
        for _ in 0..strides {
            lines.stride(&mut ahead, time);
            lines.stride(&mut behind, -time);
            for point in [ahead.halfway, behind.halfway, ahead.offset, behind.offset] {
                path.push(point);
            }
        }
        path.prepare();
        // Simpson's weights 2 | 4, 2, 4, 2 ... 4, 1 from the middle to either end, over their sum.
        let unit = T::of(1.0 / (12 * strides) as f64);
        weights.clear();
        weights.extend((0..strides).flat_map(|_| [T::of(4.0) * unit, T::of(2.0) * unit]));
        weights[2 * strides - 1] = unit;
        *sample = T::of(2.0) * unit * *sample + spline.weighted_sum(y, x, &path, &weights);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;

    fn uniform(shape: (usize, usize), u: f64, v: f64) -> FlowField<f64> {
        FlowField::new(Array2::from_elem(shape, u), Array2::from_elem(shape, v)).unwrap()
    }

    #[test]
    fn a_wave_is_damped_by_the_transform_of_the_box() {
        let (u, v) = (5.0, -3.0);
        let (wx, wy) = (0.4, 0.3);
        let wave = Array2::from_shape_fn((60, 70), |(y, x)| (wx * x as f64 + wy * y as f64).cos());
        let out =
            blur(&wave.view(), &uniform((60, 70), u, v).view(), 0.8, &Control::new()).unwrap();
        let half: f64 = 0.5 * 0.8 * (wx * u + wy * v);
        let gain = half.sin() / half;
        for y in 20..40 {
            for x in 20..50 {
                // Cubic splines err by about w^4 / 1000 at |w| = 0.5; Simpson's rule by less.
                assert!((out[(y, x)] - gain * wave[(y, x)]).abs() < 2e-4);
            }
        }
    }

    #[test]
    fn stillness_copies_and_constants_stay() {
        let image = Array2::from_shape_fn((12, 9), |(y, x)| ((y * 5 + x * 3) % 7) as f64 / 3.0);
        for motion in [0.0, f64::NAN] {
            let flow = uniform((12, 9), motion, motion);
            assert_eq!(blur(&image.view(), &flow.view(), 1.0, &Control::new()).unwrap(), image);
        }
        let flat = Array2::from_elem((12, 9), 0.7);
        let out = blur(&flat.view(), &uniform((12, 9), 6.0, 2.5).view(), 1.0, &Control::new());
        // Some hundred roundings of weights that sum to 1.
        assert!(out.unwrap().iter().all(|s| (s - 0.7f64).abs() < 1e-13));
    }

    #[test]
    fn impossible_requests_are_refused() {
        let image = Array2::<f64>::zeros((4, 5));
        let refuse = |flow: &FlowField<f64>, exposure| {
            blur(&image.view(), &flow.view(), exposure, &Control::new()).unwrap_err().to_string()
        };
        assert!(refuse(&uniform((4, 5), 1.0, 0.0), 0.0).starts_with("exposure must"));
        assert!(refuse(&uniform((4, 5), 1e9, 0.0), 1.0).starts_with("flow must"));
        assert!(refuse(&uniform((5, 4), 1.0, 0.0), 1.0).starts_with("flow must have shape"));
    }
}
