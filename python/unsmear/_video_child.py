"""Decode one video to raw frames on standard output: a process that may die.

Broken videos can crash the decoder itself, below Python. This script therefore runs
in a process of its own, started by `video`, and imports nothing of this package. It
prints one line of JSON, ``{"shape": [H, W] or [H, W, 3], "dtype": ...}``, then the
frames as packed native samples. An exit status other than 0 means that the video could
not be decoded to its end; the reason is the last line on standard error.

Samples: grey formats stay grey; 8 bit stays 8 bit; deeper formats are scaled to the
full range of 16 bit; YCbCr is converted to RGB with the matrix the video names.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

_QUARTER_TURN = 90


class BrokenVideoError(Exception):
    """The video cannot be decoded to its end; the text says why."""


def decoded_frames(container: Any) -> Iterator[Any]:
    """Yield the frames of the first video stream; BrokenVideoError at a damaged one."""
    if not container.streams.video:
        raise BrokenVideoError("it holds no video stream")
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    count = 0
    for packet in container.demux(stream):
        if packet.is_corrupt:
            raise BrokenVideoError(f"it is damaged or cut off after frame {count}")
        for frame in packet.decode():
            if frame.is_corrupt:
                raise BrokenVideoError(f"frame {count} is damaged")
            yield frame
            count += 1
    if count == 0:
        raise BrokenVideoError("it holds no frame")


def sample_format(frame: Any) -> str:
    """Choose the packed format that keeps depth and colour of a frame."""
    deep = max(component.bits for component in frame.format.components) > 8
    if frame.format.name.startswith(("gray", "ya", "mono")):
        return "gray16le" if deep else "gray"
    return "rgb48le" if deep else "rgb24"


def send(path: str, output: BinaryIO) -> None:
    """Decode ``path`` and write header and frames to ``output``."""
    av = importlib.import_module("av")
    np = importlib.import_module("numpy")
    target, first = "", None
    with av.open(path, metadata_errors="ignore") as container:
        for count, frame in enumerate(decoded_frames(container)):
            target = target or sample_format(frame)
            picture = frame.to_ndarray(format=target)
            # The camera's rotation, counter-clockwise in degrees, as players apply it.
            picture = np.rot90(picture, round(frame.rotation / _QUARTER_TURN))
            found = {"shape": list(picture.shape), "dtype": picture.dtype.name}
            if first is None:
                first = found
                output.write(json.dumps(found).encode() + b"\n")
            if found != first:
                raise BrokenVideoError(f"frame {count} is {found}, the first {first}")
            output.write(np.ascontiguousarray(picture).tobytes())
    output.flush()


if __name__ == "__main__":
    try:
        send(sys.argv[1], sys.stdout.buffer)
    except Exception as error:
        sys.exit(f"{error}".replace("\n", " ") or type(error).__name__)
