"""Progress of long calls, from the core's steps to what a user sees.

A callback takes one number, the share done in [0, 1]. An exception that it raises
cancels the call and is raised unchanged.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, TextIO

from tqdm import tqdm

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    Progress = Callable[[float], object]
    Steps = Callable[[int, int], object]


def of_steps(progress: Progress | None) -> Steps | None:
    """Turn a callback on the share done into one on steps done and steps expected."""
    if progress is None:
        return None

    def report(done: int, expected: int) -> None:
        progress(min(1.0, done / expected) if expected else 0.0)

    return report


class ProgressBar:
    """A bar with the time left on a terminal's last line; silent elsewhere."""

    def __init__(self, label: str, stream: TextIO | None = None) -> None:
        shown = sys.stderr if stream is None else stream
        self._bar = tqdm(
            total=1.0,
            desc=label,
            file=shown,
            disable=not shown.isatty(),
            leave=False,
            bar_format="{desc} {percentage:3.0f}% |{bar}| "
            "{elapsed} < {remaining}{postfix}",
            # Frames take about equally long: the mean of all tells best.
            smoothing=0.0,
        )
        self._begun = False

    def __call__(self, share: float, *, note: str = "") -> None:
        """Show that ``share`` of the work is done, and what is at work."""
        self._bar.set_postfix_str(note, refresh=False)
        if not self._begun and share > 0:
            # What an earlier run has done took no time in this one.
            self._begun = True
            self._bar.reset(total=1.0)
            self._bar.initial = self._bar.n = self._bar.last_print_n = share
        self._bar.update(min(share, 1.0) - self._bar.n)

    def say(self, text: str, stream: TextIO) -> None:
        """Print a line that stays, above the bar."""
        with self._bar.external_write_mode(file=stream):
            print(text, file=stream, flush=True)

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.close()
