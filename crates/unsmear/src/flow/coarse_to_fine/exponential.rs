//! `exp(-x)` for vectors: the system's own is called sample by sample.
//!
//! ```text
//! n = round(x/ln 2),   r = x - n ln 2 in [-0.35, 0.35],   exp(-x) = 2^-n sum_k (-r)^k/k!,  k = 0..7
//! ```
//!
//! with `ln 2` in two parts, the first of which times `n` is exact. Relative error below 3e-7 for x in
//! [0, 87]; 0 beyond, NaN for NaN.

/// ln 2 to 9 bits, and the rest.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
/// Beyond this the result is below the normal numbers.
const LARGEST: f32 = 87.0;
/// Adding it leaves no bits for fractions.
const ROUND: f32 = 12_582_912.0;

/// `exp(-x)`, x >= 0.
#[inline(always)]
pub(super) fn falling(x: f32) -> f32 {
    let within = if x < LARGEST { x } else { LARGEST };
    let n = (within * std::f32::consts::LOG2_E + ROUND) - ROUND;
    let r = (n * LN_2[0] - within) + n * LN_2[1];
    let mut sum = 1.0 / 5040.0;
    for factorial in [720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0] {
        sum = sum * r + 1.0 / factorial;
    }
    let power = f32::from_bits(((127 - n as i32) as u32) << 23);
    let value = sum * power;
    let value = if x > LARGEST { 0.0 } else { value };
    if x.is_nan() { x } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential() {
        assert_eq!(falling(0.0), 1.0);
        for i in 0..87_000 {
            let x = i as f32 * 1e-3;
            let exact = (-f64::from(x)).exp();
            // Eight roundings of sums below 1.5 and the series' 5e-9.
            assert!((f64::from(falling(x)) / exact - 1.0).abs() < 3e-7, "{x}");
        }
        assert_eq!((falling(88.0), falling(f32::INFINITY)), (0.0, 0.0));
        assert!(falling(f32::NAN).is_nan());
    }
}
