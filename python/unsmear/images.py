"""Single pictures and picture stacks in and out of files, depth kept.

| suffix               | reads                          | writes                      |
|----------------------|--------------------------------|-----------------------------|
| .png                 | 8 and 16 bit, grey and colour  | uint8, uint16, exact        |
| .tif .tiff           | the same, float16/32/64, pages | uint8, uint16, float, exact |
| .jpg .jpeg           | 8 bit                          | 8 bit, lossy                |
| .bmp .webp           | 8 bit                          | 8 bit, exact                |
| .gif .ppm .pgm .pnm  | 8 bit (.pgm 16 bit)            | (.gif: `write_frames`)      |

Rules. Values are those of the file: no gamma, no colour profile. A palette becomes
RGB, one bit becomes 0 and 255, CMYK and YCbCr become RGB. Alpha is dropped and the
stored colour kept as it is, not laid over a background. The orientation a camera notes
(Exif) is applied, so that the array is upright as viewers show it. Float pictures in
[0, 1] are written to integer formats scaled by the largest integer (PNG: 16 bit);
outside [0, 1] or NaN they are refused, and .tif takes them as they are.
"""

from __future__ import annotations

import io
import os
import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageOps, ImageSequence

from unsmear._arrays import as_picture_array
from unsmear._atomic import atomic_path, write_bytes_atomic
from unsmear._containers import is_whole
from unsmear._format_error import FormatError
from unsmear._png import SIGNATURE, decode_png16, encode_png16, read_header
from unsmear._tiff import read_tiff, write_tiff

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike, NDArray

__all__ = ["read_image", "write_image"]

TIFF_SUFFIXES = frozenset({".tif", ".tiff"})
PICTURE_SUFFIXES = TIFF_SUFFIXES | {
    ".png", ".jpg", ".jpeg", ".bmp", ".webp", ".gif", ".ppm", ".pgm", ".pnm",
}  # fmt: skip
_WRITERS = {".png": "PNG", ".bmp": "BMP", ".webp": "WEBP", ".jpg": "JPEG"}
_WRITERS[".jpeg"] = "JPEG"
# Quality 95 without colour subsampling: the least loss JPEG offers at sane sizes.
_SAVE_OPTIONS: dict[str, dict[str, Any]] = {
    "JPEG": {"quality": 95, "subsampling": 0},
    "WEBP": {"lossless": True},
}
_KEPT_MODES = ("L", "RGB", "F")  # what Pillow's modes mean as arrays already
_GREY_MODES = ("1", "LA", "La")


