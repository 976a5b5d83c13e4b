//! Responses of a planned bank: the shared passes along x, then along y.
//!
//! With `A + iB` the picture filtered along x and `C + iS` the taps along y, a filter and its mirror
//! are `R = (AC - BS) + i (AS + BC)` and `(AC + BS) + i (AS - BC)`; see [`super`]. Memory is the
//! caller's where speed asks for it: nothing of what it held before shows.

use ndarray::ArrayView2;

use super::responses::Responses;
use super::{GaborBank, MirrorPair};
use crate::array::{for_each_row, for_each_row_with};
use crate::border::Border;
use crate::control::Control;
use crate::convolve::pad_row;
use crate::error::{Error, Result};
use crate::even_odd::{difference, even_odd_sums, sum};
use crate::real::Real;

impl<T: Real> GaborBank<T> {
    /// Responses of all filters to a picture (H, W).
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn respond(
        &self,
        picture: ArrayView2<'_, T>,
        border: Border,
        control: &Control,
    ) -> Result<Responses<T>> {
        let (height, width) = picture.dim();
        let mut responses = Responses::zeros(self.wavevectors.len(), height, width);
        self.respond_into(picture, border, &mut responses, &mut Vec::new(), control)?;
        Ok(responses)
    }

    /// Like [`GaborBank::respond`], into `responses` of the bank's number of filters and the picture's size, with
    /// `scratch` of any size, which afterwards has the size it needs.
    ///
    /// # Errors
    /// [`Error::Shape`] for responses of another shape,
    /// [`Error::Cancelled`].
    pub fn respond_into(
        &self,
        picture: ArrayView2<'_, T>,
        border: Border,
        responses: &mut Responses<T>,
        scratch: &mut Vec<T>,
        control: &Control,
    ) -> Result<()> {
        let (height, width) = picture.dim();
        let (filters, rows, columns) = responses.dim();
        if (filters, rows, columns) != (self.wavevectors.len(), height, width) {
            let expected = format!("({}, {height}, {width})", self.wavevectors.len());
            return Err(Error::shape("responses", expected, &[filters, rows, columns]));
        }
        if picture.is_empty() {
            return Ok(());
        }
        self.filter_rows(picture, border, scratch, control)?;
        let filtered = &*scratch;
        for_each_row_with(
            responses.packed_mut(),
            2 * filters * width,
            control,
            // The last row stays 0: what a zero border reads.
            || vec![T::zero(); 5 * width],
            |y, out, scratch| {
                for pair in &self.pairs {
                    self.filter_column(pair, filtered, [y, height, width], border, scratch, out);
                }
            },
        )
    }

    /// The picture filtered along x: per row, an even and an odd line for each set of taps.
    fn filter_rows(
        &self,
        picture: ArrayView2<'_, T>,
        border: Border,
        filtered: &mut Vec<T>,
        control: &Control,
    ) -> Result<()> {
        let picture = picture.as_standard_layout();
        let (height, width) = picture.dim();
        let packed = picture.as_slice().unwrap_or_default();
        let lines = 2 * self.along_x.len();
        filtered.resize(height * lines * width, T::zero());
        for_each_row(filtered, lines * width, control, |y, out| {
            let mut padded = vec![T::zero(); width + 2 * self.radius];
            pad_row(&packed[y * width..(y + 1) * width], self.radius, border, &mut padded);
            let shifted: Vec<&[T]> = (0..=2 * self.radius).map(|j| &padded[j..j + width]).collect();
            for (taps, out) in self.along_x.iter().zip(out.chunks_mut(2 * width)) {
                let (even, odd) = out.split_at_mut(width);
                even_odd_sums(&shifted, &taps.even, &taps.odd, even, odd);
            }
        })
    }

    /// One row of the responses of a pair of mirrored filters.
    fn filter_column(
        &self,
        pair: &MirrorPair<T>,
        filtered: &[T],
        [y, height, width]: [usize; 3],
        border: Border,
        scratch: &mut [T],
        out: &mut [T],
    ) {
        let stride = 2 * self.along_x.len() * width;
        let (scratch, zeros) = scratch.split_at_mut(4 * width);
        let zeros = &*zeros;
        let line = |j: usize, part: usize| {
            border.index((y + j) as isize - self.radius as isize, height).map_or(zeros, |row| {
                let start = row * stride + (2 * pair.along_x + part) * width;
                &filtered[start..start + width]
            })
        };
        let lines = |part| (0..=2 * self.radius).map(|j| line(j, part)).collect::<Vec<&[T]>>();
        let (first, second) = scratch.split_at_mut(2 * width);
        let (ac, sa) = first.split_at_mut(width);
        let (bc, sb) = second.split_at_mut(width);
        let taps = &pair.along_y;
        even_odd_sums(&lines(0), &taps.even, &taps.odd, ac, sa);
        if self.along_x[pair.along_x].real {
            bc.fill(T::zero());
            sb.fill(T::zero());
        } else {
            even_odd_sums(&lines(1), &taps.even, &taps.odd, bc, sb);
        }
        let plane = |filter: usize| 2 * filter * width..(2 * filter + 2) * width;
        let (re, im) = out[plane(pair.filter)].split_at_mut(width);
        difference(ac, sb, re);
        sum(sa, bc, im);
        if let Some(mirror) = pair.mirror {
            let (re, im) = out[plane(mirror)].split_at_mut(width);
            sum(ac, sb, re);
            difference(sa, bc, im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gabor::GaborParameters;
    use ndarray::Array2;

    #[test]
    fn dirty_memory_does_not_show() {
        let bank = GaborBank::<f64>::new(&GaborParameters::default()).unwrap();
        let picture = Array2::from_shape_fn((9, 12), |(y, x)| ((3 * x + y * y) % 7) as f64);
        let respond = |picture: &Array2<f64>| {
            bank.respond(picture.view(), Border::Replicate, &Control::new()).unwrap()
        };
        let mut responses = respond(&picture.mapv(|s| 1e3 - s));
        let mut scratch = vec![f64::NAN; 77];
        bank.respond_into(
            picture.view(),
            Border::Replicate,
            &mut responses,
            &mut scratch,
            &Control::new(),
        )
        .unwrap();
        assert_eq!(responses.into_array(), respond(&picture).into_array());
    }
}
