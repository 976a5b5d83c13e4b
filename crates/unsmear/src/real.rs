//! The scalar types the kernels are written for: `f32` for work, `f64` for proofs.

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
}

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
}
