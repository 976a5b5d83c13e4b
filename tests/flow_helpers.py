"""A flow field every file format keeps exactly, and PNG files built by hand."""

from __future__ import annotations

import struct
import zlib

import numpy as np


def field(height: int = 5, width: int = 7, seed: int = 0) -> np.ndarray:
    """A field on KITTI's grid of 1/64 px, so that every format keeps it exactly."""
    steps = np.random.default_rng(seed).integers(-2000, 2000, (height, width, 2))
    flow = (steps / 64).astype(np.float32)
    flow[height // 2, width // 3] = np.nan
    return flow


def png(depth: int, colour_type: int, width: int, height: int, scanlines: bytes):
    """A PNG from the chunk layout of its specification, unfiltered scanlines."""
    head = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n"
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(scanlines)), (b"IEND", b""))
    for kind, body in parts:
        checksum = zlib.crc32(kind + body)
        data += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", checksum)
    return data
