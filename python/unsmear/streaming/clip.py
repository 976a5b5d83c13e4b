"""A clip read frame by frame: few frames in memory, however long it is.

A first pass reads every frame once: it counts them, notes their times, refuses a clip
that is damaged anywhere or whose frames differ in size before any work is done, and
makes a fingerprint (BLAKE2b, RFC 7693) by which an unfinished job knows its source.
After that frames are read again in order, and the last `WINDOW` are kept.

Memory: (WINDOW + 1) frames as they are stored, and what the decoder takes.
"""

from __future__ import annotations

import hashlib
import json
from collections import OrderedDict
from fractions import Fraction
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.frame_files import located
from unsmear.images import describe
from unsmear.streaming.clock import LARGEST_DENOMINATOR, Clock, clock_of
from unsmear.streaming.readers import MILLISECOND, Reader

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from types import TracebackType

    from numpy.typing import NDArray

    from unsmear._progress import Progress
    from unsmear._video_stream import VideoFormat
    from unsmear.frame_files import Source

__all__ = ["WINDOW", "Clip", "open_clip"]

WINDOW = 32
"""Frames kept: restoring looks at most 21 back from the newest it has read."""


class Clip:
    """The frames of a source as a sequence that is read when asked for.

    Made by `open_clip`; a context manager. Reading in order is quick; going back
    farther than `WINDOW` frames starts reading anew.

    Attributes
    ----------
    shape : tuple of int
        (T, H, W) or (T, H, W, 3).
    dtype : numpy.dtype
        uint8, uint16, or floats from TIFF.
    bits : int or None
        Per sample, as stored: 10 for a video of 10 bit, whose samples come scaled to
        16; None for floats.
    clock : Clock
        When frames are shown.
    has_clock : bool
        Whether the source itself says so.
    video : VideoFormat or None
        What the video is.
    extent : tuple of float
        Least and greatest sample; NaN if there is a NaN.
    fingerprint : str
        Of all frames and times.
    """

    def __init__(
        self, reader: Reader, survey: Survey, clock: Clock, *, has_clock: bool
    ) -> None:
        self._reader = reader
        self._first = survey.first
        self.shape: tuple[int, ...] = (survey.count, *survey.first.shape)
        self.dtype = survey.first.dtype
        self.video = reader.video
        self.clock = clock
        self.has_clock = has_clock
        self.extent = survey.extent
        self.fingerprint = survey.fingerprint
        self.bits: int | None = None
        if self.dtype.kind != "f":
            self.bits = self.video.bits if self.video else 8 * self.dtype.itemsize
        self._kept: OrderedDict[int, NDArray[Any]] = OrderedDict()
        self._next = 0
        self._frames: Iterator[tuple[int | None, NDArray[Any]]] | None = None

    def __len__(self) -> int:
        return int(self.shape[0])

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> NDArray[Any]:
        """Return a frame (H, W) or (H, W, 3); not to be written to."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"index must be below {len(self)}, got {index}")
        index %= len(self)
        if index == 0:
            return self._first
        if index not in self._kept:
            self._read_up_to(index)
        return self._kept[index]

    def between(self, start: int, end: int) -> NDArray[Any]:
        """Return the frames from ``start`` up to ``end``, cut to what there is."""
        inside = range(max(0, start), min(len(self), end))
        return np.stack([self[index] for index in inside])

    @property
    def path(self) -> Any:
        """The one file that holds all frames, or None."""
        return self._reader.path

    def close(self) -> None:
        """Stop reading; frames asked for later are read anew."""
        close: Callable[[], None] | None = getattr(self._frames, "close", None)
        if close is not None:
            close()
        self._frames = None

    def __enter__(self) -> Clip:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _read_up_to(self, index: int) -> None:
        ahead = index - self._next
        if self._frames is None or not 0 <= ahead < WINDOW:
            self.close()
            self._next = index
            self._frames = self._reader.frames(index)
        while self._next <= index:
            _, frame = next(self._frames, (None, None))
            if frame is None or describe(frame) != describe(self._first):
                raise ValueError(
                    f"{self._reader.name!r} must not change while it is read, got "
                    f"another frame {self._next}"
                )
            self._kept[self._next] = frame
            self._next += 1
            while len(self._kept) > WINDOW:
                self._kept.popitem(last=False)


class Survey:
    """What the first pass finds: count, times, size, range, fingerprint."""

    def __init__(self, reader: Reader, progress: Progress | None) -> None:
        first: NDArray[Any] | None = None
        self.stamps: list[int | None] = []
        low, high = float("inf"), float("-inf")
        digest = hashlib.blake2b(digest_size=16)
        for stamp, frame in reader.frames():
            if first is None:
                first = np.array(frame)
            if describe(frame) != describe(first):
                raise ValueError(
                    "frames must agree in size, channels and type, got "
                    f"{describe(frame)} in {reader.name_of(len(self.stamps))} after "
                    f"{describe(first)} in {reader.name_of(0)}"
                )
            if frame.dtype.kind == "f":
                # A NaN carries on through both.
                low = float(np.minimum(low, frame.min()))
                high = float(np.maximum(high, frame.max()))
            self.stamps.append(stamp)
            digest.update(np.ascontiguousarray(frame).data)
            if progress is not None:
                progress(0.0)
        if first is None:
            raise ValueError(f"{reader.name!r} must hold frames, got none")
        self.first = first
        self.count = len(self.stamps)
        self.extent = (low, high)
        digest.update(json.dumps([describe(first), self.stamps]).encode())
        self.fingerprint = digest.hexdigest()


def open_clip(
    source: Source | Iterable[Source],
    *,
    fps: float | None = None,
    progress: Progress | None = None,
) -> Clip:
    """Open a clip to be read frame by frame.

    Parameters
    ----------
    source : path-like or iterable of path-like
        As for `unsmear.read_frames`.
    fps : float, optional
        Frames per second of a source without a clock; default 25.
    progress : callable, optional
        Called with 0 for every frame that is checked; an exception it raises cancels
        the call.

    Returns
    -------
    Clip
        A context manager; ``clip[i]`` is a frame, ``len(clip)`` their number.

    Raises
    ------
    ValueError
        If a frame is damaged or differs from the first in size, channels or type, or
        ``fps`` is not positive, or the source has a clock and ``fps`` is given.
    FileNotFoundError, TypeError, ImportError
        As `unsmear.read_frames`.

    Examples
    --------
    >>> import tempfile, numpy as np, unsmear
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     unsmear.write_frames(folder, np.zeros((3, 8, 9), np.uint8))
    ...     with unsmear.open_clip(folder) as clip:
    ...         print(clip.shape, clip[1].dtype)
    (3, 8, 9) uint8
    """
    if fps is not None and not (isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be a positive finite number, got {fps}")
    reader = Reader(located(source))
    survey = Survey(reader, progress)
    video: VideoFormat | None = reader.video
    has_clock = video is not None or survey.stamps[0] is not None
    if has_clock and fps is not None:
        raise ValueError(
            f"fps must be None for {reader.name!r}, which has a clock, got {fps}"
        )
    base = video.time_base if video else MILLISECOND if has_clock else None
    rate = video.rate if video else None
    if fps is not None:
        rate = Fraction(fps).limit_denominator(LARGEST_DENOMINATOR)
    return Clip(
        reader, survey, clock_of(survey.stamps, base, rate), has_clock=has_clock
    )
