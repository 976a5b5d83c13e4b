//! A linear blur as the solvers see it: the map from a sharp picture to data, and its transpose.
//!
//! ```text
//! b = A x,      x' = A^T r,      <A x, r> = <x, A^T r>
//! ```
//!
//! The unknown x lives on a grid that is larger than the data by [`LinearOperator::pad`] pixels on
//! every side: what moved in from beyond the edge is unknown too, and inventing it (zeros, a mirror,
//! the repeated edge) puts rings into the picture. Data pixel (r, c) lies at (r + pad, c + pad) of x.
//!
//! Validity: finite x and r; a sample that is not finite spoils an unspecified neighbourhood.
//! Implementations give the same bytes for any number of threads.
//! Reference: M. S. C. Almeida, M. A. T. Figueiredo, "Deconvolving images with unknown boundaries
//! using the alternating direction method of multipliers", IEEE Trans. Image Process. 22 (2013)
//! 3074-3086, [10.1109/TIP.2013.2258354](https://doi.org/10.1109/TIP.2013.2258354).

/// A linear map from the unknown sharp picture to the blurred data, and its exact transpose.
///
/// All pictures are packed in rows.
pub trait LinearOperator: Sync {
    /// Rows and columns of x, padding included.
    fn unknown_shape(&self) -> (usize, usize);

    /// Rows and columns of b.
    fn data_shape(&self) -> (usize, usize);

    /// Pixels of x on each side beyond the data.
    fn pad(&self) -> usize;

    /// Writes A x to `b`.
    ///
    /// # Panics
    /// When a slice has not the length of its shape.
    fn apply(&self, x: &[f32], b: &mut [f32]);

    /// Writes A^T r to `x`.
    ///
    /// # Panics
    /// When a slice has not the length of its shape.
    fn adjoint(&self, r: &[f32], x: &mut [f32]);

    /// Writes b = A x and A^T (`weights` b) to `out`: what a step of conjugate gradients needs of a weighted least
    /// squares problem. Implementations may do both at less than the price of either after the other.
    ///
    /// # Panics
    /// When a slice has not the length of its shape.
    fn normal(&self, x: &[f32], weights: &[f32], b: &mut [f32], out: &mut [f32]) {
        self.apply(x, b);
        let weighted: Vec<f32> = b.iter().zip(weights).map(|(b, weight)| b * weight).collect();
        self.adjoint(&weighted, out);
    }
}

/// What the tests of all operators need.
#[cfg(test)]
pub(crate) mod trials {
    use super::LinearOperator;

    /// Numbers in [-1, 1).
    pub(crate) fn noise(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed;
        let step = |_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        (0..count).map(step).collect()
    }

    pub(crate) fn dot(a: &[f32], b: &[f32]) -> f64 {
        a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
    }

    /// `|<A x, r> - <x, A^T r>|` over `|A x| |r|` (the sums themselves may cancel), x and r noise.
    pub(crate) fn asymmetry(operator: &dyn LinearOperator) -> f64 {
        let count = |(rows, columns): (usize, usize)| rows * columns;
        let x = noise(count(operator.unknown_shape()), 2);
        let r = noise(count(operator.data_shape()), 3);
        // Nothing that was there may stay.
        let (mut b, mut back) = (vec![f32::NAN; r.len()], vec![f32::NAN; x.len()]);
        operator.apply(&x, &mut b);
        operator.adjoint(&r, &mut back);
        (dot(&b, &r) - dot(&x, &back)).abs() / (dot(&b, &b) * dot(&r, &r)).sqrt()
    }
}
