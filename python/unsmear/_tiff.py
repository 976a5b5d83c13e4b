"""TIFF pictures and stacks of any depth as (T, H, W[, C]), and back.

tifffile reads the samples as they are stored (8 and 16 bit, half, single and double
precision, grey and colour); the axes it reports are brought to T, Y, X, channel.
Palettes, CMYK, YCbCr and compressions that tifffile needs more packages for go through
Pillow when that keeps every bit.

Memory: the size a file declares is compared with its length before anything is
allocated; LZW, the strongest of the built-in compressions, cannot exceed the ratio
`_LARGEST_RATIO`.

Source: Adobe Systems, TIFF Revision 6.0 (1992): sections 8 (tags), 13 (LZW).
"""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
import tifffile

from unsmear._format_error import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# A 12-bit LZW code stands for at most some 3800 bytes.
_LARGEST_RATIO = 4096
_ORIENTATION = 274  # the tag: 1 = rows from the top, columns from the left
_DTYPES = ("uint8", "uint16", "float16", "float32", "float64")
_PLAIN = ("MINISWHITE", "MINISBLACK", "RGB")


def read_tiff(path: Path) -> NDArray[Any] | None:
    """Read a stack (T, H, W) or (T, H, W, 3); None = a picture for Pillow to read.

    Raises
    ------
    FormatError
        If the pages differ in size, the type is none of uint8, uint16 and floats, or
        the file is shorter than it says.
    """
    with tifffile.TiffFile(path) as tif:
        stack = _stack_of(tif, path)
        if stack is None:
            return None
        page = stack.keyframe
        try:
            samples = np.asarray(stack.asarray())
        except ValueError as error:
            lossless_in_pillow = page.bitspersample <= 8 or page.samplesperpixel == 1
            if "imagecodecs" in str(error) and lossless_in_pillow:
                return None
            raise
        return _finished(samples, stack.axes, page)


def tiff_frames(path: Path, start: int) -> Iterator[NDArray[Any]] | None:
    """Return the frames from ``start`` on, read one by one.

    None = one by one they cannot be read: use `read_tiff`. Errors as there, in the
    iteration.
    """
    with tifffile.TiffFile(path) as tif:
        stack = _stack_of(tif, path)
        if stack is None:
            return None
        axes = str(stack.axes)
        # One axis of time, first; several (a hyperstack) are for `read_tiff` to judge.
        alone = axes[1:] in ("YX", "YXS") and axes[0] not in "YXSC"
        count = int(stack.shape[0])
        contiguous = stack.dataoffset is not None
        if not alone or not (contiguous or len(stack.pages) == count):
            return None
    return _each_frame(path, start)


def _each_frame(path: Path, start: int) -> Iterator[NDArray[Any]]:
    with tifffile.TiffFile(path) as tif:
        stack = _stack_of(tif, path)
        assert stack is not None, "the caller has looked"
        shape = stack.shape[1:]
        size = prod(shape)
        dtype = np.dtype(tif.byteorder + stack.dtype.char)
        for number in range(start, int(stack.shape[0])):
            if stack.dataoffset is None:
                samples = stack.pages[number].asarray()
            else:
                offset = stack.dataoffset + number * size * dtype.itemsize
                samples = tif.filehandle.read_array(dtype, size, offset).reshape(shape)
            native = samples.astype(dtype.newbyteorder("="), copy=False)
            yield _finished(native, stack.axes[1:], stack.keyframe)[0]


def _stack_of(tif: Any, path: Path) -> Any | None:
    """Return the one series of pictures; None = for Pillow to read."""
    # Reduced-resolution copies (thumbnails) are no frames.
    series = [s for s in tif.series if not s.keyframe.is_reduced]
    if not series:
        raise FormatError("at least one picture", "none")
    if len(series) > 1:
        shapes = f"{series[0].shape} and {series[1].shape}"
        raise FormatError("pages of one size and type", f"shapes {shapes}")
    stack = series[0]
    if _photometric(stack.keyframe) not in _PLAIN:
        return None
    if stack.nbytes > _LARGEST_RATIO * path.stat().st_size:
        raise FormatError("a size the file can hold", f"{stack.nbytes} bytes")
    return stack


def _photometric(page: Any) -> str:
    return str(getattr(page.photometric, "name", page.photometric))


def _finished(samples: NDArray[Any], axes: str, page: Any) -> NDArray[Any]:
    """Return (T, H, W[, 3]) upright, white high, of a type that is kept."""
    if page.bitspersample == 1:
        samples = samples.astype(np.uint8) * np.uint8(255)
    frames = _ordered(samples, axes, _photometric(page))
    if frames.dtype.name not in _DTYPES:
        raise FormatError(f"one of {', '.join(_DTYPES)}", f"{frames.dtype}")
    if _photometric(page) == "MINISWHITE" and frames.dtype.kind == "u":
        frames = np.iinfo(frames.dtype).max - frames
    tag = page.tags.get(_ORIENTATION)
    return _upright(frames, int(tag.value) if tag is not None else 1)


def write_tiff(path: Path, frames: NDArray[Any]) -> None:
    """Write (T, H, W) or (T, H, W, 3) as an uncompressed multi-page TIFF."""
    write_tiff_frames(path, frames, frames.shape, frames.dtype)


def write_tiff_frames(
    path: Path,
    frames: Iterable[NDArray[Any]],
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
) -> None:
    """Write frames that come one by one; ``shape`` is that of all of them together."""
    colour = len(shape) == 4
    tifffile.imwrite(
        path,
        iter(frames),
        shape=shape,
        dtype=dtype,
        photometric="rgb" if colour else "minisblack",
        metadata={"axes": "TYXS" if colour else "TYX"},
    )


def _ordered(samples: NDArray[Any], axes: str, photometric: str) -> NDArray[Any]:
    """Bring ``axes`` to T, Y, X and, for colour, three channels; drop alpha."""
    for position in reversed(range(len(axes))):
        if axes[position] not in "YXS" and samples.shape[position] == 1:
            samples = samples.squeeze(position)
            axes = axes[:position] + axes[position + 1 :]
    if "S" not in axes:
        axes = axes.replace("C", "S")
    time = [axis for axis in axes if axis not in "YXS"]
    if len(time) > 1 or "Y" not in axes or "X" not in axes:
        raise FormatError("axes of time, row, column, channel", f"axes {axes!r}")
    order = [axes.index(axis) for axis in [*time, "Y", "X", *("S" * ("S" in axes))]]
    samples = samples.transpose(order)
    if not time:
        samples = samples[np.newaxis]
    if "S" not in axes:
        return np.ascontiguousarray(samples)
    channels = samples.shape[-1]
    if photometric == "RGB" or channels in (3, 4):
        if channels < 3:
            raise FormatError("3 channels of colour", f"{channels}")
        return np.ascontiguousarray(samples[..., :3])
    if channels > 2:
        raise FormatError("1 to 4 channels", f"{channels}")
    return np.ascontiguousarray(samples[..., 0])


def _upright(frames: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Undo the orientation tag: 2-4 mirror rows or columns, 5-8 transpose too."""
    if orientation in (5, 6, 7, 8):
        frames = frames.swapaxes(1, 2)
    if orientation in (3, 4, 7, 8):
        frames = frames[:, ::-1]
    if orientation in (2, 3, 6, 7):
        frames = frames[:, :, ::-1]
    return np.ascontiguousarray(frames)
