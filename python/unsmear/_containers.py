"""Whether a container file is whole: its outer structures must end inside it.

Decoders shorten a clip in silence when the file was cut between two frames. The outer
layer of each container tells how long the file should be; walking it reads a few bytes
per structure and decodes nothing.

ISO media (.mp4, .mov)   boxes: 32-bit length, name, body; ISO/IEC 14496-12, 4.2
Matroska (.mkv, .webm)   EBML header, then a segment; RFC 8794, 4 and 6; RFC 9559
AVI                      RIFF chunks: name, little-endian length, body
GIF                      blocks up to the trailer 0x3B; GIF89a, 1990
TIFF                     chain of directories, classic and BigTIFF; TIFF 6.0, section 2

A structure of open length (a live recording) or an unknown container counts as whole;
what is inside it is the decoder's to judge.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from pathlib import Path

_EBML = b"\x1a\x45\xdf\xa3"
_SEGMENT = b"\x18\x53\x80\x67"
_ISO_FIRST_BOXES = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide")
_GIF_TABLE = 0x80
_GIF_PICTURE, _GIF_EXTENSION, _GIF_END = b"\x2c", b"\x21", b"\x3b"
_TIFF_ORDERS = (b"II", b"MM")  # little-endian, big-endian
_BIG_TIFF = 43


def is_whole(path: Path) -> bool:
    """Whether the outer structures of a container file end inside the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        if head[4:8] in _ISO_FIRST_BOXES:
            return _iso_is_whole(file, size)
        if head.startswith(_EBML):
            return _matroska_is_whole(file, size)
        if head.startswith(b"RIFF"):
            return _riff_is_whole(file, size)
        if head.startswith((b"GIF87a", b"GIF89a")):
            return _gif_is_whole(file, size)
        if head[:2] in _TIFF_ORDERS:
            return _tiff_is_whole(file, size)
    return True


def _iso_is_whole(file: BinaryIO, size: int) -> bool:
    offset = 0
    while offset < size:
        file.seek(offset)
        head = file.read(16)
        length = int.from_bytes(head[:4], "big")
        if length == 1:  # the length follows in 64 bits
            length = int.from_bytes(head[8:16], "big")
        if length == 0:  # up to the end of the file
            return True
        # Too short for its own head: rubbish after the last box, often zeros.
        if length < 8:
            return True
        offset += length
    return offset == size


def _matroska_is_whole(file: BinaryIO, size: int) -> bool:
    file.seek(len(_EBML))
    header = _ebml_length(file)
    if header is None:
        return True
    file.seek(header, os.SEEK_CUR)
    if file.read(4) != _SEGMENT:
        # Something else may stand first; a file that ends here is certainly cut.
        return file.tell() < size
    segment = _ebml_length(file)
    return segment is None or file.tell() + segment <= size


def _ebml_length(file: BinaryIO) -> int | None:
    """Read an EBML length: leading zero bits count the bytes; all ones = open."""
    first = file.read(1)
    if not first or first[0] == 0:
        return None
    extra = 8 - first[0].bit_length()
    bits = 7 * (extra + 1)
    value = int.from_bytes(first + file.read(extra), "big") & ((1 << bits) - 1)
    return None if value == (1 << bits) - 1 else value


def _riff_is_whole(file: BinaryIO, size: int) -> bool:
    offset = 0
    while offset < size:  # long videos hold several RIFF chunks
        file.seek(offset)
        head = file.read(8)
        if offset and not head.startswith(b"RIFF"):
            return True
        length = int.from_bytes(head[4:8], "little")
        offset += 8 + length + length % 2
    # The byte that pads an odd length may be missing at the very end.
    return offset <= size + 1


def _gif_is_whole(file: BinaryIO, size: int) -> bool:
    file.seek(10)
    _skip_gif_table(file, 2)
    while file.tell() < size:
        kind = file.read(1)
        if kind == _GIF_END:
            return True
        if kind == _GIF_EXTENSION:
            file.seek(1, os.SEEK_CUR)
        elif kind == _GIF_PICTURE:
            file.seek(8, os.SEEK_CUR)
            _skip_gif_table(file, 1)  # and the code size after it
        else:
            return True  # not a GIF by the book: the decoder's to judge
        while (length := file.read(1)) not in (b"\0", b""):
            file.seek(length[0], os.SEEK_CUR)
    return False


def _skip_gif_table(file: BinaryIO, following: int) -> None:
    """Skip a flag byte, ``following`` bytes, and the colour table it announces."""
    flags = (file.read(1) or b"\0")[0]
    table = 3 * 2 ** ((flags & 7) + 1) if flags & _GIF_TABLE else 0
    file.seek(following + table, os.SEEK_CUR)


def _tiff_is_whole(file: BinaryIO, size: int) -> bool:
    file.seek(0)
    head = file.read(16)
    little = head[:2] == b"II"

    def number(data: bytes) -> int:
        return int.from_bytes(data, "little" if little else "big")

    big = number(head[2:4]) == _BIG_TIFF
    count_bytes, entry_bytes, offset_bytes = (8, 20, 8) if big else (2, 12, 4)
    offset = number(head[8:16] if big else head[4:8])
    seen: set[int] = set()
    while offset and offset not in seen:  # a loop of directories is no shortage
        seen.add(offset)
        file.seek(offset)
        entries = number(file.read(count_bytes))
        end = offset + count_bytes + entry_bytes * entries + offset_bytes
        if end > size:
            return False
        file.seek(end - offset_bytes)
        offset = number(file.read(offset_bytes))
    return True
