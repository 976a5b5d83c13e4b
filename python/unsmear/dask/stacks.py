"""Every frame of a stack restored by itself, its motion given.

A frame is never split: its noise, its scale of grey levels, the strength of the prior
and the scalar products of the solver are those of the whole frame. Of the methods of
`unsmear.deblur` only "wiener" stays local; for that see `tiles`.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import getitem
from typing import TYPE_CHECKING, Any

import dask.array as da
import numpy as np
from dask import delayed
from dask.base import tokenize

from unsmear import _unsmear
from unsmear.dask.cores import share_cores
from unsmear.dask.parts import as_frames, as_lazy, block, joined, ranges_of
from unsmear.dask.sequences import together
from unsmear.deblur import METHODS
from unsmear.deblur import deblur as deblur_one

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LazyRestoration", "deblur"]


@dataclass(frozen=True)
class LazyRestoration:
    """Frames to be restored one by one.

    Attributes
    ----------
    frames : dask array like the frames given
        Restored. NaN where too little is known.
    reports : dask.delayed.Delayed
        The list of the reports of all frames, as `unsmear.DeblurResult.report`.
    """

    frames: Any
    reports: Any


def deblur(
    frames: Any,
    flow: Any,
    *,
    acceleration: Any = None,
    weights: Any = None,
    method: str = "tv",
    channel_axis: int | None = None,
    **options: Any,
) -> LazyRestoration:
    """Remove the blur of a known motion from every frame of a stack, lazily.

    Parameters
    ----------
    frames : dask array of shape (T, H, W), or colour with ``channel_axis``
        Chunked in time as it suits, in space at will.
    flow : dask array of shape (T, H, W, 2), or array_like of shape (H, W, 2)
        Velocity at mid-exposure, px/frame, of each frame or of all; NaN = unknown.
    acceleration : like ``flow``, optional
        Change of the velocity at a fixed pixel, px/frame^2.
    weights : dask array of shape (T, H, W), or array_like of shape (H, W), optional
        How far each pixel is to be believed, in [0, 1].
    method : str, default "tv"
        One of `unsmear.deblur`.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: grey.
    **options
        ``exposure``, ``turn``, ``noise``, ``regularization``, ``gamma``, ``degree``:
        as for `unsmear.deblur`.

    Returns
    -------
    LazyRestoration
        What `unsmear.deblur` makes of every frame, bit for bit; chunked in time like
        ``frames``, whole in space.

    Raises
    ------
    TypeError
        If a stack is no dask array of real numbers, or an option is not known.
    ValueError
        If shapes do not match or ``method`` is not known. Other options are looked at
        when frames are computed, and raise then what `unsmear.deblur` raises.

    References
    ----------
    See `unsmear.deblur`.

    Examples
    --------
    >>> import dask.array as da, numpy as np, unsmear, unsmear.dask
    >>> sharp = np.stack([unsmear.synthetic.texture((40, 48), seed=s) for s in (1, 2)])
    >>> flow = np.full((40, 48, 2), (4.0, 1.0))
    >>> blurred = np.stack([unsmear.blur(one, flow) for one in sharp])
    >>> lazy = unsmear.dask.deblur(
    ...     da.from_array(blurred, chunks=(1, -1, -1)), flow, method="fast")
    >>> alone = unsmear.deblur(blurred[1], flow, method="fast").image
    >>> bool((lazy.frames[1].compute() == alone).all())
    True
    """
    known = ("exposure", "turn", "noise", "regularization", "gamma", "degree")
    for name in options:
        if name not in known:
            raise TypeError(f"option must be one of {', '.join(known)}, got {name!r}")
    if method not in METHODS:
        names = ", ".join(repr(name) for name in METHODS)
        raise ValueError(f"method must be one of {names}, got {method!r}")
    stack = as_frames(frames, channel_axis, 1)
    fields = {
        "flow": _field(flow, stack, "flow", 2),
        "acceleration": _field(acceleration, stack, "acceleration", 2),
        "weights": _field(weights, stack, "weights", None),
    }
    settings = options | {"method": method}
    token = tokenize(
        stack.name,
        [getattr(field, "name", field) for field in fields.values()],
        settings,
        _unsmear.__version__,
    )
    made, shapes = [], []
    for part in ranges_of(stack.chunks[0]):
        near = {
            name: block(field, part) if isinstance(field, da.Array) else field
            for name, field in fields.items()
        }
        made.append(
            delayed(restored, pure=True)(
                block(stack, part),
                near["flow"],
                near["acceleration"],
                near["weights"],
                settings,
                dask_key_name=f"alone-{token}-{part[0]}",
            )
        )
        shapes.append((part[1] - part[0], *stack.shape[1:]))
    pictures = joined(
        [
            delayed(getitem, pure=True)(one, 0, dask_key_name=f"{one.key}-0")
            for one in made
        ],
        shapes,
        stack.dtype.newbyteorder("="),
    )
    if channel_axis is not None:
        pictures = da.moveaxis(pictures, -1, channel_axis)
    reports = delayed(together, pure=True)(
        [delayed(getitem, pure=True)(one, 1) for one in made],
        dask_key_name=f"reports-{token}",
    )
    return LazyRestoration(pictures, reports)


def _field(field: Any, stack: Any, argument: str, parts: int | None) -> Any:
    """Return a field of each frame (lazy) or of all (delayed once), or None."""
    if field is None:
        return None
    shape = stack.shape[1:3] if parts is None else (*stack.shape[1:3], parts)
    if isinstance(field, da.Array):
        wanted = (stack.shape[0], *shape)
        one = as_lazy(field, argument, (len(wanted),), str(wanted))
        got = one.shape
    else:
        wanted, one = shape, np.asarray(field)
        got = one.shape
    if got != wanted:
        raise ValueError(f"{argument} must have shape {wanted}, got {got}")
    return one if isinstance(one, da.Array) else delayed(one, pure=True)


def restored(
    frames: NDArray[Any],
    flow: NDArray[Any],
    acceleration: NDArray[Any] | None,
    weights: NDArray[Any] | None,
    settings: dict[str, Any],
) -> tuple[NDArray[Any], list[dict[str, Any]]]:
    """Return the frames (n, H, W[, C]) restored one by one, and their reports."""
    share_cores()
    colour = frames.ndim == 4
    pictures = np.empty(frames.shape, frames.dtype.newbyteorder("="))
    reports = []
    for index, frame in enumerate(frames):
        result = deblur_one(
            frame,
            _of_frame(flow, 3, index),
            acceleration=_of_frame(acceleration, 3, index),
            weights=_of_frame(weights, 2, index),
            channel_axis=2 if colour else None,
            **settings,
        )
        pictures[index] = result.image
        reports.append(result.report)
    return pictures, reports


def _of_frame(field: NDArray[Any] | None, ndim: int, index: int) -> Any:
    """Return a frame's part of a field that is of each frame or of all."""
    return field if field is None or field.ndim == ndim else field[index]
