//! Where there was something to go on.
//!
//! *Evidence* is the trace of the data term, the largest over the levels of its average over
//! [`REACH`] px of the level: below [`LEAST_EVIDENCE`] no filter that looked here saw anything and
//! the flow is only what its surroundings suggest. It is about 1 on texture, 1e-2 where the picture
//! is smooth, and 0 where it is flat. Pull to rest and precision (see [`super::still`],
//! [`super::precision`]) do not add to it: both reach out from patterns nearby.

use ndarray::Array2;

use crate::array::for_each_row;
use crate::control::Control;
use crate::error::Result;
use crate::pyramid::{Resampling, resample, smooth};

/// Deviation of the average of the evidence, px of the level.
pub(super) const REACH: f64 = 1.5;
/// Trace of the data term below which the flow is unknown.
pub(super) const LEAST_EVIDENCE: f32 = 1e-3;

/// The greater of the evidence of the coarser levels and of this level's trace of the data term.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn gather(
    coarser: Option<Array2<f32>>,
    trace: &Array2<f32>,
    control: &Control,
) -> Result<Array2<f32>> {
    let here = smooth(trace.view(), REACH, control)?;
    let Some(coarser) = coarser else { return Ok(here) };
    let mut most = resample(coarser.view(), here.dim(), Resampling::Linear, control)?;
    let (samples, width) = (here.as_slice().unwrap_or_default(), here.ncols());
    for_each_row(most.as_slice_mut().unwrap_or_default(), width, control, |y, most| {
        let here = &samples[y * width..(y + 1) * width];
        most.iter_mut().zip(here).for_each(|(most, here)| *most = here.max(*most));
    })?;
    Ok(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_of_any_level_counts() {
        let coarse = Array2::from_shape_fn((6, 6), |(_, x)| if x < 3 { 1.0 } else { 0.0 });
        let both = gather(Some(coarse), &Array2::zeros((12, 12)), &Control::new()).unwrap();
        assert_eq!((both[(6, 0)], both[(6, 11)]), (1.0, 0.0));
    }
}
