"""The coarse-to-fine methods' share of `unsmear.optical_flow`: frames, guide, mask."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import (
    as_floating,
    as_picture_array,
    move_channels_last,
    require_ndim,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Steps

__all__ = ["estimate"]

# What the core reads without a copy; others become float64.
_READ_AS_THEY_ARE = tuple(map(np.dtype, ("uint8", "uint16", "float32", "float64")))


def estimate(
    frames: ArrayLike,
    channel_axis: int | None,
    index: Callable[[int], int],
    mask: ArrayLike | None,
    values: dict[str, Any],
    progress: Steps | None,
    method: str,
) -> tuple[
    NDArray[np.float32], NDArray[np.float32], list[int], int, list[dict[str, Any]]
]:
    """Return flow, confidence, shape (T, H, W), reference frame and levels' records.

    Only the frames that the method looks at are read, as they are where the core knows
    their type; ``index`` turns the number of frames into the reference.
    """
    array = as_picture_array(frames, "frames")
    if channel_axis is None:
        require_ndim(
            array, "frames", 3, "(T, H, W) (or say which channel_axis holds colour)"
        )
    else:
        array = move_channels_last(array, channel_axis, "frames")
        require_ndim(array, "frames", 4, "(T, H, W, C) in any order of axes")
    count, height, width = array.shape[:3]
    if count < 2 or 0 in array.shape:
        msg = (
            f"frames must have shape (T >= 2, H >= 1, W >= 1) for method {method!r}, "
            f"got {np.shape(frames)}"
        )
        raise ValueError(msg)
    reference = index(count)
    if reference == count - 1:
        msg = (
            f"index must be before the last of {count} frames, whose motion to the "
            f"next is not in frames; got {reference}"
        )
        raise ValueError(msg)
    reach = values["frames_each_side"]
    first = max(0, reference - reach)
    used = array[first : reference + max(reach, 1) + 1]
    if used.dtype not in _READ_AS_THEY_ARE or not used.flags.aligned:
        used = as_floating(used, "frames", np.float64)
    flow, confidence, levels = _unsmear.coarse_to_fine(
        used[..., np.newaxis] if channel_axis is None else used,
        reference - first,
        values,
        mask=None if mask is None else _as_mask(mask, (height, width)),
        progress=progress,
    )
    names = ("frames", "height", "width", "changes", "evidence", "rest")
    records = [dict(zip(names, level, strict=True)) for level in levels]
    return flow, confidence, [count, height, width], reference, records


def _as_mask(mask: ArrayLike, shape: tuple[int, int]) -> NDArray[np.bool_]:
    array = np.asarray(mask)
    if array.dtype != np.bool_:
        msg = f"mask must be an array of bool, got dtype {array.dtype}"
        raise TypeError(msg)
    if array.shape != shape:
        msg = f"mask must have shape {shape} like a frame, got {array.shape}"
        raise ValueError(msg)
    return np.ascontiguousarray(array)
