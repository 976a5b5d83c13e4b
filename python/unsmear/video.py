"""Videos in and out through PyAV (``pip install "unsmear[video]"``).

Reading happens in a child process: a truncated or hostile file can crash the decoding
library itself, and then only the child dies and a ValueError tells of it. A video that
ends before its container says so is refused, never shortened in silence.

Written formats
---------------
.mkv .avi   FFV1 (RFC 9043), lossless: what is read equals what was written, 8 and
            16 bit, grey and RGB.
.mp4 .mov   H.264 (ITU-T H.264), 8 bit, constant rate factor `H264_QUALITY`; chroma is
            halved (4:2:0), which every player shows, unless a side is odd (4:4:4).
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._atomic import atomic_path
from unsmear._video_stream import CONVERSION, VideoStream, require_pyav
from unsmear.images import as_integers

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

LOSSLESS_SUFFIXES = frozenset({".mkv", ".avi"})
WRITE_SUFFIXES = LOSSLESS_SUFFIXES | {".mp4", ".mov"}
READ_SUFFIXES = WRITE_SUFFIXES | {
    ".m4v", ".3gp", ".webm", ".mpg", ".mpeg", ".wmv", ".flv", ".ts", ".mts", ".m2ts",
    ".ogv", ".y4m",
}  # fmt: skip
# Visually lossless; the encoder's own default of 23 blurs the detail this is about.
H264_QUALITY = "14"
SMPTE_170M = 6  # the BT.601 matrix, by its number in ITU-T H.273
_LARGEST_DENOMINATOR = 1001  # holds the 30000/1001 of NTSC exactly
_STANDARD_FORMATS = {  # (channels, bits): samples handed over, samples coded
    (1, 8): ("gray", "gray"),
    (1, 16): ("gray16le", "gray16le"),
    (3, 8): ("rgb24", "bgr0"),
    (3, 16): ("rgb48le", "gbrp16le"),
}


def read_video(path: Path) -> NDArray[Any]:
    """Read all frames of the first video stream of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    ndarray of shape (T, H, W) or (T, H, W, 3)
        uint8, or uint16 (full range) for more than 8 bits; grey only if the video's
        own format is grey. A rotation noted by the camera is applied.

    Raises
    ------
    ValueError
        If the file is empty, truncated, damaged, holds no video, or crashes the
        decoder; the message names the path.
    FileNotFoundError
        If there is no such file.
    ImportError
        If PyAV is not installed.
    """
    samples = bytearray()
    with VideoStream(path) as stream:
        for _, frame in stream:
            samples += frame.data
    shape, dtype = stream.format.shape, stream.format.dtype
    return np.frombuffer(samples, dtype).reshape(-1, *shape)


def write_video(path: Path, frames: NDArray[Any], fps: float) -> None:
    """Write checked frames (T, H, W) or (T, H, W, 3) as a video, whole or not at all.

    Raises
    ------
    ValueError
        If floats lie outside [0, 1] or are NaN, or the encoder refuses the size.
    ImportError
        If PyAV is not installed.
    """
    av = require_pyav()
    lossless = path.suffix.lower() in LOSSLESS_SUFFIXES
    samples = as_integers(frames, "frames", None if lossless else 8)
    channels = 1 if samples.ndim == 3 else 3
    given, coded = _STANDARD_FORMATS[channels, 8 * samples.dtype.itemsize]
    height, width = samples.shape[1:3]
    if not lossless:
        coded = "yuv444p" if width % 2 or height % 2 else "yuv420p"
    with atomic_path(path) as temporary, av.open(str(temporary), "w") as container:
        rate = Fraction(fps).limit_denominator(_LARGEST_DENOMINATOR)
        stream = container.add_stream("ffv1" if lossless else "libx264", rate=rate)
        stream.width, stream.height, stream.pix_fmt = width, height, coded
        if not lossless:
            stream.options = {"crf": H264_QUALITY}
            stream.codec_context.colorspace = SMPTE_170M
        try:
            for picture in samples:
                frame = av.VideoFrame.from_ndarray(picture, format=given)
                coded_frame = frame.reformat(format=coded, interpolation=CONVERSION)
                container.mux(stream.encode(coded_frame))
            container.mux(stream.encode(None))
        except av.FFmpegError as error:
            raise ValueError(
                f"frames of {width} x {height} pixels at {fps} per second must suit "
                f"the encoder of {path.suffix}, got {error}"
            ) from error
