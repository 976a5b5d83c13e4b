//! Complex responses of a bank of filters to one picture.

use ndarray::Array4;

use crate::real::Real;

/// Complex responses of `N` filters to a picture (H, W), the rows of all filters side by side so
/// that a row of work touches one stretch of memory.
#[derive(Debug, Clone)]
pub struct Responses<T> {
    data: Vec<T>,
    filters: usize,
    height: usize,
    width: usize,
}

impl<T: Real> Responses<T> {
    /// All responses 0.
    #[must_use]
    pub fn zeros(filters: usize, height: usize, width: usize) -> Self {
        Self { data: vec![T::zero(); 2 * filters * height * width], filters, height, width }
    }

    /// All samples, (H, N, 2, W): real and imaginary rows of each filter.
    pub(crate) fn packed_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// (N, H, W).
    #[must_use]
    pub fn dim(&self) -> (usize, usize, usize) {
        (self.filters, self.height, self.width)
    }

    /// Real and imaginary parts of all responses, (2, N, H, W), nothing copied: in memory the rows
    /// of all filters lie side by side, (H, N, 2, W).
    #[must_use]
    pub fn into_array(self) -> Array4<T> {
        let shape = (self.height, self.filters, 2, self.width);
        Array4::from_shape_vec(shape, self.data).unwrap_or_default().permuted_axes([2, 1, 0, 3])
    }

    /// Real and imaginary parts of row `y` of filter `filter`.
    #[inline]
    #[must_use]
    pub fn row(&self, filter: usize, y: usize) -> (&[T], &[T]) {
        let start = (y * self.filters + filter) * 2 * self.width;
        self.data[start..start + 2 * self.width].split_at(self.width)
    }

    /// Like [`Responses::row`], to write.
    #[inline]
    #[must_use]
    pub fn row_mut(&mut self, filter: usize, y: usize) -> (&mut [T], &mut [T]) {
        let start = (y * self.filters + filter) * 2 * self.width;
        self.data[start..start + 2 * self.width].split_at_mut(self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_apart_and_in_their_place() {
        let mut responses = Responses::<f32>::zeros(2, 3, 4);
        let (re, im) = responses.row_mut(1, 2);
        (re[3], im[0]) = (5.0, -6.0);
        assert_eq!(responses.row(1, 2), (&[0.0, 0.0, 0.0, 5.0][..], &[-6.0, 0.0, 0.0, 0.0][..]));
        assert_eq!(responses.packed_mut().iter().filter(|&&s| s != 0.0).count(), 2);
        assert_eq!(responses.dim(), (2, 3, 4));
    }

    #[test]
    fn as_an_array_every_sample_keeps_its_place() {
        let mut responses = Responses::<f32>::zeros(3, 4, 5);
        responses.row_mut(2, 1).1[4] = 7.0;
        let array = responses.into_array();
        assert_eq!((array.shape(), array[(1, 2, 1, 4)]), (&[2, 3, 4, 5][..], 7.0));
        assert_eq!(array.sum(), 7.0);
    }
}
