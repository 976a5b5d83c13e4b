"""Clips from file to file over a cluster, each one task.

A task runs `unsmear.deblur_clip`, the same code and so the same bytes as alone. What it
has finished is in ``TARGET.part`` beside the target, on the disk that client and
workers share; when its worker dies, the scheduler gives the task to another one, which
goes on from there. A task tells how far it is through the scheduler's events, and stops
after the frame it is at when the client no longer wants it.
"""

from __future__ import annotations

import logging
import os
import time
import uuid
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from unsmear.dask.cores import VARIABLE, share_cores
from unsmear.streaming.deblur_clip import deblur_clip
from unsmear.streaming.part_folder import AtWorkError, discard_part
from unsmear.streaming.several_clips import FAILURES, ClipOutcome, reason

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator

    from unsmear.streaming.results import ClipResult
    from unsmear.streaming.several_clips import Job, ProgressOfClips

__all__ = ["LOCAL", "ClipOutcome", "deblur_clips"]

LOCAL = "local"
SECONDS_BETWEEN_REPORTS = 0.2
PATIENCE = 30.0
"""How long a task waits for what its predecessor, thought dead, still holds, s."""
NAP = 0.2


class UnwantedError(Exception):
    """The client has cancelled the task, or is gone."""


def deblur_clips(
    clips: Iterable[Job],
    *,
    scheduler: Any,
    resume: bool = False,
    progress: ProgressOfClips | None = None,
    **options: Any,
) -> Generator[ClipOutcome, None, None]:
    """Restore clips from file to file over a `dask.distributed` cluster.

    Parameters
    ----------
    clips : iterable of (source, target)
        Text, as for `unsmear.deblur_clip`. Paths must mean the same to all workers.
    scheduler : str or distributed.Client
        Address of a scheduler, a client of one, or "local": a cluster on this machine,
        a process per processor but no more than there are clips.
    resume : bool, default False
        Go on where an earlier run was broken off, and keep what is finished should
        this one be. A worker that dies loses nothing either way.
    progress : callable, optional
        Called with a clip's number and the share of it that is done, from another
        thread.
    **options
        As for `unsmear.deblur_clip`.

    Yields
    ------
    ClipOutcome
        As clips are finished or fail, in any order. Closing the generator, or an
        exception such as Ctrl-C, cancels what is left.

    Raises
    ------
    ImportError
        If `distributed` is missing.
    OSError
        If the scheduler does not answer.

    Notes
    -----
    A worker runs as many clips at once as it has threads (``dask worker --nthreads``),
    each with the memory that `unsmear.deblur_clip` tells. A clip fails when more
    workers died over it than the scheduler allows, by default three.

    Examples
    --------
    >>> import unsmear.dask
    >>> list(unsmear.dask.deblur_clips([], scheduler="local"))
    []
    """
    given = list(clips)
    jobs = [(_absolute(source), _absolute(target)) for source, target in given]
    if not jobs:
        return
    targets = [Path(str(target)) for _, target in jobs]
    if not resume:
        # From here on every attempt goes on with what the one before it left.
        for target in targets:
            discard_part(target)
    unfinished = set(range(len(jobs)))
    try:
        with _client_of(scheduler, len(jobs)) as client:
            for number, made, error in _outcomes(
                client, jobs, options, progress, resume=resume
            ):
                if made is not None:
                    unfinished.discard(number)
                yield ClipOutcome(number, *given[number], made, error)
    finally:
        if not resume:
            for number in unfinished:
                discard_part(targets[number])


def _outcomes(
    client: Any,
    jobs: list[tuple[Any, Any]],
    options: dict[str, Any],
    progress: ProgressOfClips | None,
    *,
    resume: bool,
) -> Iterator[tuple[int, ClipResult | None, str | None]]:
    """Yield number, result and error of the clips as they are finished."""
    from distributed import as_completed

    topic = f"unsmear-{uuid.uuid4().hex}"
    if progress is not None:

        def passed_on(event: Any) -> None:
            _, message = event
            progress(message["clip"], message["share"])

        client.subscribe_topic(topic, passed_on)
    futures = {
        client.submit(
            restored_clip,
            number,
            source,
            target,
            options,
            topic,
            resume=resume,
            key=f"{topic}-{number}",
            pure=False,
        ): number
        for number, (source, target) in enumerate(jobs)
    }
    try:
        for future in as_completed(futures):
            number = futures[future]
            if future.status == "finished":
                yield number, *future.result()
            elif future.status == "error":
                yield number, None, _death_or_reason(future.exception())
            else:
                yield number, None, "the task was lost with its scheduler"
            future.release()
    finally:
        with suppress(Exception):
            client.cancel([future for future in futures if not future.done()])
        if progress is not None:
            with suppress(Exception):
                client.unsubscribe_topic(topic)


