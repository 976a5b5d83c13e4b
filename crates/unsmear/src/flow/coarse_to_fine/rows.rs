//! Rows of several pictures of one size, written together and in parallel.
//!
//! As [`crate::array::for_each_row`], for kernels whose results are separate planes. Each plane is
//! its own slice, so that the compiler knows that writing one does not change another.

use rayon::prelude::*;

use crate::array::FEW;
use crate::control::Control;
use crate::error::Result;

/// Rows per task; see [`crate::array`].
const ROWS_PER_TASK: usize = 8;

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
    let height = if few { planes[0].len() } else { ROWS_PER_TASK };
    for_each_band(planes, widths, height, control, |first, mut band| {
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

/// Runs `band(first, rows)` for every `height` rows, or what is left of them, of `N` packed planes
/// with rows of `widths` samples; `first` is the number of the first row.
///
/// # Errors
/// What `band` returns; the planes are then undefined.
pub(super) fn for_each_band<T: Send, const N: usize>(
    planes: [&mut [T]; N],
    widths: [usize; N],
    height: usize,
    control: &Control,
    band: impl Fn(usize, [&mut [T]; N]) -> Result<()> + Sync,
) -> Result<()> {
    let mut tasks: Vec<[&mut [T]; N]> = Vec::new();
    let mut rest = planes;
    while rest.iter().zip(widths).all(|(plane, width)| width > 0 && !plane.is_empty()) {
        let mut at = 0;
        let mut task: [&mut [T]; N] = [(); N].map(|()| [].as_mut_slice());
        rest = rest.map(|plane| {
            let count = (height * widths[at]).min(plane.len());
            let (head, tail) = plane.split_at_mut(count);
            task[at] = head;
            at += 1;
            tail
        });
        tasks.push(task);
    }
    tasks.into_par_iter().enumerate().try_for_each(|(number, planes)| {
        control.check()?;
        band(number * height, planes)
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
