"""Velocity and acceleration of every frame of a clip, from the flows both ways.

With d_k where the content of a frame is k frames later, two flows give v = (d_1 -
d_-1) / 2 and A = d_1 + d_-1, wrong by a sixth of the jerk and a twelfth of what
follows. Hands shake fast enough for that to matter: at four frames a turn it is a third
of the velocity. With the flows of the neighbours, d_2 = d_1 + f(p + d_1), the errors of
order three go,

    v += (2 (d_1 - d_-1) - (d_2 - d_-2)) / 12
    A += (4 (d_1 + d_-1) - (d_2 + d_-2)) / 12,

or, with three frames on one side only, v += (3 d_1 + d_-1 - d_2) / 6. The corrections
are smoothed by a Gaussian of 8 px, which also carries them to where a neighbour's flow
is not known. At the ends of a clip one flow is missing; the acceleration of the
neighbour, read off where the content came from, stands in for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import luma
from unsmear.flow import optical_flow
from unsmear.restoration.sampling import composed, inside, pulled_field, smoothed
from unsmear.restoration.stillness import still

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from unsmear.restoration.memo import Memo

    Field = NDArray[np.float32]

__all__ = ["ClipMotion", "Motion"]

LEAST_RETURN, RELATIVE_RETURN = 1.0, 0.1
"""Of the way there and back, px, and as a share of the way: farther is hidden."""
SMOOTHING = 8.0
LEAST_KNOWN = 1e-3
GREATEST_CORRECTION = 0.6
"""Of the speed, plus 1 px: beyond it a neighbour's flow belongs to something else."""


@dataclass(frozen=True)
class Motion:
    """Motion at the middle of one exposure.

    Attributes
    ----------
    velocity, acceleration : ndarray of shape (H, W, 2), float32
        px/frame and px/frame^2, felt by the content. Velocity NaN = unknown.
    everywhere : tuple of two ndarrays of shape (H, W, 2)
        Both as flow says, on ground at rest too (`stillness`): smooth, as those need
        them who look at whole tiles.
    forward, backward : ndarray of shape (H, W, 2) or None
        Flows to the next frame and to the one before.
    """

    velocity: Field
    acceleration: Field
    everywhere: tuple[Field, Field]
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
        one = self._believed(index, index + 1, forward)
        back = self._believed(index, index - 1, backward)
        velocity, acceleration = _unsmear.frame_motion(one, back, given)
        every, _ = _unsmear.frame_motion(forward, backward, given)
        velocity = np.where(np.isnan(velocity), every, velocity)
        if forward is not None and backward is not None:
            after = self.flow(index + 1, index + 2)
            before = self.flow(index - 1, index - 2)
            assert one is not None, "a flow there is, believed or not"
            assert back is not None, "a flow there is, believed or not"
            change, bend = _third_order(one, back, after, before)
            velocity = velocity + _carried_on(change, velocity)
            acceleration = acceleration + _carried_on(bend, velocity)
        ways = ((index + 1, forward), (index - 1, backward))
        others = [(self._luma(j), way) for j, way in ways if way is not None]
        rest = still(self._luma(index), others)[..., np.newaxis]
        everywhere = velocity, acceleration
        if rest.any():
            velocity, acceleration = (
                np.where(rest, np.float32(0), field) for field in everywhere
            )
        return Motion(velocity, acceleration, everywhere, forward, backward)

    def _luma(self, index: int) -> NDArray[np.float32]:
        frame = np.asarray(self._guide(index), np.float64)
        return (luma(frame) if self._axis is not None else frame).astype(np.float32)

    def _believed(self, index: int, other: int, way: Field | None) -> Field | None:
        """Return a flow, NaN where the way there and back does not end at its start.

        What is hidden in the other frame has no motion to it.
        """
        if way is None:
            return None
        back = self.flow(other, index)
        assert back is not None, "a flow has its way back"
        error = np.linalg.norm(composed(way, back), axis=-1)
        tolerance = LEAST_RETURN + RELATIVE_RETURN * np.linalg.norm(way, axis=-1)
        believed = error < tolerance
        # Off the picture nothing contradicts.
        believed |= ~inside(way)
        return np.where(believed[..., np.newaxis], way, np.float32(np.nan))


def _third_order(
    one: Field, back: Field, after: Field | None, before: Field | None
) -> tuple[Field, Field]:
    """Return the corrections of velocity and acceleration; NaN where not known."""
    two = None if after is None else composed(one, after)
    back_two = None if before is None else composed(back, before)
    change, bend = np.zeros_like(one), np.zeros_like(one)
    if two is not None and back_two is not None:
        change[:] = (2 * (one - back) - (two - back_two)) / 12
        bend[:] = (4 * (one + back) - (two + back_two)) / 12
    elif two is not None:
        change[:] = (3 * one + back - two) / 6
    elif back_two is not None:
        change[:] = (back_two - 3 * back - one) / 6
    return change, bend


def _carried_on(correction: Field, velocity: Field) -> Field:
    """Return a correction smoothed, and carried on to where it is not known."""
    limit = 1 + GREATEST_CORRECTION * np.linalg.norm(velocity, axis=-1)
    known = np.linalg.norm(correction, axis=-1) < limit  # false for NaN
    weight = smoothed(known.astype(np.float64), SMOOTHING)
    parts = [
        smoothed(np.where(known, correction[..., part], 0.0), SMOOTHING)
        for part in range(2)
    ]
    mean = np.stack(parts, axis=-1) / np.maximum(weight, LEAST_KNOWN)[..., np.newaxis]
    return np.asarray(mean, np.float32)
