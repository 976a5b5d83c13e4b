"""Velocity at the middle of a frame's exposure: what blurs it.

Flow tells where a pixel goes until the next frame. What blurs frame i is its velocity
at time i, to second order the mean of the flow forwards and the negative flow
backwards,

    v(i) = (f(i -> i + 1) - f(i -> i - 1)) / 2      px/frame,

one of them at the ends of a sequence and where the other is unknown. The methods that
look at frames on both sides measure it by themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.flow import FlowResult, optical_flow

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["velocity_of_frame"]

_FORWARD_METHODS = ("fast", "balanced", "accurate")
_SYMMETRIC_METHODS = ("steady", "steady-accurate")


def velocity_of_frame(
    frames: NDArray[Any], index: int, *, method: str = "balanced", **options: Any
) -> tuple[NDArray[np.float32], FlowResult]:
    """Measure the velocity that blurs one frame.

    Parameters
    ----------
    frames : ndarray of shape (T, H, W), or colour with ``channel_axis`` in ``options``
        At least 2, time first.
    index : int
        The frame, counted from the start.
    method : str, default "balanced"
        A flow method; see `unsmear.optical_flow`, which takes ``options`` too.

    Returns
    -------
    velocity : ndarray of shape (H, W, 2), float32
        px/frame; NaN where nothing is known.
    result : FlowResult
        The flow it comes from: to the next frame, or from the last one back.

    Raises
    ------
    ValueError
        Fewer than 2 frames, or what `unsmear.optical_flow` raises.
    """
    count = len(frames)
    if count < 2:
        msg = f"frames must be at least 2 to show motion, got {count}"
        raise ValueError(msg)
    if method not in (*_FORWARD_METHODS, *_SYMMETRIC_METHODS):
        result = optical_flow(frames, index=index, method=method, **options)
        return result.flow, result
    if method in _SYMMETRIC_METHODS and index < count - 1:
        result = optical_flow(frames, index=index, method=method, **options)
        return result.flow, result
    ways = []
    if index < count - 1:
        pair = frames[index : index + 2]
        ways.append(optical_flow(pair, index=0, method=method, **options))
    if index > 0:
        pair = frames[index - 1 : index + 1][::-1]
        ways.append(optical_flow(pair, index=0, method=method, **options))
    signs = (1, -1) if index < count - 1 else (-1,)
    flows = [sign * way.flow for sign, way in zip(signs, ways, strict=False)]
    if len(flows) == 1:
        return flows[0], ways[0]
    forward, backward = flows
    mean = (forward + backward) / 2
    mean = np.where(np.isnan(mean), forward, mean)
    return np.where(np.isnan(mean), backward, mean).astype(np.float32), ways[0]
