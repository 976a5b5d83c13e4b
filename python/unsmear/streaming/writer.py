"""Frames into files, piece by piece; videos have their own module.

| target  | piece                       | the whole                                    |
|---------|-----------------------------|----------------------------------------------|
| folder  | a PNG of 8 or 16 bit        | the folder, renamed or filled file by file   |
| .tif    | samples as they are         | uncompressed pages, every type kept          |
| .gif    | a frame with its palette    | header, frames, trailer; delays kept         |

A piece and the whole are the same bytes whenever they are made.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._atomic import put_in_place, replaceable
from unsmear._gif import GIF_TAIL, HUNDREDTHS, gif_frame, gif_head
from unsmear._tiff import write_tiff_frames
from unsmear.images import as_integers, encode_picture
from unsmear.sequences import names_in_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from unsmear.streaming.clip import Clip

__all__ = ["FolderWriter", "GifWriter", "TiffWriter", "Writer"]


WHOLE = "whole"
"""Where the files of a folder are gathered that does not exist yet."""


class Writer(ABC):
    """What turns frames into a target.

    Attributes
    ----------
    length : int
        Frames per piece.
    suffix : str
        Of a piece.
    warnings : list of str
        What of the source the target does not hold.
    """

    length = 1
    suffix = ""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return what decides the bytes, beside the frames."""

    @abstractmethod
    def write_piece(self, path: Path, frames: Iterable[NDArray[Any]]) -> None:
        """Write a piece of up to `length` frames."""

    @abstractmethod
    def assemble(self, pieces: Sequence[Path], target: Path) -> None:
        """Make the whole file out of its pieces."""

    def check_target(self, target: Path) -> None:
        """Raise before any work what would fail after it."""
        replaceable(target)

    def try_out(self, folder: Path) -> None:
        """Raise what of the first frame would fail."""
        del folder

    def places(self, number: int, target: Path, folder: Path) -> list[Path]:
        """Return where a piece may stand while the whole is being put in place."""
        del number, target, folder
        return []

    def publish(self, pieces: Sequence[Path], target: Path, folder: Path) -> None:
        """Assemble the whole in ``folder`` and give it its name."""
        whole = folder / f".tmp-whole{target.suffix}"
        self.assemble(pieces, whole)
        put_in_place(whole, replaceable(target))


class FolderWriter(Writer):
    """Writes ``frame_0000.png``, ... into a folder."""

    suffix = ".png"

    def __init__(self, clip: Clip, target: Path) -> None:
        super().__init__()
        self._names = names_in_folder(target, len(clip))
        require_unit_range(clip)

    def describe(self) -> dict[str, Any]:
        """Return what decides the bytes, beside the frames."""
        return {"suffix": "folder"}

    def write_piece(self, path: Path, frames: Iterable[NDArray[Any]]) -> None:
        """Write a piece."""
        for frame in frames:
            samples = as_integers(in_unit_range(frame), "frames", None)
            path.write_bytes(encode_picture(samples, "PNG"))

    def check_target(self, target: Path) -> None:
        """Raise before any work what would fail after it."""
        if target.exists() and not target.is_dir():
            msg = f"target must be a folder, got the file {str(target)!r}"
            raise ValueError(msg)

    def places(self, number: int, target: Path, folder: Path) -> list[Path]:
        """Return where a piece stands while the folder is being filled."""
        name = self._names[number]
        return [folder / WHOLE / name, target / name]

    def assemble(self, pieces: Sequence[Path], target: Path) -> None:
        """Make the whole out of its pieces."""
        target.mkdir(exist_ok=True)
        for name, piece in zip(self._names, pieces, strict=True):
            if piece != target / name:
                os.replace(piece, target / name)  # noqa: PTH105 -- atomic

    def publish(self, pieces: Sequence[Path], target: Path, folder: Path) -> None:
        """Fill the folder, or give its name to one made beside it."""
        if target.exists():
            self.assemble(pieces, target)
        else:
            self.assemble(pieces, folder / WHOLE)
            (folder / WHOLE).rename(target)


class TiffWriter(Writer):
    """Writes a multi-page TIFF."""

    suffix = ".npy"

    def __init__(self, clip: Clip) -> None:
        super().__init__()
        self._shape, self._dtype = clip.shape, clip.dtype

    def describe(self) -> dict[str, Any]:
        """Return what decides the bytes, beside the frames."""
        return {"suffix": ".tif"}

    def write_piece(self, path: Path, frames: Iterable[NDArray[Any]]) -> None:
        """Write a piece."""
        for frame in frames:
            np.save(path, frame, allow_pickle=False)

    def assemble(self, pieces: Sequence[Path], target: Path) -> None:
        """Make the whole out of its pieces."""
        frames = (np.load(piece, allow_pickle=False) for piece in pieces)
        write_tiff_frames(target, frames, self._shape, self._dtype)


class GifWriter(Writer):
    """Writes an endless animation of 256 colours per frame."""

    suffix = ".frame"

    def __init__(self, clip: Clip) -> None:
        super().__init__()
        self._head = gif_head(*clip.shape[1:3])
        self._delays = clip.clock.delays(len(clip), Fraction(1, HUNDREDTHS))
        require_unit_range(clip)
        if clip.dtype != np.uint8:
            self.warnings.append(".gif holds 8 bit: the depth of the source is lost")

    def describe(self) -> dict[str, Any]:
        """Return what decides the bytes, beside the frames."""
        return {"suffix": ".gif"}

    def write_piece(self, path: Path, frames: Iterable[NDArray[Any]]) -> None:
        """Write a piece."""
        number = int(path.stem.rpartition("_")[2])
        for frame in frames:
            samples = as_integers(in_unit_range(frame), "frames", 8)
            path.write_bytes(gif_frame(samples, self._delays[number]))

    def assemble(self, pieces: Sequence[Path], target: Path) -> None:
        """Make the whole out of its pieces."""
        with target.open("wb") as file:
            file.write(self._head)
            for piece in pieces:
                file.write(piece.read_bytes())
            file.write(GIF_TAIL)


def in_unit_range(frame: NDArray[Any]) -> NDArray[Any]:
    """Return floats cut to [0, 1], beyond which restoring may swing; integers as is."""
    return np.clip(frame, 0, 1) if frame.dtype.kind == "f" else frame


def require_unit_range(clip: Clip) -> None:
    """Raise ValueError if the samples of ``clip`` are floats beyond [0, 1] or NaN."""
    low, high = clip.extent
    if clip.dtype.kind == "f" and not (low >= 0 and high <= 1):
        raise ValueError(
            "frames of floats must lie in [0, 1] and hold no NaN to be stored as "
            f"integers, got {low:g} to {high:g}; write .tif, which keeps floats"
        )
