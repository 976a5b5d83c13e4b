//! A field of motion: `u` to the right, `v` downwards, in pixels per frame; NaN where nothing is known.

use ndarray::{Array2, ArrayView2};

use crate::error::{Error, Result};
use crate::real::Real;

/// Motion of every pixel from one frame to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowField<T> {
    /// Motion to the right, shape (H, W), px/frame; NaN = unknown.
    pub u: Array2<T>,
    /// Motion downwards, shape (H, W), px/frame; NaN = unknown.
    pub v: Array2<T>,
}

impl<T: Real> FlowField<T> {
    /// A field from its two components.
    ///
    /// # Errors
    /// [`Error::Shape`] when the shapes differ.
    pub fn new(u: Array2<T>, v: Array2<T>) -> Result<Self> {
        if u.dim() != v.dim() {
            return Err(Error::shape("v", format!("{:?}", u.shape()), v.shape()));
        }
        Ok(Self { u, v })
    }

    /// The field that knows nothing.
    #[must_use]
    pub fn unknown(shape: (usize, usize)) -> Self {
        Self { u: Array2::from_elem(shape, T::nan()), v: Array2::from_elem(shape, T::nan()) }
    }

    /// Shape (H, W).
    #[must_use]
    pub fn dim(&self) -> (usize, usize) {
        self.u.dim()
    }

    /// Both components as views.
    #[must_use]
    pub fn view(&self) -> FlowView<'_, T> {
        FlowView { u: self.u.view(), v: self.v.view() }
    }
}

/// A borrowed [`FlowField`].
#[derive(Debug, Clone, Copy)]
pub struct FlowView<'a, T> {
    /// Motion to the right; see [`FlowField::u`].
    pub u: ArrayView2<'a, T>,
    /// Motion downwards; see [`FlowField::v`].
    pub v: ArrayView2<'a, T>,
}

impl<'a, T: Real> FlowView<'a, T> {
    /// A view from two components.
    ///
    /// # Errors
    /// [`Error::Shape`] when the shapes differ.
    pub fn new(u: ArrayView2<'a, T>, v: ArrayView2<'a, T>) -> Result<Self> {
        if u.dim() != v.dim() {
            return Err(Error::shape("v", format!("{:?}", u.shape()), v.shape()));
        }
        Ok(Self { u, v })
    }

    /// Shape (H, W).
    #[must_use]
    pub fn dim(&self) -> (usize, usize) {
        self.u.dim()
    }

    /// Motion of pixel (row, column); NaN when either component is unknown.
    #[inline]
    #[must_use]
    pub fn at(&self, row: usize, column: usize) -> [T; 2] {
        [self.u[(row, column)], self.v[(row, column)]]
    }
}
