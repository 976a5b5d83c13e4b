"""Sixteen-bit PNG, colour included, decoded and encoded exactly.

Pillow keeps the upper byte only of a 16-bit colour PNG, while the KITTI flow format
and 16-bit photographs need both; hence this small codec on zlib and NumPy.

Mathematics. A scanline stores x - P(a, b, c) mod 256 byte by byte, where a, b, c are
the corresponding bytes of the pixels to the left, above, and above left (0 outside)
and P is, by the filter type in front of the row:

    0 none: 0     1 sub: a     2 up: b     3 average: floor((a + b) / 2)
    4 Paeth: whichever of a, b, c lies nearest to a + b - c, ties in that order

Undoing it is a recursion along the row and down the rows. A pixel depends only on
pixels of the two anti-diagonals before its own, so that all pixels of one
anti-diagonal x + y = d are restored at once: W + H - 1 vector steps instead of W H.
Interlaced files (Adam7) hold seven such sub-pictures.

Validity: bit depth 16; grey, grey + alpha, RGB, RGBA. Memory: no buffer is sized by
the header alone, the decompressed stream must first be as long as the header says.

Source: W3C Recommendation, Portable Network Graphics (PNG) Specification, third
edition (2025), https://www.w3.org/TR/png-3/, sections 5 (chunks), 7 and 9 (filters).
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._format_error import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}  # colour type -> samples per pixel
_PAETH = 4
_LARGEST_SIDE = 2**31 - 1  # section 5: four-byte integers stay below 2^31
# Adam7 (section 8): first column, first row, column step, row step of each pass.
_ADAM7 = (
    (0, 0, 8, 8),
    (4, 0, 8, 8),
    (0, 4, 4, 8),
    (2, 0, 4, 4),
    (0, 2, 2, 4),
    (1, 0, 2, 2),
    (0, 1, 1, 2),
)


@dataclass(frozen=True)
class Header:
    """The fields of the IHDR chunk: sizes in pixels, samples per pixel."""

    width: int
    height: int
    depth: int
    colour_type: int
    interlaced: bool

    @property
    def channels(self) -> int:
        """Samples per pixel (a palette index counts as one)."""
        return _CHANNELS.get(self.colour_type, 1)


def read_header(data: bytes) -> Header:
    """Parse signature and IHDR of a PNG; FormatError if they are not one."""
    if data[:8] != SIGNATURE:
        raise FormatError("the PNG signature", f"{data[:8]!r}")
    if len(data) < 33 or data[8:16] != b"\x00\x00\x00\rIHDR":
        raise FormatError("an IHDR chunk of 13 bytes", f"{data[8:16]!r}")
    if zlib.crc32(data[12:29]) != int.from_bytes(data[29:33], "big"):
        raise FormatError("a sound IHDR chunk", "a wrong checksum")
    width, height, depth, colour, method, filters, interlace = struct.unpack(
        ">IIBBBBB", data[16:29]
    )
    if not (1 <= width <= _LARGEST_SIDE and 1 <= height <= _LARGEST_SIDE):
        raise FormatError("a width and height of 1 to 2^31 - 1", f"{width} x {height}")
    if method != 0 or filters != 0 or interlace > 1:
        raise FormatError(
            "compression 0, filter method 0, interlace 0 or 1",
            f"{method}, {filters}, {interlace}",
        )
    return Header(width, height, depth, colour, interlace == 1)


def decode_png16(data: bytes, *, allow_trailing: bool = True) -> NDArray[np.uint16]:
    """Decode a 16-bit PNG to (H, W) or (H, W, C) uint16.

    Parameters
    ----------
    data : bytes
        The whole file.
    allow_trailing : bool, default True
        Whether bytes after the end chunk are ignored, as picture viewers do, or
        refused.

    Raises
    ------
    FormatError
        If the file is truncated, corrupt, not 16 bits deep, or animated.
    """
    header = read_header(data)
    if header.depth != 16 or header.colour_type not in _CHANNELS:
        raise FormatError(
            "16 bits per sample, grey or colour",
            f"bit depth {header.depth}, colour type {header.colour_type}",
        )
    bytes_per_pixel = 2 * header.channels
    shapes = list(_pass_shapes(header))
    total = sum(h * (1 + w * bytes_per_pixel) for h, w, _ in shapes)
    stream = _inflate(_image_chunks(data, allow_trailing), total)
    pixels = np.zeros((header.height, header.width, bytes_per_pixel), np.uint8)
    offset = 0
    for rows, columns, where in shapes:
        size = rows * (1 + columns * bytes_per_pixel)
        lines = np.frombuffer(stream, np.uint8, size, offset).reshape(rows, -1)
        pixels[where] = _unfilter(lines, columns, bytes_per_pixel)
        offset += size
    image = pixels.view(">u2").astype(np.uint16)
    return image[..., 0] if header.channels == 1 else image


def encode_png16(image: NDArray[np.uint16]) -> bytes:
    """Encode (H, W) or (H, W, 3) uint16 as a PNG file, Paeth-filtered."""
    height, width = image.shape[:2]
    colour_type = 0 if image.ndim == 2 else 2
    lines = np.ascontiguousarray(image, dtype=">u2").view(np.uint8)
    lines = lines.reshape(height, width, -1)
    padded = np.pad(lines, ((1, 0), (1, 0), (0, 0)))
    prediction = _paeth(padded[1:, :-1], padded[:-1, 1:], padded[:-1, :-1])
    filtered = np.full((height, 1 + lines[0].size), _PAETH, np.uint8)
    filtered[:, 1:] = (lines - prediction).reshape(height, -1)
    head = struct.pack(">IIBBBBB", width, height, 16, colour_type, 0, 0, 0)
    body = zlib.compress(filtered.tobytes())
    chunks = ((b"IHDR", head), (b"IDAT", body), (b"IEND", b""))
    return SIGNATURE + b"".join(_chunk(kind, part) for kind, part in chunks)


def _chunk(kind: bytes, body: bytes) -> bytes:
    checksum = zlib.crc32(kind + body).to_bytes(4, "big")
    return len(body).to_bytes(4, "big") + kind + body + checksum


def _image_chunks(data: bytes, allow_trailing: bool) -> bytes:
    """Join the IDAT chunks after checking every chunk of the file."""
    parts: list[bytes] = []
    offset = len(SIGNATURE)
    kind = b""
    while kind != b"IEND":
        length = int.from_bytes(data[offset : offset + 4], "big")
        kind = data[offset + 4 : offset + 8]
        end = offset + 12 + length
        if end > len(data):
            raise FormatError(
                f"at least {end} bytes up to the end of chunk {kind!r}",
                f"{len(data)} bytes",
            )
        body = data[offset + 8 : end - 4]
        if zlib.crc32(kind + body) != int.from_bytes(data[end - 4 : end], "big"):
            raise FormatError(f"a sound chunk {kind!r}", "a wrong checksum")
        if kind == b"acTL":
            raise FormatError("one picture", "a 16-bit animation")
        if kind == b"IDAT":
            parts.append(body)
        offset = end
    if offset != len(data) and not allow_trailing:
        raise FormatError(f"{offset} bytes", f"{len(data)} bytes")
    return b"".join(parts)


def _inflate(compressed: bytes, total: int) -> bytes:
    """Decompress exactly ``total`` bytes; more or fewer are an error."""
    engine = zlib.decompressobj()
    try:
        # The output buffer grows with what the data really yield, up to the bound.
        stream = engine.decompress(compressed, min(total + 1, 2**62))
    except zlib.error as error:
        raise FormatError("sound compressed pixels", str(error)) from None
    if len(stream) != total:
        got = "more" if len(stream) > total else f"{len(stream)}"
        raise FormatError(f"{total} bytes of scanlines", got)
    return stream


def _pass_shapes(header: Header) -> Iterator[tuple[int, int, Any]]:
    """Rows, columns and pixel selection of each pass that holds pixels."""
    passes = _ADAM7 if header.interlaced else ((0, 0, 1, 1),)
    for x0, y0, dx, dy in passes:
        rows = len(range(y0, header.height, dy))
        columns = len(range(x0, header.width, dx))
        if rows and columns:
            yield rows, columns, (slice(y0, None, dy), slice(x0, None, dx))


def _paeth(
    a: NDArray[np.uint8], b: NDArray[np.uint8], c: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Predict each byte from its left, upper and upper-left neighbour."""
    b_minus_c = b.astype(np.int16) - c
    a_minus_c = a.astype(np.int16) - c
    to_a, to_b = np.abs(b_minus_c), np.abs(a_minus_c)
    to_c = np.abs(a_minus_c + b_minus_c)
    nearest_b_or_c = np.where(to_b <= to_c, b, c)
    return np.where((to_a <= to_b) & (to_a <= to_c), a, nearest_b_or_c)


