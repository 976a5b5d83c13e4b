"""Pictures as channels (C, H, W) of the core's precision, and back.

Integer pictures of up to 16 bits and floats of up to 32 fit ``float32`` exactly, and
are worked on in it; all others in ``float64``, so that what is copied stays equal bit
for bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import (
    as_floating,
    as_flow,
    as_picture_array,
    as_real_array,
    move_channels_last,
    require_ndim,
    scale_of,
    to_dtype_of,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

WIDEST_EXACT_INTEGER = 2  # bytes: float32 holds 24 bits
WIDEST_EXACT_FLOAT = 4  # bytes

CLIPPED = 254.5 / 255  # of white


class Channels:
    """A picture split into channels, which remembers how to become a picture again.

    Parameters
    ----------
    image : array_like of shape (H, W), or colour with ``channel_axis``
        Integers or floats.
    channel_axis : int or None
        Axis of 1 or 3 colour channels; None for a grey picture.

    Attributes
    ----------
    array : ndarray of shape (C, H, W), float32 or float64
        Integers divided by their type's maximum.
    scale : float
        What that division was by; 1 for floats.
    ceiling : float or None
        Least value of a clipped sample, half an 8-bit step below white; None for
        floats, whose white is not known.
    """

    array: NDArray[np.float32] | NDArray[np.float64]

    def __init__(self, image: ArrayLike, channel_axis: int | None) -> None:
        self._like = as_picture_array(image, "image")
        self._channel_axis = channel_axis
        self.scale = scale_of(np.asanyarray(image).dtype)
        self.ceiling = CLIPPED if self.scale != 1.0 else None
        if channel_axis is None:
            require_ndim(
                self._like, "image", 2, "(H, W) (or say which channel_axis is colour)"
            )
            planes = self._like[np.newaxis]
        else:
            colour = move_channels_last(self._like, channel_axis, "image")
            require_ndim(colour, "image", 3, "(H, W, C) in any order of axes")
            planes = np.moveaxis(colour, -1, 0)
        exact = (
            self._like.dtype.kind in "ui"
            and self._like.dtype.itemsize <= WIDEST_EXACT_INTEGER
        ) or (
            self._like.dtype.kind == "f"
            and self._like.dtype.itemsize <= WIDEST_EXACT_FLOAT
        )
        if exact:
            self.array = as_floating(planes, "image", np.float32)
        else:
            self.array = as_floating(planes, "image", np.float64)

    def flow(self, flow: ArrayLike, argument: str = "flow") -> NDArray[Any]:
        """Return ``flow`` checked against the picture, in the picture's precision."""
        height, width = self.array.shape[1:]
        checked = as_flow(flow, argument)
        if checked.shape[:2] != (height, width):
            msg = (
                f"{argument} must have shape ({height}, {width}, 2) like image, "
                f"got {checked.shape}"
            )
            raise ValueError(msg)
        return checked.astype(self.array.dtype, copy=False)

    def weights(self, weights: ArrayLike) -> NDArray[np.float32]:
        """Return ``weights`` (H, W) in [0, 1], checked against the picture."""
        checked = np.asarray(as_real_array(weights, "weights")[0], np.float32)
        if checked.shape != self.array.shape[1:]:
            msg = (
                f"weights must have shape {self.array.shape[1:]} like image, "
                f"got {checked.shape}"
            )
            raise ValueError(msg)
        if not ((checked >= 0) & (checked <= 1)).all():
            msg = (
                "weights must be in [0, 1] and known everywhere, got values in "
                f"[{checked.min()}, {checked.max()}]"
            )
            raise ValueError(msg)
        return np.ascontiguousarray(checked)

    def restore(self, planes: NDArray[Any]) -> NDArray[Any]:
        """Return (C, H, W) as a picture of the type, range and axes that came."""
        picture = to_dtype_of(planes, self._like)
        if self._channel_axis is None:
            return np.ascontiguousarray(picture[0])
        moved = np.moveaxis(picture, 0, -1)
        return np.ascontiguousarray(np.moveaxis(moved, -1, self._channel_axis))
