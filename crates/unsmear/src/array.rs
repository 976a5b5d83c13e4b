//! Shape checks and the one way of running over rows in parallel.
//!
//! Results never depend on the number of threads; see [`crate::tasks`].

use ndarray::{ArrayView2, ArrayView3};

use crate::control::Control;
use crate::error::{Error, Result};
use crate::tasks::{cut, for_each_task, runs};

/// Fewest rows per task: it outweighs its scheduling (about 1 us) on the narrowest useful picture.
pub(crate) const FEWEST_ROWS: usize = 8;

/// Samples below which one thread is done before another has heard of the work.
pub(crate) const FEW: usize = 4096;

/// Runs `row(y, out_row)` for every row of a packed picture of rows of `width` samples, in parallel.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled) when `control` says so; the contents of `out` are then undefined.
pub(crate) fn for_each_row<T: Send>(
    out: &mut [T],
    width: usize,
    control: &Control,
    row: impl Fn(usize, &mut [T]) + Sync,
) -> Result<()> {
    for_each_row_with(out, width, control, || (), |y, out_row, ()| row(y, out_row))
}

/// Like [`for_each_row`], with a scratch made once per task by `scratch`.
pub(crate) fn for_each_row_with<T: Send, S>(
    out: &mut [T],
    width: usize,
    control: &Control,
    scratch: impl Fn() -> S + Sync,
    row: impl Fn(usize, &mut [T], &mut S) + Sync,
) -> Result<()> {
    if width == 0 {
        return Ok(());
    }
    let several = |first: usize, rows: &mut [T]| {
        let mut scratch = scratch();
        for (i, out_row) in rows.chunks_mut(width).enumerate() {
            control.check()?;
            row(first + i, out_row, &mut scratch);
        }
        Ok(())
    };
    if out.len() <= FEW {
        return several(0, out);
    }
    let runs = runs(out.len().div_ceil(width), FEWEST_ROWS..=usize::MAX);
    for_each_task(cut(out, width, &runs), runs.len(), |(first, rows)| several(first, rows))
}

/// Checks that a sequence (T, H, W) has at least the given extents.
///
/// # Errors
/// [`Error::Shape`] naming `argument`, the least shape and the one that came.
pub(crate) fn require_frames<T>(
    argument: &'static str,
    frames: &ArrayView3<'_, T>,
    least: [usize; 3],
) -> Result<()> {
    if frames.shape().iter().zip(least).all(|(&n, least)| n >= least) {
        return Ok(());
    }
    let [t, h, w] = least;
    Err(Error::shape(argument, format!("(T >= {t}, H >= {h}, W >= {w})"), frames.shape()))
}

/// Checks that a picture has exactly the shape (H, W).
///
/// # Errors
/// [`Error::Shape`] naming `argument`.
pub(crate) fn require_same<T>(
    argument: &'static str,
    picture: &ArrayView2<'_, T>,
    shape: (usize, usize),
) -> Result<()> {
    if picture.dim() == shape {
        return Ok(());
    }
    Err(Error::shape(argument, format!("({}, {})", shape.0, shape.1), picture.shape()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use ndarray::Array3;

    #[test]
    fn visits_every_row_once_and_stops_on_request() {
        let mut out = vec![0usize; 7 * 21];
        for_each_row(&mut out, 7, &Control::new(), |y, row| {
            row.iter_mut().for_each(|s| *s += y + 1);
        })
        .unwrap();
        assert!(out.chunks(7).enumerate().all(|(y, row)| row.iter().all(|&s| s == y + 1)));
        let control = Control::new();
        control.cancel();
        assert_eq!(for_each_row(&mut out, 7, &control, |_, _| ()), Err(Error::Cancelled));
    }

    #[test]
    fn shape_errors_say_what_is_needed() {
        let frames = Array3::<f32>::zeros((1, 4, 5));
        let error = require_frames("frames", &frames.view(), [3, 5, 5]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "frames must have shape (T >= 3, H >= 5, W >= 5), got [1, 4, 5]"
        );
    }
}
