"""Frames of a video, one after the other, decoded in a process of its own.

A truncated or hostile file can crash the decoding library; then only the child dies,
and a ValueError tells of it. What the child writes is described in `_video_child`.
"""

from __future__ import annotations

import importlib
import json
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from unsmear._containers import is_whole

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_STAMP_BYTES = 8
_UNTIMED = -(2**63)  # as in `_video_child`
CONVERSION = 0x4 | 0x2000 | 0x40000 | 0x80000  # as in `_video_child`
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class VideoFormat:
    """What a video stream is, beside its samples.

    Attributes
    ----------
    shape : tuple of int
        (H, W) or (H, W, 3) of a frame, upright.
    dtype : str
        "uint8" or "uint16".
    bits : int
        Per sample, as coded.
    rate : fractions.Fraction or None
        Mean frames per second.
    time_base : fractions.Fraction or None
        Seconds per unit of the time stamps.
    pixel_aspect : fractions.Fraction
        Width of a pixel over its height.
    chroma : tuple of int or None
        Samples of luma per sample of chroma along x and y; None without chroma.
    colour : dict of str to int
        ``range`` (1 limited, 2 full, 0 not said), ``matrix``, ``primaries`` and
        ``transfer`` by their numbers in ITU-T H.273.
    audio : tuple of str
        Codecs of the audio streams.
    """

    shape: tuple[int, ...]
    dtype: str
    bits: int
    rate: Fraction | None
    time_base: Fraction | None
    pixel_aspect: Fraction
    chroma: tuple[int, int] | None
    colour: dict[str, int]
    audio: tuple[str, ...]


class VideoStream:
    """The frames of a file's first video stream; a context manager and an iterator.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    skipped : int, default 0
        Frames to pass over.

    Raises
    ------
    ValueError
        If the file is empty, truncated, damaged, holds no video, or crashes the
        decoder, in the iteration too; the message names the path.
    FileNotFoundError
        If there is no such file.
    ImportError
        If PyAV is not installed.
    """

    def __init__(self, path: Path, skipped: int = 0) -> None:
        self._name = repr(str(path))
        size = path.stat().st_size
        require_pyav()
        if size == 0:
            raise ValueError(f"cannot read {self._name}: the file is empty")
        if not is_whole(path):
            raise ValueError(
                f"cannot read {self._name} as a video: the file is cut off, its "
                f"structure promises more than {size} bytes"
            )
        # -P keeps this folder off the child's module path, where names of ours could
        # hide modules of others.
        script = Path(__file__).with_name("_video_child.py")
        command = [sys.executable, "-P", str(script), str(path.absolute())]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 -- see `close`
        self._child = subprocess.Popen(
            [*command, str(skipped)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            # Ctrl-C is for the parent, which ends the child.
            start_new_session=True,
        )
        try:
            self.format = self._header()
        except BaseException:
            self.close()
            raise

    def __iter__(self) -> Iterator[tuple[int | None, NDArray[Any]]]:
        """Yield time stamp (None = not told) and samples of every frame."""
        bytes_per_frame = prod(self.format.shape) * np.dtype(self.format.dtype).itemsize
        while stamp := self._read(_STAMP_BYTES):
            samples = self._read(bytes_per_frame)
            if len(samples) < bytes_per_frame:
                break
            (time,) = struct.unpack("<q", stamp)
            picture = np.frombuffer(samples, self.format.dtype)
            yield None if time == _UNTIMED else time, picture.reshape(self.format.shape)
        self._finish()

    def __enter__(self) -> VideoStream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the child, whether it is done or not."""
        self._child.kill()  # of no effect once it has ended by itself
        self._output.close()
        self._child.wait()
        self._complaints.close()

    @property
    def _output(self) -> IO[bytes]:
        output = self._child.stdout
        assert output is not None, "the child was started with a pipe"
        return output

    def _read(self, size: int) -> bytes:
        return self._output.read(size)

    def _header(self) -> VideoFormat:
        line = self._output.readline(_LONGEST_HEADER)
        if not line.endswith(b"\n"):
            self._finish()
            raise ValueError(f"cannot read {self._name} as a video: no more frames")
        found = json.loads(line)
        rate, base = found["rate"], found["time_base"]
        return VideoFormat(
            shape=tuple(found["shape"]),
            dtype=found["dtype"],
            bits=found["bits"],
            rate=Fraction(*rate) if rate else None,
            time_base=Fraction(*base) if base else None,
            pixel_aspect=Fraction(*found["pixel_aspect"]),
            chroma=tuple(found["chroma"]) if found["chroma"] else None,
            colour=found["colour"],
            audio=tuple(found["audio"]),
        )

    def _finish(self) -> None:
        """Wait for the child and raise what it complained of."""
        status = self._child.wait()
        if status == 0:
            return
        self._complaints.seek(0)
        reason = self._complaints.read().decode(errors="replace").strip()
        if status < 0:
            reason = f"the decoder crashed (signal {-status})"
        last = (reason.splitlines() or ["no reason given"])[-1]
        raise ValueError(f"cannot read {self._name} as a video: {last}")


def require_pyav() -> Any:
    """Return PyAV; ImportError with what to install."""
    try:
        return importlib.import_module("av")
    except ImportError:
        raise ImportError(
            'videos need PyAV; install it with pip install "unsmear[video]"'
        ) from None