def read_image(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read one picture.

    Parameters
    ----------
    path : path-like
        A picture file; formats and rules stand at the head of this module.

    Returns
    -------
    ndarray of shape (H, W) or (H, W, 3)
        uint8 or uint16; float16, float32 or float64 from TIFF.

    Raises
    ------
    ValueError
        If the file is empty, corrupt, no picture, or holds several pictures.
    FileNotFoundError
        If there is no such file.
    """
    stack = read_stack(as_path(path, "path"))
    if len(stack) != 1:
        raise ValueError(
            f"path must hold one picture, got {len(stack)} in {os.fspath(path)!r}; "
            "read_frames reads stacks"
        )
    return np.asarray(stack[0])


def write_image(path: str | os.PathLike[str], image: ArrayLike) -> None:
    """Write one picture, whole or not at all.

    Parameters
    ----------
    path : path-like
        The target: .png, .tif, .tiff, .jpg, .jpeg, .bmp or .webp.
    image : array_like of shape (H, W), (H, W, 1) or (H, W, 3)
        uint8, uint16, bool (0 and 255) or float. PNG keeps 8 and 16 bit and writes
        floats in [0, 1] as 16 bit; TIFF keeps every type; the others hold 8 bit,
        to which deeper pictures are rounded.

    Raises
    ------
    ValueError
        If shape, suffix or values do not fit: floats outside [0, 1] or NaN go into
        .tif only.
    TypeError
        If the picture's type is none of the above.
    FileNotFoundError
        If the folder does not exist.
    """
    target = as_path(path, "path")
    suffix = target.suffix.lower()
    if suffix not in TIFF_SUFFIXES and suffix not in _WRITERS:
        known = ", ".join([*_WRITERS, *sorted(TIFF_SUFFIXES)])
        raise ValueError(f"path must end in one of {known}, got {os.fspath(path)!r}")
    picture = check_pictures(image, "image", stack=False)
    if suffix in TIFF_SUFFIXES:
        with atomic_path(target) as temporary:
            write_tiff(temporary, picture[np.newaxis])
        return
    bits = None if suffix == ".png" else 8
    samples = as_integers(picture, "image", bits)
    write_bytes_atomic(target, encode_picture(samples, _WRITERS[suffix]))


def as_path(path: object, argument: str) -> Path:
    """Return ``path`` as a Path; TypeError naming the argument if it is none."""
    if not isinstance(path, str | os.PathLike):
        raise TypeError(
            f"{argument} must be a string or a path, got {type(path).__name__}"
        )
    return Path(os.fspath(path))


def check_pictures(pictures: ArrayLike, argument: str, *, stack: bool) -> NDArray[Any]:
    """Check type and shape; return a native array without an axis for one channel."""
    array = np.asanyarray(pictures)
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * np.uint8(255)
    array = as_picture_array(array, argument)
    if (
        array.dtype.kind != "f" and array.dtype.itemsize > 2
    ) or array.dtype.kind == "i":
        raise TypeError(
            f"{argument} must be uint8, uint16, bool or float, got dtype {array.dtype}"
        )
    shape, ndim = ("(T, H, W", 3) if stack else ("(H, W", 2)
    colour = array.ndim == ndim + 1 and array.shape[-1] in (1, 3)
    if array.size == 0 or not (array.ndim == ndim or colour):
        raise ValueError(
            f"{argument} must have shape {shape}) or {shape}, 3) and hold at least one "
            f"pixel, got {array.shape}"
        )
    if colour and array.shape[-1] == 1:
        array = array[..., 0]
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def describe(picture: NDArray[Any]) -> str:
    """Say shape and type of a picture, for comparisons and messages."""
    return f"{picture.shape} {picture.dtype}"


def as_integers(
    pictures: NDArray[Any], argument: str, bits: int | None
) -> NDArray[Any]:
    """Return uint8 or uint16 samples: ``bits`` of 8, or None = as deep as they come."""
    if pictures.dtype.kind == "f":
        low, high = float(pictures.min()), float(pictures.max())
        if not (low >= 0 and high <= 1):
            raise ValueError(
                f"{argument} of floats must lie in [0, 1] and hold no NaN to be stored "
                f"as integers, got {low:g} to {high:g}; clip or scale them, or write "
                ".tif, which keeps floats"
            )
        depth: type[np.unsignedinteger[Any]] = np.uint8 if bits == 8 else np.uint16
        wide = pictures.astype(np.float64)
        return np.rint(wide * np.iinfo(depth).max).astype(depth)
    if bits == 8 and pictures.dtype == np.uint16:
        # 65535 / 255 = 257; the half added rounds to nearest.
        return ((pictures.astype(np.uint32) + 128) // 257).astype(np.uint8)
    return pictures


def encode_picture(samples: NDArray[Any], file_format: str) -> bytes:
    """Encode (H, W) or (H, W, 3) uint8, or uint16 for PNG, as a picture file."""
    if samples.dtype == np.uint16:
        return encode_png16(samples)
    buffer = io.BytesIO()
    options = _SAVE_OPTIONS.get(file_format, {})
    Image.fromarray(samples).save(buffer, format=file_format, **options)
    return buffer.getvalue()


def read_stack(path: Path) -> NDArray[Any]:
    """Read all pictures of a file as (T, H, W) or (T, H, W, 3).

    Raises
    ------
    ValueError
        If the file is empty or not readable as pictures of one size; names the path.
    """
    if path.stat().st_size == 0:
        raise ValueError(f"cannot read {str(path)!r}: the file is empty")
    if not is_whole(path):
        raise ValueError(f"cannot read {str(path)!r}: the file is cut off")
    with decoding(path):
        return _decode(path)


@contextmanager
def decoding(path: Path) -> Iterator[None]:
    """Turn what a decoder raises on a broken file into a ValueError naming the file."""
    try:
        yield
    except (MemoryError, RecursionError):
        raise
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise ValueError(f"cannot read {str(path)!r} as a picture: {reason}") from error


def _decode(path: Path) -> NDArray[Any]:
    if path.suffix.lower() in TIFF_SUFFIXES:
        stack = read_tiff(path)
        if stack is not None:
            return stack
    with path.open("rb") as file:
        head = file.read(64)
        if head.startswith(SIGNATURE) and read_header(head).depth == 16:
            file.seek(0)
            return _without_alpha(decode_png16(file.read()))[np.newaxis]
    if re.match(rb"P6\s+(#[^\n]*\n\s*)*\d+\s+\d+\s+\d{4,5}\s", head):
        raise FormatError("8 bits per sample in .ppm", "16 bits; use .png or .tif")
    frames: list[NDArray[Any]] = []
    with Image.open(path) as picture:
        for page in ImageSequence.Iterator(picture):
            frames.append(samples_of_page(page, always_colour=picture.format == "GIF"))
            if describe(frames[-1]) != describe(frames[0]):
                got = f"{describe(frames[0])} and {describe(frames[-1])}"
                raise FormatError("pages of one size and type", got)
            if picture.format == "MPO":  # a photograph with previews behind it
                break
    return np.stack(frames)


def samples_of_page(page: Image.Image, *, always_colour: bool) -> NDArray[Any]:
    """Turn one Pillow picture into an array, upright, without palette or alpha."""
    upright = ImageOps.exif_transpose(page) if page.getexif() else page
    if upright.mode.startswith("I"):  # 16 bit grey, or .pgm of that depth in 32 bit
        wide = np.asarray(upright)
        if wide.min() < 0 or wide.max() > np.iinfo(np.uint16).max:
            raise FormatError("16 bits per sample", f"values up to {wide.max()}")
        return wide.astype(np.uint16)
    if always_colour or upright.mode not in (*_KEPT_MODES, *_GREY_MODES):
        # By way of RGBA, because some palettes hold transparent colours.
        convert: Callable[[str], Image.Image] = upright.convert
        via = convert("RGBA") if upright.mode in ("P", "PA") else upright
        return np.array(via.convert("RGB"))
    grey = upright.mode in _GREY_MODES
    return np.array(upright.convert("L") if grey else upright)


def _without_alpha(picture: NDArray[Any]) -> NDArray[Any]:
    """Drop the last of 2 or 4 channels."""
    channels = picture.shape[-1] if picture.ndim == 3 else 1
    if channels == 2:
        return np.ascontiguousarray(picture[..., 0])
    return np.ascontiguousarray(picture[..., :3]) if channels == 4 else picture
