//! Tasks shared out among the threads of a pool, whole pictures cut into runs of rows.
//!
//! Whoever is free takes the next task. With `n` threads and `R` rows left a run has `R/(2 n)` rows: the first are long, so
//! that little is done twice where runs meet, and the last are short, so that all threads finish together (guided
//! self-scheduling: C. D. Polychronopoulos, D. J. Kuck 1987, doi 10.1109/TC.1987.5009495).
//!
//! A stage of a small picture takes a fraction of a millisecond, and a thread that sleeps at its end wakes tens of
//! microseconds late for the next. So the one that has shared out the work waits for the others without sleeping, but no
//! longer than [`PATIENCE`].
//!
//! Results never depend on the number of threads: tasks are parts of *outputs*, each computed by the same instructions
//! in the same order whoever computes it, and nothing is summed across tasks.

use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ndarray::Array2;
use rayon::prelude::*;

use crate::error::Result;

/// How long a thread waits before it may sleep: longer than the tasks that others have still to end.
pub(crate) const PATIENCE: Duration = Duration::from_micros(500);
/// After this it lets other processes of the machine go first.
const HASTE: Duration = Duration::from_micros(50);
/// Pauses between two looks.
const PAUSES: usize = 32;
/// Samples written together.
const AT_ONCE: usize = 16;
/// As many of them as outweigh a task.
const BLOCKS_PER_TASK: usize = 1 << 11;

/// Runs `task` on everything that `tasks` yields, about `count` of them, on all threads.
///
/// # Errors
/// The first error of a task; some of the others are then not begun.
pub(crate) fn for_each_task<T: Send>(
    tasks: impl Iterator<Item = T> + Send,
    count: usize,
    task: impl Fn(T) -> Result<()> + Sync,
) -> Result<()> {
    let helpers = rayon::current_num_threads().min(count).saturating_sub(1);
    let mut tasks = tasks;
    if helpers == 0 {
        return tasks.try_for_each(task);
    }
    let state = Mutex::new((tasks, Ok(())));
    let work = || {
        loop {
            let next = {
                let (tasks, outcome) = &mut *state.lock().unwrap_or_else(PoisonError::into_inner);
                if outcome.is_ok() { tasks.next() } else { None }
            };
            let Some(next) = next else { break };
            if let Err(error) = task(next) {
                state.lock().unwrap_or_else(PoisonError::into_inner).1 = Err(error);
            }
        }
    };
    let busy = AtomicUsize::new(helpers);
    rayon::scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| {
                let _leaving = Leaving(&busy);
                work();
            });
        }
        work();
        wait_while(|| busy.load(Ordering::Acquire) > 0);
    });
    state.into_inner().unwrap_or_else(PoisonError::into_inner).1
}

/// Counts a thread out, however it ends.
struct Leaving<'a>(&'a AtomicUsize);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Release);
    }
}

/// Does what other work there is while `waiting`, for no longer than [`PATIENCE`] in vain.
pub(crate) fn wait_while(waiting: impl Fn() -> bool) {
    let mut idle_since = Instant::now();
    while waiting() {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            idle_since = Instant::now();
            continue;
        }
        let idle = idle_since.elapsed();
        if idle > PATIENCE {
            break;
        }
        if idle > HASTE {
            std::thread::yield_now();
        }
        (0..PAUSES).for_each(|_| std::hint::spin_loop());
    }
}

/// Lengths of the runs that `rows` are cut into, each of `within` rows but for the last.
pub(crate) fn runs(rows: usize, within: RangeInclusive<usize>) -> Vec<usize> {
    let threads = rayon::current_num_threads();
    let (least, most) = (*within.start(), *within.end());
    let mut left = rows;
    let mut runs = Vec::new();
    while left > 0 {
        let fair = if threads == 1 { left } else { left / (2 * threads) };
        let run = fair.clamp(least, most).min(left);
        runs.push(run);
        left -= run;
    }
    runs
}

/// `samples` cut into runs of so many rows of `width`, the last row perhaps shorter, each with the number of its first.
pub(crate) fn cut<'a, T>(
    samples: &'a mut [T],
    width: usize,
    runs: &'a [usize],
) -> impl Iterator<Item = (usize, &'a mut [T])> {
    let mut rest = samples;
    let mut first = 0;
    runs.iter().map(move |&run| {
        let end = (run * width).min(rest.len());
        let (head, tail) = std::mem::take(&mut rest).split_at_mut(end);
        rest = tail;
        first += run;
        (first - run, head)
    })
}

/// `samples` times `value`, written by all threads.
pub(crate) fn filled<T: Copy + Send + Sync>(value: T, samples: usize) -> Vec<T> {
    if rayon::current_num_threads() == 1 {
        vec![value; samples]
    } else {
        made(samples, |_| [value; AT_ONCE])
    }
}

