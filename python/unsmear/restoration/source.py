"""Frames in grey levels: the one scale on which all steps work.

Integers are scaled by their range to 0..255. Floats may be of any scale: that of the
first frame decides, once for the whole clip so that nothing flickers, such that its
standard deviation becomes 50 grey levels, that of ordinary photographs of 8 bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from unsmear._arrays import (
    as_picture_array,
    luma,
    move_channels_last,
    require_ndim,
    scale_of,
    to_dtype_of,
)
from unsmear.restoration.bars import Bars, bars

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Source"]

GREY_LEVELS = 255.0
CONTRAST = 50.0


class Frames(Protocol):
    """Frames (H, W, C) by their index, in memory or read when asked for."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(T, H, W, C)."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the samples."""

    def __getitem__(self, index: int, /) -> NDArray[Any]:
        """Return a frame."""


class Source:
    """The frames of a clip.

    Parameters
    ----------
    frames : array_like of shape (T, H, W), or colour with ``channel_axis``
        T >= 2.
    channel_axis : int or None
        Axis of 1 or 3 colour channels.

    Attributes
    ----------
    count : int
        T.
    scale : float
        Grey levels per unit of the frames.
    ceiling : float or None
        Grey level from which a sample may be clipped light (`clipping`); None for
        floats, which are not.
    """

    def __init__(self, frames: ArrayLike, channel_axis: int | None) -> None:
        array = as_picture_array(frames, "frames")
        if channel_axis is None:
            require_ndim(
                array, "frames", 3, "(T, H, W) (or say which channel_axis is colour)"
            )
            self._take(array[..., np.newaxis], None)
        else:
            colour = move_channels_last(array, channel_axis, "frames")
            require_ndim(colour, "frames", 4, "(T, H, W, C) in any order of axes")
            self._take(colour, channel_axis)

    @classmethod
    def read_when_needed(cls, frames: Frames) -> Source:
        """Return the source of frames that are not all in memory, channels last.

        Frames come back as (H, W) if there is one channel.
        """
        source = cls.__new__(cls)
        source._take(frames, None if frames.shape[-1] == 1 else 3)
        return source

    def _take(self, frames: Frames, axis: int | None) -> None:
        self._frames = frames
        self._axis = axis
        self.count = frames.shape[0]
        if self.count < 2 or 0 in frames.shape:
            shape = frames.shape[:-1] if axis is None else frames.shape
            msg = f"frames must be at least 2 to show motion, got shape {shape}"
            raise ValueError(msg)
        self.ceiling: float | None
        if frames.dtype.kind == "f":
            known = np.asarray(frames[0], np.float64)
            deviation = float(np.std(known[np.isfinite(known)])) if known.size else 0.0
            self.scale = CONTRAST / deviation if deviation > 0 else 1.0
            self.ceiling = None
        else:
            self.scale = GREY_LEVELS / scale_of(frames.dtype)
            self.ceiling = GREY_LEVELS - 0.5

    def frame(self, index: int) -> NDArray[Any]:
        """Return a frame (H, W, C) as it came."""
        return np.asarray(self._frames[index])

    def planes(self, index: int) -> NDArray[np.float32]:
        """Return a frame's channels (C, H, W), grey levels; NaN = unknown, or a bar."""
        planes = self._recorded(index)
        bars(planes).hide(planes)
        return planes

    def bars(self, index: int) -> Bars:
        """Return the bars of a frame."""
        return bars(self._recorded(index))

    def _recorded(self, index: int) -> NDArray[np.float32]:
        grey = np.moveaxis(np.asarray(self._frames[index], np.float64), -1, 0)
        return np.ascontiguousarray(grey * self.scale, np.float32)

    def guide(self, index: int) -> NDArray[Any]:
        """Return what flow is measured on: a frame, bars NaN; (H, W[, C])."""
        frame = self.frame(index)
        hidden = self.bars(index)
        if any(hidden):
            frame = frame.astype(np.result_type(frame.dtype, np.float32))
            hidden.hide(np.moveaxis(frame, -1, 0))
        return frame[..., 0] if frame.shape[-1] == 1 else frame

    def luma(self, index: int) -> NDArray[np.float32]:
        """Return a frame's luma (H, W), grey levels."""
        return self.luma_of(self.planes(index))

    @staticmethod
    def luma_of(planes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the luma (H, W) of channels (C, H, W)."""
        colour = np.moveaxis(planes, 0, -1).astype(np.float64)
        return np.ascontiguousarray(luma(colour), np.float32)

    def as_came(
        self,
        planes: NDArray[np.float32],
        index: int,
        changed: NDArray[np.bool_],
    ) -> NDArray[Any]:
        """Return channels as a frame like those that came, bit for bit where equal.

        Only samples that are ``changed`` (H, W) are written.
        """
        like = self._frames[index]
        values = np.moveaxis(planes.astype(np.float64), 0, -1) / self.scale
        if like.dtype.kind != "f":
            values = np.nan_to_num(values) / scale_of(like.dtype)
        picture = to_dtype_of(values, like)
        picture = np.where(changed[..., np.newaxis], picture, like)
        if self._axis is None:
            return np.ascontiguousarray(picture[..., 0])
        axes = len(self._frames.shape)
        axis = self._axis % axes
        return np.ascontiguousarray(np.moveaxis(picture, -1, axis - 1))
