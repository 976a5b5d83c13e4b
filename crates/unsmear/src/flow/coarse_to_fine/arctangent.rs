//! The angle of a complex number, in arithmetic that compilers vectorise.
//!
//! With `m = min(|x|, |y|)/max(|x|, |y|)` in [0, 1] the angle within the first octant is the odd
//! polynomial
//!
//! ```text
//! atan m = m (c_0 + c_1 m^2 + ... + c_5 m^10),
//! ```
//!
//! fitted for least greatest error (2e-6 rad) and reflected into the other seven octants. Exactly 0
//! for `y = 0 <= x`, and for the origin. The library's `atan2` is exact to the last bit and twenty
//! times slower, which nothing here can use: phase differences carry the noise of the picture.

use std::f32::consts::{FRAC_PI_2, PI};

/// Coefficients of the least-maximum fit on [0, 1], lowest power first.
const COEFFICIENTS: [f32; 6] =
    [0.99997735, -0.332_624_4, 0.193_542_69, -0.116_417_62, 0.052_626_595, -0.011_708_041];

/// `atan2(y, x)`, rad in [-pi, pi]; error below 3e-6 rad.
#[inline(always)]
pub(super) fn arctangent(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay > ax;
    let (low, high) = if steep { (ax, ay) } else { (ay, ax) };
    // The floor makes 0/0 a 0.
    let m = low / if high > f32::MIN_POSITIVE { high } else { f32::MIN_POSITIVE };
    let s = m * m;
    let [a, b, c, d, e, f] = COEFFICIENTS;
    let octant = m * (a + s * (b + s * (c + s * (d + s * (e + s * f)))));
    let quadrant = if steep { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    if y < 0.0 { -half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_all_around() {
        for i in 0..100_000 {
            let angle = f64::from(i) * 1e-3 - 50.0;
            let radius = (angle * 0.37).exp();
            let (y, x) = ((radius * angle.sin()) as f32, (radius * angle.cos()) as f32);
            assert!((arctangent(y, x) - y.atan2(x)).abs() < 3e-6, "{y} {x}");
        }
    }

    #[test]
    fn no_motion_is_exactly_no_phase() {
        assert_eq!(arctangent(0.0, 5.0), 0.0);
        assert_eq!(arctangent(0.0, 0.0), 0.0);
        assert_eq!(arctangent(-0.0, 0.0), 0.0);
    }
}
