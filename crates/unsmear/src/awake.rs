//! Threads that stay awake between the parallel stages of a short computation.
//!
//! A thread of the pool without work falls asleep within some ten microseconds, and waking it takes
//! tens of microseconds more: as long as a stage on a small picture. While [`awake`] runs its work,
//! the other threads of the pool look for parts of it without sleeping, but for no longer than
//! [`PATIENCE`](crate::tasks::PATIENCE) in vain: a long stage on one thread keeps no other busy with waiting.
//!
//! Nothing of a result depends on it.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::tasks::wait_while;

thread_local! {
    /// Whether this thread has work of its own under way, which others may not hold up.
    static AT_WORK: Cell<bool> = const { Cell::new(false) };
}

/// Ends the watch, whatever ends the work.
struct Watch {
    on: Arc<AtomicBool>,
    before: bool,
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.on.store(false, Relaxed);
        AT_WORK.set(self.before);
    }
}

/// Runs `work`, which has many short parallel stages, with the threads of its pool kept awake.
pub(crate) fn awake<R>(work: impl FnOnce() -> R) -> R {
    if rayon::current_thread_index().is_none() || rayon::current_num_threads() == 1 {
        return work();
    }
    let on = Arc::new(AtomicBool::new(true));
    let watch = Watch { on: Arc::clone(&on), before: AT_WORK.replace(true) };
    rayon::spawn_broadcast(move |_| {
        if !AT_WORK.get() {
            wait_while(|| on.load(Relaxed));
        }
    });
    let result = work();
    drop(watch);
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
    }

    fn stages() -> Vec<u64> {
        let mut values: Vec<u64> = (0..5000).collect();
        for stage in 0..50 {
            values.par_iter_mut().for_each(|v| *v = v.wrapping_mul(31).wrapping_add(stage));
        }
        values
    }

    #[test]
    fn the_work_is_done_in_and_out_of_a_pool() {
        let expected = stages();
        assert_eq!(awake(stages), expected);
        for threads in [1, 2, 5] {
            assert_eq!(pool(threads).install(|| awake(stages)), expected);
            assert_eq!(pool(threads).install(|| awake(|| awake(stages))), expected);
        }
    }

    #[test]
    fn two_at_a_time_do_not_wait_for_each_other() {
        let shared = pool(3);
        let expected = stages();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..20 {
                        assert_eq!(shared.install(|| awake(stages)), expected);
                    }
                });
            }
        });
    }

    #[test]
    fn a_panic_ends_the_watch() {
        let shared = pool(2);
        let caught =
            catch_unwind(AssertUnwindSafe(|| shared.install(|| awake(|| panic!("planned")))));
        assert!(caught.is_err());
        assert!(!shared.install(|| AT_WORK.get()));
    }
}
