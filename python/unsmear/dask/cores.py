"""How many threads a task may use.

The core has one pool of threads per process, shared by all calls in it: however many
tasks a process runs at once, they compute with as many threads as the pool has. In one
process that is right as it is, a thread per processor. Several worker processes on one
machine would have a pool of that size each; so in a worker the pool is made as large as
the number of tasks the worker runs at once. The variable UNSMEAR_NUM_THREADS in a
worker's environment overrides it.
"""

from __future__ import annotations

import os
from functools import cache
from multiprocessing import parent_process

from unsmear import _unsmear

__all__ = ["VARIABLE", "share_cores"]

VARIABLE = "UNSMEAR_NUM_THREADS"


@cache
def share_cores() -> None:
    """Fit the pool of a worker process to its tasks, once; elsewhere do nothing."""
    if parent_process() is None or VARIABLE in os.environ:
        return
    _unsmear.set_num_threads(_tasks_at_once())


def _tasks_at_once() -> int:
    """Return how many tasks this worker process runs at once."""
    try:
        from distributed import get_worker
    except ImportError:
        return 1
    try:
        return max(1, int(get_worker().state.nthreads))
    except ValueError:
        # A process of the multiprocessing scheduler: one task.
        return 1
