//! Cooperative cancellation and progress of long work, without clocks, printing or callbacks in the kernels.
//!
//! The caller keeps one [`Control`] and hands out references. Kernels call [`Control::advance`] after each slice of
//! work (a row, a tile, an iteration; a few milliseconds at most) and stop with [`Error::Cancelled`] once
//! [`Control::cancel`] was called from any thread.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

use crate::error::{Error, Result};

/// Shared state of one long call.
#[derive(Debug, Default)]
pub struct Control {
    cancelled: AtomicBool,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl Control {
    /// Nothing done, nothing cancelled.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the work to stop at its next step.
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }

    /// Announces `steps` further steps.
    pub fn expect(&self, steps: usize) {
        self.total.fetch_add(steps, Relaxed);
    }

    /// One step is done.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when [`Control::cancel`] was called.
    pub fn advance(&self) -> Result<()> {
        self.done.fetch_add(1, Relaxed);
        self.check()
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when [`Control::cancel`] was called.
    pub fn check(&self) -> Result<()> {
        if self.cancelled.load(Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Steps done and steps announced so far.
    #[must_use]
    pub fn progress(&self) -> (usize, usize) {
        (self.done.load(Relaxed), self.total.load(Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_steps_and_stops_when_asked() {
        let control = Control::new();
        control.expect(2);
        assert_eq!(control.advance(), Ok(()));
        assert_eq!(control.progress(), (1, 2));
        control.cancel();
        assert_eq!(control.advance(), Err(Error::Cancelled));
    }
}
