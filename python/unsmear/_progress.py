"""Progress of long calls, from the core's steps to what a user sees.

A callback takes one number, the share done in [0, 1]. An exception that it raises
cancels the call and is raised unchanged.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    Progress = Callable[[float], object]
    Steps = Callable[[int, int], object]

_WIDTH = 24
_REDRAW = 0.1  # seconds


def of_steps(progress: Progress | None) -> Steps | None:
    """Turn a callback on the share done into one on steps done and steps expected."""
    if progress is None:
        return None

    def report(done: int, expected: int) -> None:
        progress(min(1.0, done / expected) if expected else 0.0)

    return report


class ProgressBar:
    """A bar on a terminal's last line; silent when the stream is not a terminal."""

    def __init__(self, label: str, stream: TextIO | None = None) -> None:
        self._label = label
        self._stream = sys.stderr if stream is None else stream
        self._shown = self._stream.isatty()
        self._start = time.monotonic()
        self._drawn = float("-inf")

    def __call__(self, share: float) -> None:
        """Show that ``share`` of the work is done."""
        now = time.monotonic()
        if not self._shown or (share < 1 and now - self._drawn < _REDRAW):
            return
        self._drawn = now
        full = round(share * _WIDTH)
        bar = "#" * full + "." * (_WIDTH - full)
        seconds = now - self._start
        left = f"{seconds * (1 / share - 1):4.0f} s left" if share > 0 else ""
        self._stream.write(f"\r{self._label} [{bar}] {share:4.0%} {left}\x1b[K")
        self._stream.flush()

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
