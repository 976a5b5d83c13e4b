//! Rows of the responses to two frames, around one row of the picture.
//!
//! A row holds the real and the imaginary responses of all filters, (N, 2, W). Beyond the edge of
//! the picture the row itself stands for its neighbour.

/// Rows of one filter's response: above, here and below, real and imaginary.
pub(super) type Band<'a> = [(&'a [f32], &'a [f32]); 3];

/// Responses to the reference and to another frame, rows above, here and below.
#[derive(Clone, Copy)]
pub(super) struct ResponsePair<'a> {
    rows: [[&'a [f32]; 3]; 2],
    width: usize,
}

impl<'a> ResponsePair<'a> {
    /// From the packed rows of both frames.
    pub(super) fn new(rows: [[&'a [f32]; 3]; 2], width: usize) -> Self {
        Self { rows, width }
    }

    /// Number of filters.
    pub(super) fn filters(&self) -> usize {
        self.rows[0][1].len() / (2 * self.width)
    }

    /// Real and imaginary responses of a filter here, of the reference and of the other frame.
    pub(super) fn here(&self, filter: usize) -> [(&'a [f32], &'a [f32]); 2] {
        self.bands(filter).map(|[_, here, _]| here)
    }

    /// Rows of a filter's response to the reference and to the other frame.
    pub(super) fn bands(&self, filter: usize) -> [Band<'a>; 2] {
        let (start, width) = (2 * filter * self.width, self.width);
        self.rows.map(|rows| rows.map(|row| row[start..start + 2 * width].split_at(width)))
    }
}
