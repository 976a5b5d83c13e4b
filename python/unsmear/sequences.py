"""Image sequences in and out: folders, globs, lists, stacks and videos.

A sequence is one array (T, H, W) or (T, H, W, 3) in the type its files have: frame t
is the picture at time t, in frame intervals. All frames must agree in size, channels
and type. Where they are found `frame_files` tells.

Pictures are read and written by the rules of `images`, videos by those of `video`.
"""

from __future__ import annotations

import os
import re
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._atomic import atomic_path, write_bytes_atomic
from unsmear._gif import encode_gif
from unsmear._tiff import write_tiff
from unsmear.frame_files import Source, is_video, located, natural_key
from unsmear.images import (
    TIFF_SUFFIXES,
    as_integers,
    as_path,
    check_pictures,
    describe,
    encode_picture,
    read_stack,
)
from unsmear.video import WRITE_SUFFIXES, read_video, write_video

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["read_frames", "write_frames"]

_DEFAULT_FPS = 25.0
_FEWEST_DIGITS = 4
_FRAME_NAME = re.compile(r"frame_[0-9]+\.png", re.IGNORECASE)
_COLOUR_WIDTHS = (3, 4)


def read_frames(source: Source | Iterable[Source]) -> NDArray[Any]:
    """Read an image sequence.

    Parameters
    ----------
    source : path-like or iterable of path-like
        A folder (its pictures in natural order; hidden files and files that are no
        pictures are passed over), a glob such as ``"clip/*_left.png"`` (``**`` crosses
        folders), an iterable of picture files in the order given, a multi-page TIFF,
        an animation (.gif, .png, .webp), a single picture (T = 1), or a video
        (``pip install "unsmear[video]"``).

    Returns
    -------
    ndarray of shape (T, H, W) or (T, H, W, 3)
        In the type of the files: uint8, uint16, or float16/32/64 from TIFF. Palettes
        and GIF become RGB, alpha is dropped, 16-bit colour PNG keeps its 16 bits.

    Raises
    ------
    ValueError
        If there is no picture, a file is empty or corrupt, or a frame differs from
        the first in size, channels or type; the message names the file.
    FileNotFoundError
        If a path without wildcards does not exist.
    TypeError
        If ``source`` is neither a path nor an iterable of paths.
    ImportError
        If a video is given and PyAV is not installed.
    """
    files = located(source)
    return _read_file(files) if isinstance(files, Path) else _stack_files(files)


def write_frames(
    target: Source, frames: ArrayLike, *, fps: float | None = None
) -> None:
    """Write an image sequence.

    Parameters
    ----------
    target : path-like
        A folder (no suffix, an existing folder, or a path ending in a slash), which
        receives ``frame_0000.png``, ...; a .tif or .tiff stack; a .gif; or a video:
        .mkv and .avi (lossless, 8 and 16 bit), .mp4 and .mov (H.264, 8 bit, lossy).
    frames : array_like of shape (T, H, W), (T, H, W, 1) or (T, H, W, 3)
        uint8, uint16, bool (0 and 255) or float. TIFF keeps every type; elsewhere
        floats in [0, 1] are stored as 16 bit (8 bit in .gif, .mp4, .mov) and floats
        outside [0, 1] or NaN are refused.
    fps : float, optional
        Frames per second of a video or GIF; 25 by default, a common camera rate.
        Folders and TIFF have no clock: there it must be None.

    Raises
    ------
    ValueError
        If shape, values, suffix or ``fps`` do not fit, or the folder already holds
        frames of a longer sequence, which would be read as part of this one.
    TypeError
        If the frames' type is none of the above.
    ImportError
        If a video is asked for and PyAV is not installed.

    Notes
    -----
    Each file appears whole or not at all. Frames of an interrupted folder are whole,
    but some may be missing or still those of an earlier run.
    """
    path = as_path(target, "target")
    suffix = path.suffix.lower()
    is_folder = is_folder_name(target)
    stack = _check_frames(frames)
    timed = not is_folder and suffix not in TIFF_SUFFIXES
    rate = _check_fps(fps, timed=timed)
    if is_folder:
        _write_folder(path, stack)
    elif suffix in TIFF_SUFFIXES:
        with atomic_path(path) as temporary:
            write_tiff(temporary, stack)
    elif suffix == ".gif":
        write_bytes_atomic(path, encode_gif(as_integers(stack, "frames", 8), rate))
    elif suffix in WRITE_SUFFIXES:
        write_video(path, stack, rate)
    else:
        raise unknown_suffix(path)


