"""Frames of a source one after the other, from any of them on.

| source            | read                                                         |
|-------------------|--------------------------------------------------------------|
| files             | each when its turn comes                                     |
| TIFF stack        | page by page; whole if its pages cannot be told apart        |
| animation         | GIF, PNG and WebP, frame by frame                            |
| video             | by the decoder in its own process; passing over costs        |
|                   | decoding, not conversion                                     |

A reader yields pairs: the time at which the frame is shown, in units of the source's
time base (None without a clock), and the frame (H, W) or (H, W, 3) as it is stored.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from PIL import Image

from unsmear._containers import is_whole
from unsmear._tiff import tiff_frames
from unsmear._video_stream import VideoFormat, VideoStream
from unsmear.frame_files import is_video
from unsmear.images import (
    TIFF_SUFFIXES,
    decoding,
    describe,
    read_stack,
    samples_of_page,
)
from unsmear.sequences import read_single

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Timed = tuple[int | None, NDArray[Any]]

__all__ = ["Reader"]

MILLISECOND = Fraction(1, 1000)
"""Time base of animations, in seconds."""
SHOWN_FAST, SHOWN_INSTEAD = 10, 100
"""Frames shown for no longer than the one viewers show for the other, ms."""


class Reader:
    """The frames of a source, read as often as asked for.

    Parameters
    ----------
    files : pathlib.Path or list of pathlib.Path
        What `frame_files.located` finds.

    Attributes
    ----------
    video : VideoFormat or None
        What the video is, once its first frame was read.
    """

    def __init__(self, files: Path | list[Path]) -> None:
        self._files = files
        self.video: VideoFormat | None = None

    @property
    def path(self) -> Path | None:
        """The one file that holds all frames, if there is one."""
        return None if isinstance(self._files, list) else self._files

    @property
    def name(self) -> str:
        """The source, for messages."""
        if isinstance(self._files, list):
            return str(self._files[0].parent)
        return str(self._files)

    def name_of(self, index: int) -> str:
        """Return where frame ``index`` is, for messages."""
        if isinstance(self._files, list):
            return repr(str(self._files[index]))
        return f"frame {index} of {self.name!r}"

    def frames(self, start: int = 0) -> Iterator[Timed]:
        """Yield the frames from number ``start`` on.

        Raises
        ------
        ValueError
            If the source is damaged, empty, or no picture or video; names the file.
        """
        if isinstance(self._files, list):
            return ((None, read_single(path)) for path in self._files[start:])
        if is_video(self._files):
            return self._decoded(self._files, start)
        return _stacked(self._files, start)

    def _decoded(self, path: Path, start: int) -> Iterator[Timed]:
        with VideoStream(path, start) as stream:
            self.video = stream.format
            yield from stream


def _stacked(path: Path, start: int) -> Iterator[Timed]:
    """Yield the pictures of one file."""
    if path.stat().st_size == 0:
        raise ValueError(f"cannot read {str(path)!r}: the file is empty")
    if not is_whole(path):
        raise ValueError(f"cannot read {str(path)!r}: the file is cut off")
    with decoding(path):
        if path.suffix.lower() in TIFF_SUFFIXES:
            pages = tiff_frames(path, start)
            if pages is not None:
                yield from ((None, page) for page in pages)
                return
        elif _pictures_in(path) > 1:
            yield from _animated(path, start)
            return
    yield from ((None, picture) for picture in read_stack(path)[start:])


def _pictures_in(path: Path) -> int:
    with Image.open(path) as picture:
        # A photograph with previews behind it is one picture.
        return 1 if picture.format == "MPO" else int(getattr(picture, "n_frames", 1))


def _animated(path: Path, start: int) -> Iterator[Timed]:
    with Image.open(path) as picture:
        time, first = 0, ""
        for number in range(int(picture.n_frames)):  # type: ignore[attr-defined]
            picture.seek(number)
            if number >= start:
                page = samples_of_page(picture, always_colour=picture.format == "GIF")
                first = first or describe(page)
                if describe(page) != first:
                    msg = f"frame {number} is {describe(page)} after {first}"
                    raise ValueError(msg)
                yield time, page
            shown = int(picture.info.get("duration", 0))
            time += shown if shown > SHOWN_FAST else SHOWN_INSTEAD
