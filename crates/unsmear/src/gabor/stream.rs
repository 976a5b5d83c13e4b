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
use crate::even_odd::{difference, even_odd_sums, sum};
use crate::real::Real;

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
    /// Four lines of sums, and one of zeros: what a zero border reads.
    scratch: Vec<T>,
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
            scratch: vec![T::zero(); 5 * width],
        }
    }

    /// Fills `out`, (N, 2, W), with the real and imaginary responses of row `y`, not before the last one asked for.
    pub(crate) fn respond(&mut self, y: usize, out: &mut [T]) {
        while self.next <= (y + self.bank.radius).min(self.height - 1) {
            self.filter_along_x();
        }
        for pair in &self.bank.pairs {
            self.filter_along_y(pair, y, out);
        }
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
            even_odd_sums(&shifted, &taps.even, &taps.odd, even, odd);
        }
        self.next += 1;
    }

    /// One row of the responses of a pair of mirrored filters.
    fn filter_along_y(&mut self, pair: &MirrorPair<T>, y: usize, out: &mut [T]) {
        let (width, stride, radius) = (self.width, self.stride(), self.bank.radius);
        let (filtered, border, height) = (&self.filtered, self.border, self.height);
        let (scratch, zeros) = self.scratch.split_at_mut(4 * width);
        let zeros = &*zeros;
        let line = |j: usize, part: usize| {
            border.index((y + j) as isize - radius as isize, height).map_or(zeros, |row| {
                let start = row % (2 * radius + 1) * stride + (2 * pair.along_x + part) * width;
                &filtered[start..start + width]
            })
        };
        let lines = |part| (0..=2 * radius).map(|j| line(j, part)).collect::<Vec<&[T]>>();
        let (first, second) = scratch.split_at_mut(2 * width);
        let (ac, sa) = first.split_at_mut(width);
        let (bc, sb) = second.split_at_mut(width);
        let taps = &pair.along_y;
        even_odd_sums(&lines(0), &taps.even, &taps.odd, ac, sa);
        if self.bank.along_x[pair.along_x].real {
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
