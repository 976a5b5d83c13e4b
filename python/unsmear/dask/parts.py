"""Parts of lazy arrays as single blocks, arrays out of blocks, arguments checked.

A task gets the part of an array that it depends on, its halo included, as one block,
whatever the chunks of the array; chunks that several parts overlap are computed once.
Keys are made from what decides the values (names of the arrays, parameters), so that
the same call has the same keys in any process.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import dask.array as da
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Range = tuple[int, int]

__all__ = ["as_frames", "as_lazy", "block", "clipped", "joined", "ranges_of"]


def as_lazy(array: Any, argument: str, ndim: Iterable[int], shape: str) -> Any:
    """Return a dask array of real numbers, checked without computing anything.

    Parameters
    ----------
    array : dask.array.Array
        What came.
    argument : str
        Its name.
    ndim : iterable of int
        Numbers of axes it may have.
    shape : str
        The same in words.

    Raises
    ------
    TypeError
        If it is no dask array, or not of integers or real floats.
    ValueError
        If it has other axes, an empty one, or chunks of unknown size.
    """
    if not isinstance(array, da.Array):
        raise TypeError(
            f"{argument} must be a dask array, got {type(array).__name__}; "
            "dask.array.from_array makes one of what NumPy can index"
        )
    if array.dtype.kind not in "uif":
        raise TypeError(
            f"{argument} must be an array of integers or real floats, "
            f"got dtype {array.dtype}"
        )
    if array.ndim not in tuple(ndim) or any(not n > 0 for n in array.shape):
        raise ValueError(f"{argument} must have shape {shape}, got {array.shape}")
    return array


def as_frames(frames: Any, channel_axis: int | None, least: int) -> Any:
    """Return a stack (T, H, W) or, colour last, (T, H, W, C), T >= ``least``."""
    if channel_axis is None:
        shape = "(T, H, W) (or say which channel_axis holds colour)"
        stack = as_lazy(frames, "frames", (3,), shape)
    else:
        stack = as_lazy(frames, "frames", (4,), "(T, H, W, C) in any order of axes")
        stack = channels_last(stack, channel_axis, "frames")
    if stack.shape[0] < least:
        raise ValueError(
            f"frames must be at least {least} to show motion, got {stack.shape[0]}"
        )
    return stack


def channels_last(array: Any, channel_axis: int, argument: str) -> Any:
    """Return ``array`` with its colour axis last, checked to hold 1 or 3 channels."""
    if not -array.ndim <= channel_axis < array.ndim:
        raise ValueError(
            f"channel_axis must name an axis of {argument} with shape {array.shape}, "
            f"got {channel_axis}"
        )
    colour = da.moveaxis(array, channel_axis, -1)
    if colour.shape[-1] not in (1, 3):
        raise ValueError(
            f"{argument} must have 1 or 3 channels along channel_axis={channel_axis}, "
            f"got shape {array.shape}"
        )
    return colour


def ranges_of(lengths: Sequence[int], end: int | None = None) -> list[Range]:
    """Return from and up to where each chunk goes, cut at ``end``, empty ones out."""
    edges = [int(n) for n in np.cumsum([0, *lengths])]
    last = edges[-1] if end is None else end
    pairs = pairwise(edges)
    return [(start, min(stop, last)) for start, stop in pairs if start < last]


def clipped(part: Range, before: int, after: int, length: int) -> Range:
    """Return a range with ``before`` and ``after`` more, inside ``length``."""
    return max(0, part[0] - before), min(length, part[1] + after)


def block(array: Any, *ranges: Range) -> Any:
    """Return a part of ``array`` as one delayed block; axes not named are whole."""
    part = array[tuple(slice(*one) for one in ranges)].rechunk(-1)
    # Optimised one by one, parts would rename what they share, and compute it twice.
    return part.to_delayed(optimize_graph=False).item()


def joined(blocks: list[Any], shapes: Sequence[tuple[int, ...]], dtype: Any) -> Any:
    """Return delayed blocks, in the order of the first axis, as one array."""
    arrays = [
        da.from_delayed(one, shape, dtype=dtype, name=f"part-{one.key}")
        for one, shape in zip(blocks, shapes, strict=True)
    ]
    return da.concatenate(arrays, axis=0)