def _unfilter(
    lines: NDArray[np.uint8], width: int, bytes_per_pixel: int
) -> NDArray[np.uint8]:
    """Restore (H, 1 + W B) filtered scanlines to (H, W, B) bytes."""
    height = lines.shape[0]
    kinds = lines[:, 0]
    if kinds.max() > _PAETH:
        raise FormatError("filter types 0 to 4", f"{kinds.max()}")
    # A zero column on the left and a zero row on top stand for "outside". In the
    # flattened picture one step down an anti-diagonal is then a stride of `width`.
    padded = np.zeros((height + 1, width + 1, bytes_per_pixel), np.uint8)
    padded[1:, 1:] = lines[:, 1:].reshape(height, width, bytes_per_pixel)
    flat = padded.reshape(-1, bytes_per_pixel)
    zero = np.zeros((1, 1), np.uint8)
    for d in range(width + height - 1):
        top, bottom = max(0, d - width + 1), min(height - 1, d)
        start = (top + 1) * (width + 1) + (d - top) + 1
        stop = start + (bottom - top) * width + 1

        def diagonal(back: int, a: int = start, z: int = stop) -> NDArray[np.uint8]:
            return flat[a - back : z - back : width]

        left, up = diagonal(1), diagonal(width + 1)
        average = ((left.astype(np.uint16) + up) >> 1).astype(np.uint8)
        paeth = _paeth(left, up, diagonal(width + 2))
        kind = kinds[top : bottom + 1, None]
        flat[start:stop:width] += np.choose(kind, [zero, left, up, average, paeth])
    return padded[1:, 1:]
