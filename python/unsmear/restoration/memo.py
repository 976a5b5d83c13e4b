"""What was computed for frames, kept as long as frames to come may need it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

__all__ = ["Memo"]

Value = TypeVar("Value")


class Memo:
    """Values by kind and frame."""

    def __init__(self) -> None:
        self._values: dict[tuple[Hashable, int], Any] = {}

    def get(self, kind: Hashable, index: int, compute: Callable[[], Value]) -> Value:
        """Return the value, computed when it is first asked for."""
        key = (kind, index)
        if key not in self._values:
            self._values[key] = compute()
        return cast("Value", self._values[key])

    def forget_before(
        self, index: int, spared: Hashable = None, spared_from: int = 0
    ) -> None:
        """Drop what belongs to frames before ``index``.

        Values of the kind ``spared`` stay for frames from ``spared_from`` on.
        """
        for kind, frame in list(self._values):
            if frame < (min(index, spared_from) if kind == spared else index):
                del self._values[kind, frame]

    def __len__(self) -> int:
        """Return how many values are kept."""
        return len(self._values)
