//! Bands of rows that scatter into one picture side by side, none where another does.
//!
//! Data row y reaches [`Bands::reach`] rows of the padded picture above and below its own. Bands of at least twice that
//! many rows: first every other one, then those between, in an order that does not depend on the number of threads.

use crate::tasks::for_each_task;

/// Rows of data scattered per task, at least: half a millisecond of work on a wide picture, and several tasks per thread
/// on a low one.
const LEAST_BAND: usize = 32;

/// How data lie in a padded picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bands {
    /// Columns of the data.
    pub(super) width: usize,
    /// Pixels of padding on each side, >= `reach`.
    pub(super) pad: usize,
    /// Rows and columns that a datum reads beyond its own.
    pub(super) reach: usize,
}

impl Bands {
    /// Columns of the padded picture.
    pub(super) fn stride(&self) -> usize {
        self.width + 2 * self.pad
    }

    /// Rows of data per band: twice what it writes beyond them, so that every other one may run.
    pub(super) fn rows(&self) -> usize {
        LEAST_BAND.max(2 * self.reach)
    }

    /// Where data row `y` begins in the padded picture.
    pub(super) fn start(&self, y: usize) -> usize {
        (y + self.pad) * self.stride() + self.pad
    }

    /// Where row `i` of a band begins in its place.
    pub(super) fn place(&self, i: usize) -> usize {
        (i + self.reach) * self.stride() + self.pad
    }

    /// Calls `task(first row, rows of x within reach, data)` for every band of rows, two phases of them in parallel; x starts
    /// as 0. The places of the first phase are all of x, so that it clears them where it is about to write.
    pub(super) fn for_each<D: Send>(
        &self,
        x: &mut [f32],
        data: impl Iterator<Item = D>,
        task: impl Fn(usize, &mut [f32], D) + Sync,
    ) {
        let (stride, band) = (self.stride(), self.rows());
        let (mut even, mut odd) = (Vec::new(), Vec::new());
        for (i, data) in data.enumerate() {
            if i % 2 == 0 { even.push(Some(data)) } else { odd.push(Some(data)) }
        }
        // Band number i writes from `reach` rows above its first to as many below its last.
        let above = (self.pad - self.reach) * stride;
        x[..above].fill(0.0);
        for (phase, mut data) in [even, odd].into_iter().enumerate() {
            let from = (above + phase * band * stride).min(x.len());
            let places = x[from..].chunks_mut(2 * band * stride);
            let count = places.len();
            data.resize_with(count, || None);
            each(places.zip(data).enumerate(), count, |(i, (place, data))| {
                if phase == 0 {
                    place.fill(0.0);
                }
                if let Some(data) = data {
                    task((2 * i + phase) * band, place, data);
                }
            });
        }
    }
}

/// Runs `task` on everything that `tasks` yields, about `count` of them, on all threads.
pub(super) fn each<T: Send>(
    tasks: impl Iterator<Item = T> + Send,
    count: usize,
    task: impl Fn(T) + Sync,
) {
    let outcome = for_each_task(tasks, count, |item| {
        task(item);
        Ok(())
    });
    debug_assert!(outcome.is_ok(), "no task fails");
}
