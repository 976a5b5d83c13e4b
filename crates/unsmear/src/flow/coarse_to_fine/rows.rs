//! Rows of several pictures of one size, written together and in parallel.
//!
//! As [`crate::array::for_each_row`], for kernels whose results are separate planes. Each plane is
//! its own slice, so that the compiler knows that writing one does not change another.

use std::ops::RangeInclusive;

use crate::array::{FEW, FEWEST_ROWS};
use crate::control::Control;
use crate::error::Result;
use crate::tasks::{for_each_task, runs};

/// Two packed planes (H, W): the components of a flow, or weights along x and along y.
pub(super) type Planes<'a> = [&'a [f32]; 2];

/// Runs `row(y, rows)` for every row of `N` packed planes with rows of `widths` samples.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled); the planes are then undefined.
pub(super) fn for_each_rows<const N: usize>(
    planes: [&mut [f32]; N],
    widths: [usize; N],
    control: &Control,
    row: impl Fn(usize, [&mut [f32]; N]) + Sync,
) -> Result<()> {
    // Few samples are not worth a second thread.
    let few = planes[0].len() <= FEW;
    let fewest = if few { usize::MAX } else { FEWEST_ROWS };
    for_each_band(planes, widths, fewest..=usize::MAX, control, |first, mut band| {
        for i in 0..band[0].len() / widths[0] {
            control.check()?;
            row(first + i, row_of(&mut band, widths, i));
        }
        Ok(())
    })
}

/// Row `i` of packed planes with rows of `widths` samples.
pub(super) fn row_of<'a, T, const N: usize>(
    planes: &'a mut [&mut [T]; N],
    widths: [usize; N],
    i: usize,
) -> [&'a mut [T]; N] {
    let mut at = 0;
    planes.each_mut().map(|plane| {
        at += 1;
        let width = widths[at - 1];
        &mut plane[i * width..(i + 1) * width]
    })
}

/// Runs `band(first, rows)` for runs of `within` rows (see [`runs`]), which cover `N` packed planes with rows of `widths`
/// samples; `first` is the number of the first row.
///
/// # Errors
/// What `band` returns; the planes are then undefined.
pub(super) fn for_each_band<T: Send, const N: usize>(
    planes: [&mut [T]; N],
    widths: [usize; N],
    within: RangeInclusive<usize>,
    control: &Control,
    band: impl Fn(usize, [&mut [T]; N]) -> Result<()> + Sync,
) -> Result<()> {
    let rows = planes.iter().zip(widths).map(|(plane, width)| plane.len() / width.max(1)).min();
    let runs = runs(rows.unwrap_or(0), within);
    let mut rest = planes;
    let mut first = 0;
    let bands = runs.iter().map(|run| {
        let mut at = 0;
        let band = rest.each_mut().map(|plane| {
            at += 1;
            let (head, tail) = std::mem::take(plane).split_at_mut(run * widths[at - 1]);
            *plane = tail;
            head
        });
        first += run;
        (first - run, band)
    });
    for_each_task(bands, runs.len(), |(first, planes)| {
        control.check()?;
        band(first, planes)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_every_plane_once() {
        let (mut one, mut two) = (vec![0.0; 3 * 21], vec![0.0; 5 * 21]);
        for_each_rows([&mut one, &mut two], [3, 5], &Control::new(), |y, [a, b]| {
            a.iter_mut().chain(b).for_each(|s| *s += 1.0 + y as f32);
        })
        .unwrap();
        let right = |plane: &[f32], width| {
            plane.chunks(width).enumerate().all(|(y, row)| row.iter().all(|&s| s == 1.0 + y as f32))
        };
        assert!(right(&one, 3) && right(&two, 5));
    }
}
