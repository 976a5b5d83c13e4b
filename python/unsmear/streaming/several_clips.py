"""Several clips: which they are, where their restorations go, one after the other."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from unsmear.frame_files import matches
from unsmear.images import PICTURE_SUFFIXES, TIFF_SUFFIXES
from unsmear.streaming.deblur_clip import deblur_clip
from unsmear.video import READ_SUFFIXES, WRITE_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Sequence

    from unsmear.streaming.results import ClipResult

    Job = tuple[str | list[str], str]
    ProgressOfClips = Callable[[int, float], object]

__all__ = [
    "FAILURES",
    "ClipOutcome",
    "clips_among",
    "one_after_another",
    "reason",
    "targets_in",
]

UNFINISHED = ".part"
LOSSLESS_VIDEO, LOSSLESS_STACK = ".mkv", ".tif"
FAILURES = (ValueError, TypeError, OSError, ImportError, MemoryError)
"""What may be wrong with one clip and not with the next."""


@dataclass(frozen=True)
class ClipOutcome:
    """What became of a clip.

    Attributes
    ----------
    number : int
        Its place among those given, from 0.
    source : str or list of str
        Where it came from.
    target : str
        Where it went.
    result : ClipResult or None
        What was made; None if it failed.
    error : str or None
        Why it failed.
    """

    number: int
    source: str | list[str]
    target: str
    result: ClipResult | None
    error: str | None


def clips_among(names: Sequence[str], *, each: bool) -> list[str] | None:
    """Return the clips that ``names`` are, or None if they are the frames of one.

    Several videos and folders are clips; pictures are frames, unless ``each`` says that
    every name, and every match of a pattern, is a clip of its own. Unfinished jobs and
    hidden files that match a pattern are passed over.

    Raises
    ------
    ValueError
        If ``each`` is set and there is nothing.
    """
    found: list[Path] = []
    for name in names:
        found += (path for path in matches(name) if _is_source(path, name))
    if each:
        if not found:
            raise ValueError(f"source must match clips, got none for {names}")
        return [str(path) for path in found]
    clips = all(path.is_dir() or _suffix(path) in READ_SUFFIXES for path in found)
    return [str(path) for path in found] if clips and len(found) > 1 else None


def _is_source(path: Path, name: str) -> bool:
    if str(path) == str(Path(name)):
        return True
    if path.name.startswith(".") or _suffix(path) == UNFINISHED:
        return False
    return path.is_dir() or _suffix(path) in READ_SUFFIXES | PICTURE_SUFFIXES


def _suffix(path: Path) -> str:
    return path.suffix.lower()


def targets_in(folder: str, clips: Sequence[str]) -> list[str]:
    """Return a place in ``folder`` for each clip, of its name and, if it can be, kind.

    Videos that cannot be written become .mkv, stacks and animations .tif; a folder of
    pictures becomes a folder.

    Raises
    ------
    ValueError
        If two clips have one name, or one would take the place of its source.
    """
    targets: dict[Path, str] = {}
    result = []
    for clip in clips:
        path = Path(clip)
        name = path.name
        if not path.is_dir() and _suffix(path) not in WRITE_SUFFIXES | TIFF_SUFFIXES:
            video = _suffix(path) in READ_SUFFIXES
            name = path.stem + (LOSSLESS_VIDEO if video else LOSSLESS_STACK)
        target = Path(folder) / name
        if target in targets:
            raise ValueError(
                "clips must have different names to be written to one folder, got "
                f"{targets[target]!r} and {clip!r}"
            )
        if target.exists() and path.exists() and target.samefile(path):
            raise ValueError(
                f"output must be another folder than that of the clips, got {folder!r}"
            )
        targets[target] = clip
        # A separator at the end tells a folder from a file, whatever its name.
        result.append(str(target) + (os.sep if path.is_dir() else ""))
    return result


def one_after_another(
    jobs: Iterable[Job], *, progress: ProgressOfClips | None = None, **options: Any
) -> Generator[ClipOutcome, None, None]:
    """Restore clips, and go on with the next where one fails.

    Parameters
    ----------
    jobs : iterable of (source, target)
        As for `unsmear.deblur_clip`.
    progress : callable, optional
        Called with a clip's number and the share of it that is done; an exception it
        raises cancels all that is left.
    **options
        As for `unsmear.deblur_clip`.
    """
    for number, (source, target) in enumerate(jobs):
        made, error = None, None

        def share_done(share: float, number: int = number) -> None:
            if progress is not None:
                progress(number, share)

        try:
            made = deblur_clip(source, target, progress=share_done, **options)
        except FAILURES as failure:
            error = reason(failure)
        yield ClipOutcome(number, source, target, made, error)


def reason(failure: BaseException) -> str:
    """Return what is to be told of an exception."""
    return str(failure) or type(failure).__name__
