//! The scalar types the kernels are written for: `f32` for work, `f64` for proofs.

use std::f32::consts::{FRAC_PI_2, PI};

use ndarray::NdFloat;

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32` or `f64`. Sealed: kernels are tuned and tested for these two only.
pub trait Real: NdFloat + Default + sealed::Sealed {
    /// The nearest value of this type; parameters are computed in `f64` and rounded once, here.
    fn of(value: f64) -> Self;
    /// This value as `f64`, exactly.
    fn as_f64(self) -> f64;
    /// Rounded towards 0 to an index or offset; beyond the range of `i32`, its nearest end; 0 for NaN. A single
    /// conversion, unlike the way through `f64`.
    fn as_i32(self) -> i32;
    /// Angle of `re + i im`, rad in [-pi, pi], NaN for NaN, 0 for 0; `im = 0, re > 0` gives exactly
    /// 0. In `f32` a polynomial that the compiler vectorises, off by at most 4e-7 rad; in `f64` the
    /// system's own.
    fn angle(im: Self, re: Self) -> Self;
}

/// `atan(t) / t = sum_n ARCTANGENT[n] t^2n` for 0 <= t <= 1: our own fit of least largest error, 4e-8
/// rad before rounding.
const ARCTANGENT: [f32; 8] = [
    0.999_999_34,
    -0.333_298_6,
    0.199_465_66,
    -0.139_086_3,
    0.096_421_95,
    -0.055_912_316,
    0.021_862_95,
    -0.004_054_565,
];

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
    fn as_i32(self) -> i32 {
        self as i32
    }
    #[inline(always)]
    fn angle(im: Self, re: Self) -> Self {
        let (x, y) = (re.abs(), im.abs());
        // By comparisons that keep a NaN, which `min` and `max` would lose.
        let steep = y > x;
        let (small, large) = if steep { (x, y) } else { (y, x) };
        let large = if large == 0.0 { 1.0 } else { large };
        let t = small / large;
        let square = t * t;
        let mut ratio = ARCTANGENT[7];
        for n in (0..7).rev() {
            ratio = ratio * square + ARCTANGENT[n];
        }
        let shallow = t * ratio;
        let quarter = if steep { FRAC_PI_2 - shallow } else { shallow };
        let half = if re < 0.0 { PI - quarter } else { quarter };
        half.copysign(im)
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn as_f64(self) -> f64 {
        self
    }
    fn as_i32(self) -> i32 {
        self as i32
    }
    fn angle(im: Self, re: Self) -> Self {
        im.atan2(re)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_angles_are_those_of_double() {
        for i in 0..20_000 {
            let angle = f64::from(i - 10_000) * 3.141_59e-4;
            let length = f64::from(1 + i % 97).powi(7);
            let (im, re) = ((length * angle.sin()) as f32, (length * angle.cos()) as f32);
            let expected = f64::angle(f64::from(im), f64::from(re));
            // The fit, and four roundings of values up to pi.
            assert!((f64::from(f32::angle(im, re)) - expected).abs() < 4e-7, "{angle}");
        }
    }

    #[test]
    fn axes_zero_and_unknown() {
        let exact: [(f32, f32); 5] = [(0.0, 2.0), (0.0, 0.0), (3.0, 0.0), (-3.0, 0.0), (0.0, -1.0)];
        for (im, re) in exact {
            assert_eq!(f32::angle(im, re), im.atan2(re), "{im}, {re}");
        }
        assert!(f32::angle(f32::NAN, 1.0).is_nan() && f32::angle(1.0, f32::NAN).is_nan());
    }
}
