"""Motion of every frame of a stack, chunk by chunk in time.

Over time flow is local: it depends on frame t and t + 1, and on ``frames_each_side``
more where a method uses several, and a chunk gets exactly those. Over space it is not:
the pyramid, the smoothness and the light and noise of the whole frame couple all
pixels, and no halo makes tiles equal to the frame. So a frame is never split.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from dask import delayed
from dask.base import tokenize

from unsmear import _unsmear
from unsmear._parameters import merged
from unsmear.dask.cores import share_cores
from unsmear.dask.parts import as_frames, block, clipped, joined, ranges_of
from unsmear.flow import optical_flow as flow_of_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["FlowStack", "optical_flow"]


@dataclass(frozen=True)
class FlowStack:
    """Motion of the frames of a stack, each to the next; dask arrays.

    Attributes
    ----------
    flow : dask array of shape (T - 1, H, W, 2), float32
        ``(u, v)``, right and down, px/frame; NaN where nothing is known.
    confidence : dask array of shape (T - 1, H, W), float32
        In [0, 1]; 0 where the flow is unknown.
    valid : dask array of shape (T - 1, H, W), bool
        Where the flow is known.
    """

    flow: Any
    confidence: Any
    valid: Any


def optical_flow(
    frames: Any,
    *,
    method: str = "balanced",
    channel_axis: int | None = None,
    **parameters: Any,
) -> FlowStack:
    """Measure the motion between all neighbouring frames of a stack, lazily.

    Parameters
    ----------
    frames : dask array of shape (T, H, W), or colour with ``channel_axis``
        T >= 2, time first; chunked in time as it suits, in space at will.
    method : {"balanced", "fast", "accurate", "steady", "steady-accurate"}
        As for `unsmear.optical_flow`. The other methods there standardise all frames
        they are given together, so that what they find depends on all: give those
        the frames you mean, in memory.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: grey.
    **parameters
        Parameters of the method.

    Returns
    -------
    FlowStack
        ``flow[t]`` is that of ``unsmear.optical_flow(frames, index=t)``, bit for bit.
        Chunked in time like ``frames`` but for the last frame, whole in space.

    Raises
    ------
    TypeError
        If ``frames`` is no dask array of real numbers, or a parameter has the wrong
        type.
    ValueError
        Another method, too few frames, a shape or a parameter out of range.

    Notes
    -----
    A task holds the frames of its chunk, one more (``frames_each_side`` more before
    and behind), and three float32 planes per frame of results.

    References
    ----------
    See `unsmear.optical_flow`.

    Examples
    --------
    >>> import dask.array as da, numpy as np, unsmear, unsmear.dask
    >>> stack = unsmear.synthetic.translation(
    ...     unsmear.synthetic.texture((80, 80), seed=1), (1.5, -0.5), shape=(48, 48),
    ...     n_frames=5).sharp
    >>> lazy = unsmear.dask.optical_flow(da.from_array(stack, chunks=(2, -1, -1)))
    >>> lazy.flow.shape, lazy.flow.chunks[0]
    ((4, 48, 48, 2), (2, 2))
    >>> whole = unsmear.optical_flow(stack, index=3).flow
    >>> bool((lazy.flow[3].compute() == whole).all())
    True
    """
    values = merged(method, parameters)
    if "frames_each_side" not in values:
        raise ValueError(
            "method must be one that looks at a few frames only ('fast', 'balanced', "
            f"'accurate', 'steady', 'steady-accurate'), got {method!r}"
        )
    stack = as_frames(frames, channel_axis, 2)
    reach = values["frames_each_side"]
    count, height, width = stack.shape[:3]
    token = tokenize(stack.name, method, values, _unsmear.__version__)
    blocks, shapes = [], []
    for part in ranges_of(stack.chunks[0], count - 1):
        seen = clipped(part, reach, max(reach, 1), count)
        blocks.append(
            delayed(measured, pure=True)(
                block(stack, seen),
                part[0] - seen[0],
                part[1] - part[0],
                method,
                parameters,
                dask_key_name=f"flow-{token}-{part[0]}",
            )
        )
        shapes.append((part[1] - part[0], height, width, 3))
    planes = joined(blocks, shapes, np.float32)
    flow = planes[..., :2]
    return FlowStack(flow, planes[..., 2], ~np.isnan(flow).any(axis=-1))


def measured(
    frames: NDArray[Any],
    first: int,
    count: int,
    method: str,
    parameters: dict[str, Any],
) -> NDArray[np.float32]:
    """Return flow and confidence (``count``, H, W, 3) from frame ``first`` on."""
    share_cores()
    planes = np.empty((count, *frames.shape[1:3], 3), np.float32)
    for number, out in enumerate(planes):
        result = flow_of_frame(
            frames,
            index=first + number,
            method=method,
            channel_axis=3 if frames.ndim == 4 else None,
            **parameters,
        )
        out[..., :2], out[..., 2] = result.flow, result.confidence
    return planes
