//! Responses row by row, in rising order, without a plane of anything.
//!
//! A row of responses needs `2 r + 1` rows of the picture filtered along x, `r` the radius of the bank. Only these are
//! kept, each at its number modulo `2 r + 1`: the next row to come takes the place of the one that has served. They
//! stay in cache, where planes of them would pass through main memory. Whatever continues the picture beyond its edge
//! reads rows within `r` of the one asked for.
//!
//! With `A + iB` the picture filtered along x and `C + iS` the taps along y, a filter and its mirror
//! are `R = (AC - BS) + i (AS + BC)` and `(AC + BS) + i (AS - BC)`; see [`super`].

use super::{GaborBank, MirrorPair};
use crate::border::Border;
use crate::convolve::pad_row;
use crate::even_odd::{even_odd_sums, even_sums, mirrored_sums};
use crate::real::Real;

/// Fewest rows that are worth a stream of their own, when several run side by side: of the rows filtered along x, `2 r`
/// more than these are done.
pub(crate) const FEWEST_ROWS: usize = 16;

/// The responses of a bank to a picture, asked for row by row.
pub(crate) struct ResponseRows<'a, T> {
    bank: &'a GaborBank<T>,
    picture: &'a [T],
    height: usize,
    width: usize,
    border: Border,
    /// Rows filtered along x: an even and an odd line for each set of taps.
    filtered: Vec<T>,
    /// The next row to filter along x.
    next: usize,
    padded: Vec<T>,
    /// What a zero border reads.
    zeros: Vec<T>,
}

impl<'a, T: Real> ResponseRows<'a, T> {
    /// Responses to a packed picture of rows of `width` samples, from row `first` on.
    pub(crate) fn new(
        bank: &'a GaborBank<T>,
        picture: &'a [T],
        width: usize,
        border: Border,
        first: usize,
    ) -> Self {
        let kept = 2 * bank.radius + 1;
        Self {
            bank,
            picture,
            height: picture.len() / width,
            width,
            border,
            filtered: vec![T::zero(); kept * 2 * bank.along_x.len() * width],
            next: first.saturating_sub(bank.radius),
            padded: vec![T::zero(); width + 2 * bank.radius],
            zeros: vec![T::zero(); width],
        }
    }

    /// Fills `out`, (N, 2, W), with the real and imaginary responses of row `y`, not before the last one asked for.
    pub(crate) fn respond(&mut self, y: usize, out: &mut [T]) {
        while self.next <= (y + self.bank.radius).min(self.height - 1) {
            self.filter_along_x();
        }
        let lines = self.lines(y);
        for pair in &self.bank.pairs {
            self.filter_along_y(pair, &lines, out);
        }
    }

    /// The even and the odd lines of each set of taps that the filters along y combine at row `y`, top to bottom.
    fn lines(&self, y: usize) -> Vec<&[T]> {
        let (radius, width) = (self.bank.radius, self.width);
        let kept = 2 * radius + 1;
        let row = |j: usize| self.border.index((y + j) as isize - radius as isize, self.height);
        let starts: Vec<_> =
            (0..kept).map(|j| row(j).map(|row| row % kept * self.stride())).collect();
        let line = |start: Option<usize>, part: usize| {
            start.map_or(&self.zeros[..], |start| &self.filtered[start + part * width..][..width])
        };
        let parts = 0..2 * self.bank.along_x.len();
        parts.flat_map(|part| starts.iter().map(move |&start| line(start, part))).collect()
    }

    /// Samples of the lines of one row filtered along x.
    fn stride(&self) -> usize {
        2 * self.bank.along_x.len() * self.width
    }

    fn filter_along_x(&mut self) {
        let (width, stride) = (self.width, self.stride());
        let kept = 2 * self.bank.radius + 1;
        let row = &self.picture[self.next * width..(self.next + 1) * width];
        pad_row(row, self.bank.radius, self.border, &mut self.padded);
        let padded = &self.padded;
        let shifted: Vec<&[T]> = (0..kept).map(|j| &padded[j..j + width]).collect();
        let lines = &mut self.filtered[self.next % kept * stride..][..stride];
        for (taps, lines) in self.bank.along_x.iter().zip(lines.chunks_mut(2 * width)) {
            let (even, odd) = lines.split_at_mut(width);
            if taps.real {
                even_sums(&shifted, &taps.even, even);
            } else {
                even_odd_sums(&shifted, &taps.even, &taps.odd, even, odd);
            }
        }
        self.next += 1;
    }

    /// One row of the responses of a pair of mirrored filters, or of one on an axis, where `B` or `S` is 0.
    fn filter_along_y(&self, pair: &MirrorPair<T>, lines: &[&[T]], out: &mut [T]) {
        let (width, kept) = (self.width, 2 * self.bank.radius + 1);
        let lines = |part: usize| &lines[(2 * pair.along_x + part) * kept..][..kept];
        let taps = &pair.along_y;
        let plane = |filter: usize| 2 * filter * width..(2 * filter + 2) * width;
        let Some(mirror) = pair.mirror else {
            let (re, im) = out[plane(pair.filter)].split_at_mut(width);
            if taps.real {
                even_sums(lines(0), &taps.even, re);
                even_sums(lines(1), &taps.even, im);
            } else {
                even_odd_sums(lines(0), &taps.even, &taps.odd, re, im);
            }
            return;
        };
        // The mirror of a filter comes after it.
        let (before, after) = out.split_at_mut(plane(mirror).start);
        let (re, im) = before[plane(pair.filter)].split_at_mut(width);
        let (mirror_re, mirror_im) = after[..2 * width].split_at_mut(width);
        let rows = [lines(0), lines(1)];
        mirrored_sums(rows, &taps.even, &taps.odd, re, im, mirror_re, mirror_im);
    }
}
