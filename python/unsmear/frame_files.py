"""Where the frames of a sequence are: which files, in which order, of which kind.

Files of a folder or glob are taken in natural order, in which numbers inside names
count as numbers: frame_2 comes before frame_10. What a file is its suffix says; behind
a suffix that is not known, what Pillow can open is a picture, all else a video.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from unsmear.images import PICTURE_SUFFIXES, as_path
from unsmear.video import READ_SUFFIXES

__all__ = ["is_video", "located", "matches", "natural_key"]

Source = str | os.PathLike[str]


def located(source: Source | Iterable[Source]) -> Path | list[Path]:
    """Return where frames are: one file that may hold many, or files of one each.

    Raises
    ------
    ValueError, FileNotFoundError, TypeError
        As `read_frames`.
    """
    if isinstance(source, str | os.PathLike):
        path = as_path(source, "source")
        if path.is_dir():
            return _pictures_of_folder(path)
        if path.exists() or not _is_glob(path):
            return path
        matches = _pictures_of_glob(path)
        return matches[0] if len(matches) == 1 else matches
    if not isinstance(source, Iterable):
        raise TypeError(
            f"source must be a path or several paths, got {type(source).__name__}"
        )
    paths = [as_path(item, "each item of source") for item in source]
    if not paths:
        raise ValueError("source must name at least one picture, got an empty list")
    return paths


def matches(name: Source) -> list[Path]:
    """Return what a pattern matches, in natural order; the path itself if it is none.

    A name with wildcards under which there is something is that, and no pattern.
    """
    path = as_path(name, "source")
    return [path] if path.exists() or not _is_glob(path) else _matches(path)


def is_video(path: Path) -> bool:
    """Whether a file is for the video decoder: neither named nor made a picture."""
    suffix = path.suffix.lower()
    if suffix in READ_SUFFIXES or suffix in PICTURE_SUFFIXES:
        return suffix in READ_SUFFIXES
    try:
        with Image.open(path):
            return False
    except UnidentifiedImageError:
        return path.stat().st_size > 0


def natural_key(name: str) -> list[tuple[int, str]]:
    """Return a sort key in which runs of digits compare as numbers.

    The name itself comes last, so that frame_1 and frame_01 have a fixed order.
    """
    parts = re.split(r"([0-9]+)", name.casefold())
    # Odd parts are digits; equal numbers of digits without leading zeros compare as
    # text like numbers do, whatever their length.
    key = [
        (len(part.lstrip("0")), part.lstrip("0")) if i % 2 else (0, part)
        for i, part in enumerate(parts)
    ]
    return [*key, (0, name)]


def _path_key(path: Path) -> list[list[tuple[int, str]]]:
    return [natural_key(part) for part in path.parts]


def _is_glob(path: Path) -> bool:
    return any(wildcard in str(path) for wildcard in "*?[")


def _is_visible_picture(path: Path) -> bool:
    return (
        path.suffix.lower() in PICTURE_SUFFIXES
        and not path.name.startswith(".")
        and path.is_file()
    )


def _pictures_of_folder(folder: Path) -> list[Path]:
    files = sorted(folder.iterdir(), key=_path_key)
    pictures = [path for path in files if _is_visible_picture(path)]
    if not pictures:
        names = ", ".join(path.name for path in files[:3]) or "nothing"
        raise ValueError(
            f"source must hold pictures ({', '.join(sorted(PICTURE_SUFFIXES))}), "
            f"got the folder {str(folder)!r} with {names}"
        )
    return pictures


def _matches(pattern: Path) -> list[Path]:
    root = Path(pattern.anchor)
    relative = str(pattern.relative_to(root)) if pattern.anchor else str(pattern)
    return sorted(root.glob(relative), key=_path_key)


def _pictures_of_glob(pattern: Path) -> list[Path]:
    found = _matches(pattern)
    videos = [p for p in found if p.suffix.lower() in READ_SUFFIXES and p.is_file()]
    pictures = [path for path in found if _is_visible_picture(path)]
    if not pictures and len(videos) == 1:
        return videos
    if not pictures:
        raise ValueError(
            f"source must match pictures, got {len(found)} matches and no picture "
            f"for the pattern {str(pattern)!r}"
        )
    return pictures
