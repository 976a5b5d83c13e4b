//! A look at a frame: warped, filtered and weighed row by row, together with the reference.
//!
//! The responses of both frames are made when a row needs them and forgotten when the row after it is done: three rows
//! of each stay in cache, and nothing of the size of the picture is kept but the warped frame and the weights of its
//! pixels. Both frames are filtered anew in every look: arithmetic instead of memory.
//!
//! Runs of rows are independent of each other, what two of them need is filtered twice, and the
//! results do not depend on who does which.

use super::response_pair::ResponsePair;
use super::rows::{for_each_band, row_of};
use crate::border::Border;
use crate::control::Control;
use crate::error::Result;
use crate::gabor::GaborBank;
use crate::gabor::stream::{FEWEST_ROWS, ResponseRows};

/// Rows of responses that are kept: above, here and below.
const KEPT: usize = 3;

/// The reference and another frame warped onto it, all planes packed (H, W).
pub(super) struct Look<'a> {
    pub(super) bank: &'a GaborBank<f32>,
    pub(super) reference: &'a [f32],
    pub(super) warped: Vec<f32>,
    /// Weights of the warped frame's pixels.
    pub(super) visible: Vec<f32>,
    pub(super) height: usize,
    pub(super) width: usize,
}

impl Look<'_> {
    /// Number of filters.
    pub(super) fn filters(&self) -> usize {
        self.bank.wavevectors().len()
    }

    /// Runs `row(y, responses, weights, rows, scratch)` for every row of `N` packed planes with rows of `widths`
    /// samples, `scratch` made once for each run.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled); the planes are then undefined.
    pub(super) fn for_each_row<T: Send, S, const N: usize>(
        &self,
        planes: [&mut [T]; N],
        widths: [usize; N],
        control: &Control,
        scratch: impl Fn() -> S + Sync,
        row: impl Fn(usize, &ResponsePair<'_>, &[f32], [&mut [T]; N], &mut S) + Sync,
    ) -> Result<()> {
        let (width, last) = (self.width, self.height - 1);
        for_each_band(planes, widths, FEWEST_ROWS..=usize::MAX, control, |first, mut band| {
            let mut frames =
                [self.reference, &self.warped].map(|p| Kept::new(self.bank, p, width, first));
            let mut scratch = scratch();
            for i in 0..band[0].len() / widths[0] {
                control.check()?;
                let y = first + i;
                let rows = [y.saturating_sub(1), y, (y + 1).min(last)];
                frames.iter_mut().for_each(|frame| frame.advance(rows[2]));
                let pair =
                    ResponsePair::new(frames.each_ref().map(|f| rows.map(|y| f.row(y))), width);
                let seen = &self.visible[y * width..(y + 1) * width];
                row(y, &pair, seen, row_of(&mut band, widths, i), &mut scratch);
            }
            Ok(())
        })
    }
}

/// The last rows of the responses to one frame, row `y` at `y` modulo [`KEPT`].
struct Kept<'a> {
    source: ResponseRows<'a, f32>,
    rows: Vec<f32>,
    /// Samples of a row.
    stride: usize,
    /// The next row to come.
    next: usize,
}

impl<'a> Kept<'a> {
    /// To begin with the row before `first`.
    fn new(bank: &'a GaborBank<f32>, picture: &'a [f32], width: usize, first: usize) -> Self {
        let next = first.saturating_sub(1);
        let stride = 2 * bank.wavevectors().len() * width;
        let source = ResponseRows::new(bank, picture, width, Border::Reflect, next);
        Self { source, rows: vec![0.0; KEPT * stride], stride, next }
    }

    /// Makes the rows up to `y`.
    fn advance(&mut self, y: usize) {
        for row in self.next..=y {
            let start = row % KEPT * self.stride;
            self.source.respond(row, &mut self.rows[start..start + self.stride]);
            self.next = row + 1;
        }
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.rows[y % KEPT * self.stride..][..self.stride]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gabor::GaborParameters;
    use crate::tasks::runs;
    use ndarray::Array2;

    /// What a look shows of both frames is what the bank answers to the whole of them.
    #[test]
    fn rows_are_those_of_the_whole_pictures() {
        let parameters = GaborParameters { orientations: 4, support: 2.2, ..Default::default() };
        let bank = GaborBank::<f32>::new(&parameters).unwrap();
        let control = Control::new();
        for (height, width) in [(1, 9), (2, 9), (70, 13)] {
            let picture = |k: usize| {
                Array2::from_shape_fn((height, width), |(y, x)| ((k * x + y * y) % 11) as f32)
            };
            let pictures = [picture(3), picture(5)];
            let whole = pictures
                .each_ref()
                .map(|p| bank.respond(p.view(), Border::Reflect, &control).unwrap());
            let [reference, warped] = pictures.map(|p| p.into_raw_vec_and_offset().0);
            let visible = (0..height * width).map(|i| i as f32).collect();
            let look = Look { bank: &bank, reference: &reference, warped, visible, height, width };
            let mut seen = vec![0usize; height];
            look.for_each_row(
                [&mut seen],
                [1],
                &control,
                || 0,
                |y, pair, weights, [out], count| {
                    *count += 1;
                    out[0] += *count;
                    assert_eq!((pair.filters(), weights[0]), (4, (y * width) as f32));
                    for filter in 0..4 {
                        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
                        let expected = whole.each_ref().map(|r| rows.map(|y| r.row(filter, y)));
                        assert_eq!(pair.bands(filter), expected);
                        assert_eq!(pair.here(filter), expected.map(|[_, here, _]| here));
                    }
                },
            )
            .unwrap();
            // A scratch serves for a run.
            let runs = runs(height, FEWEST_ROWS..=usize::MAX);
            let expected: Vec<usize> = runs.iter().flat_map(|&run| 1..=run).collect();
            assert_eq!(seen, expected);
        }
    }
}
