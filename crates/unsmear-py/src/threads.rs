//! The thread pool of the module, and the one door through which long work leaves the interpreter.
//!
//! The work runs on the pool with the GIL released. The calling thread meanwhile wakes every [`POLL`] to let Python
//! handle signals (Ctrl-C) and to report progress; an exception from either cancels the work and is raised unchanged.
//! Threads do not survive `fork`, so the pool remembers its process and is rebuilt in a child.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use unsmear::{Control, Result};

use crate::errors::to_python;

/// Ctrl-C must be answered within 0.2 s; a quarter of that leaves room for the slice of work under way.
const POLL: Duration = Duration::from_millis(50);

/// Pools that stay, the last used first: who changes their number back and forth pays for none of it.
const POOLS: usize = 2;

struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

static POOL: Mutex<Vec<Pool>> = Mutex::new(Vec::new());
static WANTED: Mutex<Option<usize>> = Mutex::new(None);

fn wanted() -> PyResult<usize> {
    if let Some(n) = *WANTED.lock().unwrap_or_else(PoisonError::into_inner) {
        return Ok(n);
    }
    match std::env::var("UNSMEAR_NUM_THREADS") {
        Ok(text) => text.trim().parse().ok().filter(|&n| n >= 1).ok_or_else(|| {
            PyValueError::new_err(format!(
                "UNSMEAR_NUM_THREADS must be an integer >= 1, got {text:?}"
            ))
        }),
        Err(_) => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
    }
}

fn pool() -> PyResult<Arc<ThreadPool>> {
    let n = wanted()?;
    let mut pools = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if pools.iter().any(|pool| pool.process != process) {
        // A pool inherited through `fork` has no live threads: dropping it would wait for them for ever.
        pools.drain(..).for_each(std::mem::forget);
    }
    if let Some(at) = pools.iter().position(|pool| pool.threads.current_num_threads() == n) {
        pools[..=at].rotate_right(1);
        return Ok(Arc::clone(&pools[0].threads));
    }
    let threads = ThreadPoolBuilder::new()
        .num_threads(n)
        .thread_name(|i| format!("unsmear-{i}"))
        .build()
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start {n} threads: {e}")))?;
    let threads = Arc::new(threads);
    pools.truncate(POOLS - 1);
    pools.insert(0, Pool { process, threads: Arc::clone(&threads) });
    Ok(threads)
}

/// Number of threads used by the core; also settable by the environment variable `UNSMEAR_NUM_THREADS`.
#[pyfunction]
pub(crate) fn set_num_threads(n: usize) -> PyResult<()> {
    if n == 0 {
        return Err(PyValueError::new_err("n must be an integer >= 1, got 0"));
    }
    *WANTED.lock().unwrap_or_else(PoisonError::into_inner) = Some(n);
    Ok(())
}

/// Number of threads the next call will use.
#[pyfunction]
pub(crate) fn get_num_threads() -> PyResult<usize> {
    wanted()
}

/// Runs `work` on the pool, outside the interpreter; see the module's head.
pub(crate) fn run<R: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Control) -> Result<R> + Send,
) -> PyResult<R> {
    let pool = pool()?;
    let callback = progress.map(|p| p.clone().unbind());
    let control = Control::new();
    let outcome = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = channel();
            let control = &control;
            let worker = scope.spawn(move || {
                let result = pool.install(|| work(control));
                // The receiver outlives the worker: it is dropped only after the loop below has ended.
                let _ = sender.send(());
                result
            });
            let mut raised = None;
            while receiver.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none() {
                    raised = Python::attach(|py| attend(py, control, callback.as_ref())).err();
                    if raised.is_some() {
                        control.cancel();
                    }
                }
            }
            (worker.join(), raised)
        })
    });
    match outcome {
        (_, Some(raised)) => Err(raised),
        (Ok(Ok(value)), None) => {
            attend(py, &control, callback.as_ref())?;
            Ok(value)
        }
        (Ok(Err(error)), None) => Err(to_python(&error)),
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}

/// Lets Python handle signals and passes on how far the work is.
fn attend(py: Python<'_>, control: &Control, callback: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    if let Some(callback) = callback {
        callback.call1(py, control.progress())?;
    }
    Ok(())
}
