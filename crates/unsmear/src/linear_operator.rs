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
