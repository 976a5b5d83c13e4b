"""Sequences with truth in a folder tree: which frames, which flow, which pixels count.

Every flow file whose name ends in a number, ``flow_0010.flo`` or ``flow10.flo``, is the
truth of one sequence. Its frames are pictures of the same folder whose names differ in
their last number only, that number and the next one among them; around them the
sequence runs as far as numbers have no gap. Where truth and frames live apart, as in
Middlebury's ``other-gt-flow/Venus`` and ``other-data/Venus`` or in Sintel, the frames
are looked for in every other folder of the tree that has the same name.

Pictures of the truth's folder beside the frames say which pixels count: ``mask_NAME``
those to count (not 0), as a second figure; ``occlusions`` those to leave out of a
second figure; ``invalid`` those to leave out of all.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from unsmear.flow_files import read_flow
from unsmear.images import PICTURE_SUFFIXES, read_image

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["SuiteSequence", "find_sequences"]

# PNG is left out: it is the frames' format too.
_FLOW_SUFFIXES = frozenset({".flo", ".pfm", ".flo5"})
_NUMBERED = re.compile(r"(.*?)([0-9]+)")
_OCCLUDED, _INVALID, _MASK = "occlusions", "invalid", "mask"


@dataclass(frozen=True)
class SuiteSequence:
    """Frames with the true flow of one of them.

    Attributes
    ----------
    name : str
        Its folder relative to the suite's, with slashes; with the frame's number where
        a folder has several flows.
    frames : tuple of Path
        Consecutive pictures.
    index : int
        Frame whose motion to the next the truth is.
    truth : Path
        Flow file.
    masks : dict of str to Path
        Pictures: pixels that count are not 0.
    without : dict of str to Path
        Pictures: pixels that count are 0.
    invalid : Path or None
        Picture: where it is not 0 the truth is unknown.
    """

    name: str
    frames: tuple[Path, ...]
    index: int
    truth: Path
    masks: dict[str, Path] = field(default_factory=dict)
    without: dict[str, Path] = field(default_factory=dict)
    invalid: Path | None = None

    def read_truth(self) -> NDArray[np.float32]:
        """Return the true flow (H, W, 2), px/frame, NaN where it does not count."""
        truth = read_flow(self.truth).copy()
        if self.invalid is not None:
            truth[_mask(self.invalid, truth.shape[:2])] = np.nan
        return truth

    def subsets(self, shape: tuple[int, int]) -> dict[str, NDArray[np.bool_]]:
        """Return the parts (H, W) of the picture that are judged on their own."""
        parts = {name: _mask(path, shape) for name, path in self.masks.items()}
        for name, path in self.without.items():
            parts[f"no {name}"] = ~_mask(path, shape)
        return parts


def find_sequences(folder: str | os.PathLike[str]) -> list[SuiteSequence]:
    """Return the sequences with truth below ``folder``, sorted by name.

    Parameters
    ----------
    folder : path-like
        Searched with all folders in it; hidden ones are passed over.

    Returns
    -------
    list of SuiteSequence

    Raises
    ------
    FileNotFoundError
        There is no such folder.
    ValueError
        Nothing in it is a sequence with truth, or frames for a truth are ambiguous.
    """
    root = Path(folder)
    if not root.is_dir():
        msg = f"folder must exist, got {str(root)!r}"
        raise FileNotFoundError(msg)
    files = sorted(
        path
        for path in root.rglob("*")
        if path.is_file() and not any(p[0] == "." for p in path.relative_to(root).parts)
    )
    truths = [path for path in files if path.suffix.lower() in _FLOW_SUFFIXES]
    pictures: dict[Path, list[Path]] = {}
    for path in files:
        if path.suffix.lower() in PICTURE_SUFFIXES:
            pictures.setdefault(path.parent, []).append(path)
    found = []
    for truth in truths:
        homes = [truth.parent]
        if _run_around(truth, pictures.get(truth.parent, [])) is None:
            homes = sorted(home for home in pictures if home.name == truth.parent.name)
        several = sum(other.parent == truth.parent for other in truths) > 1
        for home in homes:
            run = _run_around(truth, pictures.get(home, []))
            if run is not None:
                name = home.relative_to(root).as_posix()
                name = f"{name} {_number(truth)}" if several else name
                beside = pictures.get(truth.parent, [])
                found.append(_sequence(name, run, truth, beside))
    if not found:
        msg = f"folder must hold flow files and their frames, got none in {root}"
        raise ValueError(msg)
    return sorted(found, key=lambda sequence: sequence.name)


def _number(path: Path) -> int | None:
    match = _NUMBERED.fullmatch(path.stem)
    return int(match[2]) if match else None


def _run_around(truth: Path, pictures: list[Path]) -> tuple[list[Path], int] | None:
    """Frames without a gap around the truth's number, and its place; None if none."""
    number = _number(truth)
    if number is None:
        return None
    series: dict[tuple[str, str], dict[int, Path]] = {}
    for path in pictures:
        match = _NUMBERED.fullmatch(path.stem)
        if match:
            key = (match[1], path.suffix.lower())
            series.setdefault(key, {})[int(match[2])] = path
    runs = []
    for numbered in series.values():
        if number not in numbered or number + 1 not in numbered:
            continue
        first, last = number, number + 1
        while first - 1 in numbered:
            first -= 1
        while last + 1 in numbered:
            last += 1
        run = [numbered[n] for n in range(first, last + 1)]
        runs.append((run, number - first))
    if len(runs) > 1:
        names = ", ".join(repr(run[at].name) for run, at in runs)
        msg = f"frames of {truth.name!r} must be one series of pictures, got {names}"
        raise ValueError(msg)
    return runs[0] if runs else None


def _sequence(
    name: str, run: tuple[list[Path], int], truth: Path, beside: list[Path]
) -> SuiteSequence:
    frames, index = run
    masks, without, invalid = {}, {}, None
    for path in beside:
        number = _number(path)
        if path in frames or number not in (None, _number(truth)):
            continue
        word = re.sub(r"[_-]*[0-9]*$", "", path.stem)
        if word.startswith(_MASK):
            masks[word.removeprefix(_MASK).strip("_-") or _MASK] = path
        elif word == _OCCLUDED:
            without[word] = path
        elif word == _INVALID:
            invalid = path
    return SuiteSequence(name, tuple(frames), index, truth, masks, without, invalid)


def _mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    picture = read_image(path)
    if picture.shape[:2] != shape:
        msg = (
            f"{path.name!r} must have shape {shape} like the truth, got {picture.shape}"
        )
        raise ValueError(msg)
    return np.asarray(picture != 0 if picture.ndim == 2 else (picture != 0).any(-1))
