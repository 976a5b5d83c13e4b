"""Velocity and acceleration of every frame of a clip, from the flows both ways.

At the ends of a clip one flow is missing; the acceleration of the neighbour, read off
where the content came from, stands in for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear.flow import optical_flow
from unsmear.restoration.sampling import pulled_field

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from unsmear.restoration.memo import Memo

    Field = NDArray[np.float32]

__all__ = ["ClipMotion", "Motion"]


@dataclass(frozen=True)
class Motion:
    """Motion at the middle of one exposure.

    Attributes
    ----------
    velocity, acceleration : ndarray of shape (H, W, 2), float32
        px/frame and px/frame^2, felt by the content. Velocity NaN = unknown.
    forward, backward : ndarray of shape (H, W, 2) or None
        Flows to the next frame and to the one before.
    """

    velocity: Field
    acceleration: Field
    forward: Field | None
    backward: Field | None


class ClipMotion:
    """Motions of a clip, each measured when it is first asked for.

    Parameters
    ----------
    guide : callable
        Returns a frame (H, W[, C]) by its index: what flow is measured on.
    count : int
        Number of frames.
    colour : bool
        Whether frames have a last axis of channels.
    method : str
        Of `unsmear.optical_flow`.
    options : dict
        Its parameters.
    memo : Memo
        Keeps what was computed.
    """

    def __init__(
        self,
        guide: Callable[[int], NDArray[Any]],
        count: int,
        *,
        colour: bool,
        method: str,
        options: dict[str, Any],
        memo: Memo,
    ) -> None:
        self._guide = guide
        self._count = count
        self._axis = 3 if colour else None
        self._method = method
        self._options = options
        self._memo = memo

    def flow(self, start: int, end: int) -> Field | None:
        """Return the flow between two neighbouring frames; None beyond the clip."""
        if not (0 <= start < self._count and 0 <= end < self._count):
            return None
        return self._memo.get(("flow", end), start, lambda: self._measure(start, end))

    def _measure(self, start: int, end: int) -> Field:
        pair = np.stack([self._guide(start), self._guide(end)])
        return optical_flow(
            pair, index=0, method=self._method, channel_axis=self._axis, **self._options
        ).flow

    def motion(self, index: int) -> Motion:
        """Return the motion of a frame."""
        return self._memo.get("motion", index, lambda: self._motion(index))

    def _motion(self, index: int) -> Motion:
        forward, backward = self.flow(index, index + 1), self.flow(index, index - 1)
        given = None
        if self._count > 2 and (forward is None or backward is None):
            way = forward if forward is not None else backward
            neighbour = index + (1 if forward is not None else -1)
            assert way is not None, "a frame of a clip has a neighbour"
            given = pulled_field(self.motion(neighbour).acceleration, way)
        velocity, acceleration = _unsmear.frame_motion(forward, backward, given)
        return Motion(velocity, acceleration, forward, backward)
