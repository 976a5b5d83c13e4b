"""Coercion of what users pass into what the core takes, once, with errors that help.

Every array that enters is checked here and becomes C-contiguous native ``float32`` or
``float64``; the input is never written to. Integer images are divided by the largest
value of their type, so that 8 and 16 bit copies of one picture are the same picture;
floating images are left alone. Masked samples become NaN, which means *unknown*.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Floating = TypeVar("Floating", np.float32, np.float64)

# Rec. 601 luma: the weights of the grey channel in cameras' video and in the field's
# benchmarks.
LUMA = (0.299, 0.587, 0.114)


def as_real_array(array: ArrayLike, argument: str) -> tuple[NDArray[Any], float]:
    """Return ``array`` as real numbers, unscaled, and the value that stands for white.

    Masked samples become NaN, for which integers become floats; the scale is that of
    the type that came.
    """
    result = np.asanyarray(array)
    if result.dtype.kind not in "uif":
        msg = (
            f"{argument} must be an array of integers or real floats, "
            f"got dtype {result.dtype}"
        )
        raise TypeError(msg)
    scale = scale_of(result.dtype)
    if not isinstance(result, np.ma.MaskedArray):
        return np.asarray(result), scale
    if not np.ma.is_masked(result):
        return np.asarray(result.data), scale
    floats = result if result.dtype.kind == "f" else result.astype(np.float64)
    return np.asarray(np.ma.filled(floats, np.nan)), scale


def as_picture_array(array: ArrayLike, argument: str) -> NDArray[Any]:
    """Return ``array`` as a real numeric array, masked samples as NaN.

    Integers with masked samples become floats and are divided by their type's maximum.
    """
    result, scale = as_real_array(array, argument)
    return result / scale if result.dtype.kind == "f" and scale != 1.0 else result


def scale_of(dtype: np.dtype[Any]) -> float:
    """Return the value that stands for white: the type's largest integer, or 1."""
    return float(np.iinfo(dtype).max) if dtype.kind in "ui" else 1.0


def as_floating(
    array: ArrayLike, argument: str, dtype: type[Floating]
) -> NDArray[Floating]:
    """Return ``array`` as packed ``dtype``, integers divided by the type's maximum."""
    picture = as_picture_array(array, argument)
    scale = scale_of(picture.dtype)
    if scale == 1.0:
        return np.ascontiguousarray(picture, dtype=dtype)
    return np.ascontiguousarray(picture.astype(np.float64) / scale, dtype=dtype)


def to_dtype_of(result: NDArray[Any], like: NDArray[Any]) -> NDArray[Any]:
    """Return ``result`` (scaled like `as_floating`) in type and range of ``like``.

    Integers are rounded and clipped; a NaN, which an integer cannot say, is refused.
    """
    if like.dtype.kind == "f":
        return result.astype(like.dtype.newbyteorder("="), copy=False)
    scale = scale_of(like.dtype)
    if np.isnan(result).any():
        msg = f"cannot store unknown (NaN) pixels as {like.dtype}: pass a float image"
        raise ValueError(msg)
    low = float(np.iinfo(like.dtype).min)
    rounded = np.rint(np.clip(result.astype(np.float64) * scale, low, scale))
    return rounded.astype(like.dtype.newbyteorder("="))


def require_ndim(array: NDArray[Any], argument: str, ndim: int, shape: str) -> None:
    """Raise ``ValueError`` unless ``array`` has ``ndim`` axes."""
    if array.ndim != ndim:
        msg = f"{argument} must have shape {shape}, got {array.shape}"
        raise ValueError(msg)


def as_grey_frames(
    frames: ArrayLike,
    channel_axis: int | None,
    dtype: type[Floating],
    *,
    argument: str = "frames",
) -> NDArray[Floating]:
    """Return a sequence as grey (T, H, W).

    ``channel_axis`` names the axis of the 3 colour channels (or of 1 grey channel);
    colour is never guessed from a shape.
    """
    array = as_picture_array(frames, argument)
    if channel_axis is None:
        require_ndim(
            array, argument, 3, "(T, H, W) (or say which channel_axis holds colour)"
        )
        return as_floating(array, argument, dtype)
    colour = move_channels_last(array, channel_axis, argument)
    require_ndim(colour, argument, 4, "(T, H, W, C) in any order of axes")
    return np.ascontiguousarray(luma(as_floating(colour, argument, np.float64)), dtype)


def move_channels_last(
    array: NDArray[Any], channel_axis: int, argument: str
) -> NDArray[Any]:
    """Return ``array`` with its colour axis last, checked to hold 1 or 3 channels."""
    if not -array.ndim <= channel_axis < array.ndim:
        msg = (
            f"channel_axis must name an axis of {argument} with shape {array.shape}, "
            f"got {channel_axis}"
        )
        raise ValueError(msg)
    colour = np.moveaxis(array, channel_axis, -1)
    if colour.shape[-1] not in (1, 3):
        msg = (
            f"{argument} must have 1 or 3 channels along channel_axis={channel_axis}, "
            f"got shape {array.shape}"
        )
        raise ValueError(msg)
    return colour


def luma(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Rec. 601 luma of (..., 3), or the one channel of (..., 1)."""
    if colour.shape[-1] == 1:
        return colour[..., 0]
    red, green, blue = LUMA
    # Written out, not as a matrix product: the same sum in the same order everywhere.
    return red * colour[..., 0] + green * colour[..., 1] + blue * colour[..., 2]


def as_flow(flow: ArrayLike, argument: str = "flow") -> NDArray[np.float32]:
    """Return a flow field (H, W, 2) as packed float32, integers unscaled."""
    array, _ = as_real_array(flow, argument)
    if array.ndim != 3 or array.shape[-1] != 2:
        msg = f"{argument} must have shape (H, W, 2), got {array.shape}"
        raise ValueError(msg)
    return np.ascontiguousarray(array, dtype=np.float32)
