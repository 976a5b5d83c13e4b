"""Decode one video to raw frames on standard output: a process that may die.

Broken videos can crash the decoder itself, below Python. This script therefore runs
in a process of its own, started by `_video_stream`, and imports nothing of this
package. It is called with the path and the number of frames to pass over, and writes

    one line of JSON            what the frames and the stream are, see `described`
    8 bytes and samples         of every frame: its time stamp, little-endian, in units
                                of the time base (`UNTIMED` if it has none), then its
                                packed native samples

An exit status other than 0 means that the video could not be decoded to its end; the
reason is the last line on standard error.

Samples: grey formats stay grey; 8 bit stays 8 bit; deeper formats are scaled to the
full range of 16 bit; YCbCr is converted to RGB with the matrix and the range that the
video names. Only local files are opened: a playlist cannot lead elsewhere.
"""

from __future__ import annotations

import importlib
import json
import struct
import sys
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

UNTIMED = -(2**63)
_QUARTER_TURN = 90
# Bicubic chroma at full width, rounded, not cut, the same on every processor: flags of
# the converter; its own choice darkens by more than a grey level.
_CONVERSION = 0x4 | 0x2000 | 0x40000 | 0x80000
# Pictures and text that the decoder would take for one frame, lists of other files.
_NO_VIDEOS = {"image2", "tty", "concat", "hls", "dash", "imf"}
_OPTIONS = {"protocol_whitelist": "file"}


class BrokenVideoError(Exception):
    """The video cannot be decoded to its end; the text says why."""


def decoded_frames(container: Any) -> Iterator[Any]:
    """Yield the frames of the first video stream; BrokenVideoError at a damaged one."""
    kind = container.format.name
    if kind.endswith("_pipe") or kind in _NO_VIDEOS:
        raise BrokenVideoError(f"it is no video by what it holds ({kind})")
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


def bits_of(frame: Any) -> int:
    """Return the bits per sample of a frame."""
    return max(int(component.bits) for component in frame.format.components)


def sample_format(frame: Any) -> str:
    """Choose the packed format that keeps depth and colour of a frame."""
    deep = bits_of(frame) > 8
    if frame.format.name.startswith(("gray", "ya", "mono")):
        return "gray16le" if deep else "gray"
    return "rgb48le" if deep else "rgb24"


def described(container: Any, frame: Any, turned: int) -> dict[str, Any]:
    """Return what is to be known to write the like of a stream again."""
    stream = container.streams.video[0]
    rate = stream.average_rate or stream.base_rate or stream.guessed_rate
    ratio = stream.sample_aspect_ratio or 1
    aspect = [ratio.numerator, ratio.denominator]
    chroma = None
    if not frame.format.is_rgb and len(frame.format.components) >= 3:
        part = frame.format.components[1]
        # Planes of half the size are rounded up.
        chroma = [-(-frame.width // part.width), -(-frame.height // part.height)]
    base = frame.time_base or stream.time_base
    return {
        "bits": bits_of(frame),
        "rate": [rate.numerator, rate.denominator] if rate else None,
        "time_base": [base.numerator, base.denominator] if base else None,
        "pixel_aspect": aspect[::-1] if turned % 2 else aspect,
        "chroma": chroma,
        "colour": {
            "range": int(frame.color_range),
            "matrix": int(frame.colorspace),
            "primaries": int(frame.color_primaries),
            "transfer": int(frame.color_trc),
        },
        "audio": [sound.codec_context.name for sound in container.streams.audio],
    }


def send(path: str, skipped: int, output: BinaryIO) -> None:
    """Decode ``path`` and write header and frames to ``output``."""
    av = importlib.import_module("av")
    np = importlib.import_module("numpy")
    target, first = "", None
    with av.open(path, metadata_errors="ignore", options=_OPTIONS) as container:
        for count, frame in enumerate(decoded_frames(container)):
            if count < skipped:
                continue
            target = target or sample_format(frame)
            picture = frame.to_ndarray(format=target, interpolation=_CONVERSION)
            # The camera's rotation, counter-clockwise in degrees, as players apply it.
            turns = round(frame.rotation / _QUARTER_TURN)
            picture = np.rot90(picture, turns)
            found = {"shape": list(picture.shape), "dtype": picture.dtype.name}
            if first is None:
                first = found
                header = found | described(container, frame, turns)
                output.write(json.dumps(header).encode() + b"\n")
            if found != first:
                raise BrokenVideoError(f"frame {count} is {found}, the first {first}")
            stamp = UNTIMED if frame.pts is None else frame.pts
            output.write(struct.pack("<q", stamp))
            output.write(np.ascontiguousarray(picture).tobytes())
    output.flush()


if __name__ == "__main__":
    try:
        send(sys.argv[1], int(sys.argv[2]), sys.stdout.buffer)
    except Exception as error:
        sys.exit(f"{error}".replace("\n", " ") or type(error).__name__)