/// Makes all of `values` `value`, by all threads.
pub(crate) fn fill<T: Copy + Send + Sync>(values: &mut [T], value: T) {
    values.par_chunks_mut(AT_ONCE * BLOCKS_PER_TASK).for_each(|part| part.fill(value));
}

/// A picture (H, W) of one value, written by all threads.
pub(crate) fn filled_picture<T: Copy + Send + Sync>(value: T, size: (usize, usize)) -> Array2<T> {
    Array2::from_shape_vec(size, filled(value, size.0 * size.1))
        .unwrap_or_else(|_| Array2::from_elem(size, value))
}

/// A copy made by all threads.
pub(crate) fn copied<T: Copy + Send + Sync>(values: &[T]) -> Vec<T> {
    let Some(&last) = values.last() else { return Vec::new() };
    if rayon::current_num_threads() == 1 {
        return values.to_vec();
    }
    let (whole, rest) = values.as_chunks::<AT_ONCE>();
    let mut end = [last; AT_ONCE];
    end[..rest.len()].copy_from_slice(rest);
    made(values.len(), |i| *whole.get(i).unwrap_or(&end))
}

/// `samples` values, [`AT_ONCE`] by [`AT_ONCE`].
fn made<T: Copy + Send>(
    samples: usize,
    block: impl Fn(usize) -> [T; AT_ONCE] + Sync + Send,
) -> Vec<T> {
    let blocks = (0..samples.div_ceil(AT_ONCE)).into_par_iter().with_min_len(BLOCKS_PER_TASK);
    let mut values = blocks.map(block).collect::<Vec<_>>().into_flattened();
    values.truncate(samples);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::AtomicBool;

    fn on<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
    }

    #[test]
    fn runs_cover_all_rows_and_grow_no_longer() {
        for threads in [1, 2, 3, 8] {
            for (rows, within) in [(480, 8..=usize::MAX), (100, 24..=64), (5, 8..=9), (0, 1..=2)] {
                let runs = on(threads, || runs(rows, within.clone()));
                assert_eq!(runs.iter().sum::<usize>(), rows);
                assert!(runs.is_sorted_by(|one, next| one >= next));
                assert!(runs.iter().rev().skip(1).all(|run| within.contains(run)), "{runs:?}");
            }
        }
        // All that is left is taken together by one thread, a quarter of it by each of two.
        assert_eq!(on(1, || runs(480, 8..=usize::MAX)), [480]);
        assert_eq!(on(2, || runs(480, 8..=usize::MAX))[..3], [120, 90, 67]);
    }

    #[test]
    fn every_run_is_done_once_by_any_number_of_threads() {
        for threads in [1, 2, 3, 8] {
            let mut samples = vec![0usize; 3 * 200 - 1];
            on(threads, || {
                let runs = runs(200, 4..=30);
                for_each_task(cut(&mut samples, 3, &runs), runs.len(), |(first, rows)| {
                    rows.iter_mut().enumerate().for_each(|(i, s)| *s += 3 * first + i + 1);
                    Ok(())
                })
            })
            .unwrap();
            assert!(samples.iter().enumerate().all(|(i, &s)| s == i + 1));
        }
    }

    #[test]
    fn an_error_ends_the_work_and_a_panic_comes_through() {
        for threads in [1, 2, 4] {
            let failing = |i: usize| if i == 5 { Err(Error::Cancelled) } else { Ok(()) };
            let outcome = on(threads, || for_each_task(0..1000, 1000, failing));
            assert_eq!(outcome, Err(Error::Cancelled));
            let panicking = |i: usize| {
                assert!(i != 5, "planned");
                Ok(())
            };
            let caught = catch_unwind(AssertUnwindSafe(|| {
                on(threads, || for_each_task(0..1000, 1000, panicking))
            }));
            assert!(caught.is_err());
        }
    }

    #[test]
    fn waiting_does_not_last_for_ever() {
        let began = Instant::now();
        wait_while(|| true);
        assert!(began.elapsed() > PATIENCE);
        let open = AtomicBool::new(true);
        wait_while(|| open.swap(false, Ordering::Relaxed));
        assert!(!open.into_inner());
    }

    #[test]
    fn values_are_as_many_as_asked_for() {
        for samples in [0, 1, 15, 16, 17, 70_001] {
            let mut values = filled(2.5f32, samples);
            assert_eq!(values, vec![2.5; samples]);
            values.iter_mut().enumerate().for_each(|(i, value)| *value = i as f32);
            assert_eq!(copied(&values), values);
            fill(&mut values, 1.0);
            assert_eq!(values, vec![1.0; samples]);
        }
        assert_eq!(filled_picture(7u8, (3, 9)), Array2::from_elem((3, 9), 7u8));
    }
}