def _read_file(path: Path) -> NDArray[Any]:
    """Read one file that may hold many frames."""
    return read_video(path) if is_video(path) else read_stack(path)


def _stack_files(paths: Sequence[Path]) -> NDArray[Any]:
    """Read files of one picture each into one array."""
    first = read_single(paths[0])
    frames = np.empty((len(paths), *first.shape), first.dtype)
    frames[0] = first
    for t, path in enumerate(paths[1:], start=1):
        picture = read_single(path)
        if describe(picture) != describe(first):
            raise ValueError(
                f"frames must agree in size, channels and type, got {describe(picture)}"
                f" in {str(path)!r} after {describe(first)} in {str(paths[0])!r}"
            )
        frames[t] = picture
    return frames


def read_single(path: Path) -> NDArray[Any]:
    """Read a file of one picture; ValueError where it holds several."""
    stack = read_stack(path)
    if len(stack) != 1:
        raise ValueError(
            f"each file of a sequence must hold one picture, got {len(stack)} in "
            f"{str(path)!r}; give that file alone to read it as a stack"
        )
    return np.asarray(stack[0])


def unknown_suffix(path: Path) -> ValueError:
    """Return the error of a target that no writer is for."""
    known = ", ".join(sorted({".gif", *TIFF_SUFFIXES, *WRITE_SUFFIXES}))
    return ValueError(
        f"target must be a folder or end in one of {known}, got {str(path)!r}"
    )


def _check_frames(frames: ArrayLike) -> NDArray[Any]:
    """Check frames; one colour picture handed in by mistake is not H grey frames."""
    stack = check_pictures(frames, "frames", stack=True)
    given = np.shape(frames)
    if len(given) == 3 and given[-1] in _COLOUR_WIDTHS and given[1] > given[-1]:
        raise ValueError(
            f"frames must have shape (T, H, W) or (T, H, W, 3), got {given}, which "
            "looks like one colour picture: use write_image, or give grey frames of "
            "this width as (T, H, W, 1)"
        )
    return stack


def _check_fps(fps: float | None, *, timed: bool) -> float:
    if fps is None:
        return _DEFAULT_FPS
    if not timed:
        raise ValueError(f"fps must be None for a folder or a TIFF stack, got {fps}")
    if isinstance(fps, bool) or not isinstance(fps, int | float | np.number):
        raise TypeError(f"fps must be a number, got {type(fps).__name__}")
    if not (isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be a positive finite number, got {fps}")
    return float(fps)


def _write_folder(folder: Path, frames: NDArray[Any]) -> None:
    samples = as_integers(frames, "frames", None)
    folder.mkdir(parents=True, exist_ok=True)
    names = names_in_folder(folder, len(samples))
    for name, frame in zip(names, samples, strict=True):
        write_bytes_atomic(folder / name, encode_picture(frame, "PNG"))


def names_in_folder(folder: Path, count: int) -> list[str]:
    """Return the names of ``count`` frames; ValueError where others would stay."""
    digits = max(_FEWEST_DIGITS, len(str(count - 1)))
    names = [f"frame_{t:0{digits}d}.png" for t in range(count)]
    files = folder.iterdir() if folder.is_dir() else ()
    present = {path.name for path in files if _FRAME_NAME.match(path.name)}
    stale = sorted(present - set(names), key=natural_key)
    if stale:
        raise ValueError(
            f"target must not hold frames of another sequence, got {str(folder)!r} "
            f"with {stale[0]} and {len(stale) - 1} more; remove them first"
        )
    return names


def is_folder_name(target: Source) -> bool:
    """Whether frames written to ``target`` become files of a folder."""
    path = Path(target)
    ends_in_slash = os.fspath(target).endswith(("/", os.sep))
    return path.is_dir() or ends_in_slash or not path.suffix
