"""Animated GIF with every frame kept and a palette per frame.

Pillow merges equal neighbouring frames when it saves an animation, which would shorten
a clip that stands still. Here each frame is encoded as a picture of its own and the
pieces are joined: one header, the loop extension, then per frame a delay, a descriptor
with a local palette, and the compressed indices.

Source: CompuServe, Graphics Interchange Format Version 89a (1990), sections 18-23;
the NETSCAPE2.0 application extension for the loop count.
"""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any

from PIL import Image

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LOOP_FOREVER = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
_TABLE_FLAG = 0x80
_TABLE_SIZE = 0x07  # a table has 2^(n + 1) colours of three bytes
_SHORTEST_DELAY = 2  # 1/100 s; viewers slow anything shorter down to 10
_LONGEST_DELAY = 2**16 - 1
_LARGEST_SIDE = 2**16 - 1
HUNDREDTHS = 100  # of a second: the unit of delays
GIF_TAIL = b"\x3b"


def encode_gif(frames: NDArray[Any], fps: float) -> bytes:
    """Encode (T, H, W) or (T, H, W, 3) uint8 as an endless animation.

    Grey is exact; colour is reduced to 256 colours per frame. The delay is rounded to
    1/100 s and at least 2/100 s.
    """
    delay = round(HUNDREDTHS / fps)
    pieces = [gif_head(*frames.shape[1:3])]
    pieces += [gif_frame(frame, delay) for frame in frames]
    return b"".join(pieces) + GIF_TAIL


def gif_head(height: int, width: int) -> bytes:
    """Return what stands before the first frame."""
    if max(height, width) > _LARGEST_SIDE:
        raise ValueError(
            f"frames must be at most {_LARGEST_SIDE} pixels wide and high for .gif, "
            f"got {width} x {height}"
        )
    screen = b"GIF89a" + struct.pack("<HHBBB", width, height, 0x70, 0, 0)
    return screen + _LOOP_FOREVER


def gif_frame(frame: NDArray[Any], delay: int) -> bytes:
    """Encode (H, W) or (H, W, 3) uint8, shown for ``delay`` hundredths of a second."""
    shown = min(max(_SHORTEST_DELAY, delay), _LONGEST_DELAY)
    control = b"\x21\xf9\x04\x00" + struct.pack("<H", shown) + b"\x00\x00"
    return control + _picture_block(frame)


def _picture_block(frame: NDArray[Any]) -> bytes:
    """Encode one frame and move its global palette into the picture's own block."""
    picture = Image.fromarray(frame)
    if picture.mode == "RGB":
        picture = picture.quantize(256)
    buffer = io.BytesIO()
    picture.save(buffer, format="GIF")
    data = buffer.getvalue()
    size_code = data[10] & _TABLE_SIZE
    start = 13 + 3 * 2 ** (size_code + 1)
    palette = data[13:start]
    while data[start] == 0x21:  # extensions between palette and picture
        start += 2
        while data[start]:
            start += data[start] + 1
        start += 1
    descriptor = bytearray(data[start : start + 10])
    descriptor[9] |= _TABLE_FLAG | size_code
    return bytes(descriptor) + palette + data[start + 10 : -1]
