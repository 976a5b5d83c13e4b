"""Ways to restore the frames of a clip, one after the other.

`by_the_chain` is what `unsmear.deblur_sequence` does, frame for frame the same: its
exposures are pooled over a window of frames, not over the clip. `one_by_one` restores
every frame by itself with one of the methods of `unsmear.deblur`, given its velocity.
Both look at a bounded number of frames around the one they restore.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._parameters import merged
from unsmear.deblur import deblur
from unsmear.flow import optical_flow
from unsmear.restoration.source import Source
from unsmear.sequence import restored_frames
from unsmear.velocity import velocity_of_frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from unsmear.restoration.records import Settings
    from unsmear.streaming.clip import Clip

    Restored = tuple[NDArray[Any], NDArray[np.float32], dict[str, Any]]

__all__ = ["by_the_chain", "confidence_between", "frames_for_flow", "one_by_one"]

POOLING = ("least-squares", "fleet-jepson", "thesis")
POOLED = 15
"""Frames for flow methods that pool all they are given: they fill the longest of their
windows."""


class _WithChannels:
    """The frames of a clip as (H, W, C)."""

    def __init__(self, clip: Clip) -> None:
        self._clip = clip
        self.dtype = clip.dtype
        self.shape = clip.shape if len(clip.shape) == 4 else (*clip.shape, 1)

    def __getitem__(self, index: int, /) -> NDArray[Any]:
        frame = self._clip[index]
        return frame if frame.ndim == 3 else frame[..., np.newaxis]


def by_the_chain(
    clip: Clip,
    start: int,
    settings_at: Callable[[float], Settings],
    *,
    second_pass: bool | None,
) -> Iterator[Restored]:
    """Yield frame, velocity and report from number ``start`` on.

    ``settings_at`` takes the grey levels per unit of the frames.
    """
    source = Source.read_when_needed(_WithChannels(clip))
    wanted = list(range(start, len(clip)))
    settings = settings_at(source.scale)
    return restored_frames(source, wanted, settings, second_pass=second_pass)


def one_by_one(
    clip: Clip,
    start: int,
    *,
    flow: NDArray[np.float32] | None,
    flow_method: str,
    flow_parameters: dict[str, Any],
    **options: Any,
) -> Iterator[Restored]:
    """Yield frame, velocity and report from number ``start`` on.

    ``flow`` is the velocity of all frames; None = measured. The ``options`` are those
    of `unsmear.deblur`.
    """
    colour = len(clip.shape) == 4
    # What is measured in the frames themselves runs along their blur.
    options |= {"turn": 0.0 if flow is None else "auto"}
    for index in range(start, len(clip)):
        velocity = flow
        if velocity is None:
            first, end = frames_for_flow(
                flow_method, flow_parameters, index, len(clip), POOLED
            )
            velocity, _ = velocity_of_frame(
                clip.between(first, end),
                index - first,
                method=flow_method,
                channel_axis=3 if colour else None,
                **flow_parameters,
            )
        result = deblur(
            clip[index], velocity, channel_axis=2 if colour else None, **options
        )
        yield result.image, velocity, result.report


def confidence_between(
    clip: Clip, index: int, flow_method: str, flow_parameters: dict[str, Any]
) -> NDArray[np.float32] | None:
    """Return how far the motion between a frame and its neighbour can be trusted.

    None for methods that pool many frames, and for a frame alone.
    """
    if flow_method in POOLING or len(clip) == 1:
        return None
    neighbour = index + 1 if index + 1 < len(clip) else index - 1
    pair = np.stack([clip[index], clip[neighbour]])
    axis = 3 if len(clip.shape) == 4 else None
    found = optical_flow(
        pair, index=0, method=flow_method, channel_axis=axis, **flow_parameters
    )
    return found.confidence


def frames_for_flow(
    method: str, parameters: dict[str, Any], index: int, count: int, pooled: int
) -> tuple[int, int]:
    """Return from and up to which frame a method needs to measure flow at ``index``.

    Methods that pool what they are given take ``pooled`` frames of the ``count``.
    """
    if method in POOLING:
        first = max(0, min(index - pooled // 2, count - pooled))
        return first, min(count, first + pooled)
    reach = 1 + merged(method, parameters)["frames_each_side"]
    return max(0, index - reach), min(count, index + reach + 1)