def _death_or_reason(failure: BaseException) -> str:
    """Return what is to be told of a task that raised, or killed its workers."""
    from distributed import KilledWorker

    if not isinstance(failure, KilledWorker):
        return reason(failure)
    died = failure.allowed_failures + 1
    return f"workers died over it, {died} in all; what they logged may tell why"


@contextmanager
def _client_of(scheduler: Any, count: int) -> Iterator[Any]:
    """Yield a client; what is started for it ends with it."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise ImportError(
            "a cluster needs dask.distributed: pip install 'unsmear[dask]'"
        ) from error
    if isinstance(scheduler, Client):
        yield scheduler
    elif scheduler != LOCAL:
        with Client(scheduler) as client:
            yield client
    else:
        from dask.system import CPU_COUNT

        workers = min(CPU_COUNT, count)
        share = os.environ.get(VARIABLE, str(max(1, CPU_COUNT // workers)))
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address=None,
                # Of tasks that were cancelled, and of workers that died, the outcome
                # tells.
                silence_logs=logging.ERROR,
                env={VARIABLE: share},
            ) as cluster,
            Client(cluster) as client,
        ):
            client.register_plugin(_deaf_to_interrupts())
            yield client


def _deaf_to_interrupts() -> Any:
    """Return a plugin by which a worker leaves Ctrl-C to the client of its terminal."""
    import signal
    import threading

    from distributed import WorkerPlugin

    class DeafToInterrupts(WorkerPlugin):  # type: ignore[misc]
        def setup(self, worker: Any) -> None:
            del worker
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGINT, signal.SIG_IGN)

    return DeafToInterrupts()


def _absolute(source: Any) -> Any:
    """Return paths that do not depend on the folder a process runs in."""
    if not isinstance(source, str | os.PathLike):
        return [_absolute(item) for item in source]
    text = os.fspath(source)
    # A separator at the end tells a folder from a file.
    return os.path.abspath(text) + (os.sep if text.endswith(os.sep) else "")  # noqa: PTH100


class Reporter:
    """A task's progress: told to the client, and stopped by it."""

    def __init__(self, topic: str, number: int) -> None:
        from distributed import get_worker

        self._worker = get_worker()
        self._key = self._worker.get_current_task()
        self._topic = topic
        self._number = number
        self._last = 0.0

    def __call__(self, share: float) -> None:
        """Tell that ``share`` of the clip is done."""
        task = self._worker.state.tasks.get(self._key)
        if task is None or task.state == "cancelled":
            raise UnwantedError
        now = time.monotonic()
        if share >= 1 or now - self._last >= SECONDS_BETWEEN_REPORTS:
            self._last = now
            message = {"clip": self._number, "share": share}
            self._worker.log_event(self._topic, message)


def restored_clip(
    number: int,
    source: Any,
    target: Any,
    options: dict[str, Any],
    topic: str,
    *,
    resume: bool,
) -> tuple[ClipResult | None, str | None]:
    """Restore one clip; a task. What is wrong with the clip is told, not raised."""
    share_cores()
    progress = Reporter(topic, number)
    end = time.monotonic() + PATIENCE
    try:
        while True:
            try:
                made = deblur_clip(
                    source, target, resume=True, progress=progress, **options
                )
            except AtWorkError:
                # A worker that was given up may still be ending.
                if time.monotonic() > end:
                    raise
                progress(0.0)
                time.sleep(NAP)
            else:
                return made, None
    except BaseException as failure:
        if not resume:
            discard_part(Path(target))
        if isinstance(failure, FAILURES):
            return None, reason(failure)
        raise
