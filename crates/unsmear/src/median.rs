//! Median over 5 x 5 pixels.
//!
//! ```text
//! out(y, x) = the 13th smallest of plane(y + j, x + i),   i, j = -2..2
//! ```
//!
//! Beyond the picture its edge pixels continue. Units are those of the plane. Validity: no NaN (comparisons with NaN
//! are false, the result is then some sample or NaN).

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::{Error, Result};

/// Writes the 5 x 5 median of `plane` (packed rows of `width` samples, `height` of them) to `out`.
///
/// # Errors
/// [`Error::Shape`] when a slice has not height x width samples; [`Error::Cancelled`].
pub fn median_5x5(
    plane: &[f32],
    height: usize,
    width: usize,
    out: &mut [f32],
    control: &Control,
) -> Result<()> {
    for (argument, got) in [("plane", plane.len()), ("out", out.len())] {
        if got != height * width {
            return Err(Error::shape(argument, format!("({height} x {width},)"), &[got]));
        }
    }
    for_each_row(out, width, control, |y, row| {
        for (x, sample) in row.iter_mut().enumerate() {
            let mut window = [0.0f32; 25];
            for (k, w) in window.iter_mut().enumerate() {
                let yy = (y + k / 5).saturating_sub(2).min(height - 1);
                let xx = (x + k % 5).saturating_sub(2).min(width - 1);
                *w = plane[yy * width + xx];
            }
            window.sort_unstable_by(f32::total_cmp);
            *sample = window[12];
        }
    })
}
