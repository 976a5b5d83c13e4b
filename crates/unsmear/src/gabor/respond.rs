//! Responses of a planned bank to a whole picture, in bands of rows side by side.

use ndarray::ArrayView2;

use super::GaborBank;
use super::responses::Responses;
use super::stream::{FEWEST_ROWS, ResponseRows};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::real::Real;
use crate::tasks::{cut, for_each_task, runs};

impl<T: Real> GaborBank<T> {
    /// Responses of all filters to a picture (H, W).
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn respond(
        &self,
        picture: ArrayView2<'_, T>,
        border: Border,
        control: &Control,
    ) -> Result<Responses<T>> {
        let (height, width) = picture.dim();
        let filters = self.wavevectors.len();
        let mut responses = Responses::zeros(filters, height, width);
        if picture.is_empty() {
            return Ok(responses);
        }
        let picture = picture.as_standard_layout();
        let packed = picture.as_slice().unwrap_or_default();
        let row = 2 * filters * width;
        let runs = runs(height, FEWEST_ROWS..=usize::MAX);
        let bands = cut(responses.packed_mut(), row, &runs);
        for_each_task(bands, runs.len(), |(first, out)| {
            let mut rows = ResponseRows::new(self, packed, width, border, first);
            for (i, out) in out.chunks_exact_mut(row).enumerate() {
                control.check()?;
                rows.respond(first + i, out);
            }
            Ok(())
        })?;
        Ok(responses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gabor::GaborParameters;
    use ndarray::{Array2, Axis};

    /// A band starts anywhere: its first rows are those of the whole.
    #[test]
    fn rows_do_not_depend_on_where_a_band_starts() {
        let bank = GaborBank::<f64>::new(&GaborParameters::default()).unwrap();
        let picture = Array2::from_shape_fn((41, 12), |(y, x)| ((3 * x + y * y) % 7) as f64);
        for border in [Border::Replicate, Border::Reflect, Border::Zero] {
            let whole = bank.respond(picture.view(), border, &Control::new()).unwrap();
            for first in [0, 1, 5, 20, 40] {
                let packed = picture.as_slice().unwrap();
                let mut rows = ResponseRows::new(&bank, packed, 12, border, first);
                let mut out = vec![f64::NAN; 6 * 2 * 12];
                for y in first..41 {
                    rows.respond(y, &mut out);
                    for filter in 0..6 {
                        let (re, im) = whole.row(filter, y);
                        assert_eq!(out[2 * filter * 12..][..12], *re);
                        assert_eq!(out[(2 * filter + 1) * 12..][..12], *im);
                    }
                }
            }
        }
    }

    #[test]
    fn any_number_of_rows_and_threads() {
        let bank = GaborBank::<f32>::new(&GaborParameters::default()).unwrap();
        let picture = Array2::from_shape_fn((77, 30), |(y, x)| ((5 * x + y * y) % 11) as f32);
        let respond = |picture: ArrayView2<'_, f32>| {
            bank.respond(picture, Border::Reflect, &Control::new()).unwrap().into_array()
        };
        for height in [1, 2, 3, 31, 33, 77] {
            let part = picture.slice_axis(Axis(0), (0..height).into());
            let one = respond(part);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
            assert_eq!(pool.install(|| respond(part)), one);
        }
    }
}
