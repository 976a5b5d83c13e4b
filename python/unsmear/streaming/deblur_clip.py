"""Blurred clips in files, sharp clips in files, however long."""

from __future__ import annotations

import errno
from contextlib import contextmanager
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_flow
from unsmear._parameters import merged
from unsmear._plain_data import plain_data
from unsmear.deblur import METHODS
from unsmear.images import as_path
from unsmear.sequence import settings_of
from unsmear.streaming.clip import Clip, open_clip
from unsmear.streaming.part_folder import PartFolder
from unsmear.streaming.restorers import (
    by_the_chain,
    confidence_between,
    one_by_one,
)
from unsmear.streaming.results import ClipResult, Sample
from unsmear.streaming.targets import writer_for

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress
    from unsmear.frame_files import Source
    from unsmear.restoration.records import Settings
    from unsmear.streaming.restorers import Restored

__all__ = ["deblur_clip"]

AUTOMATIC = "auto"
SAMPLED = 24
"""Frames of which flow and pictures are kept for a report, however long the clip."""


def deblur_clip(
    source: Source | Iterable[Source],
    target: Source,
    *,
    method: str = AUTOMATIC,
    exposure: float | str = AUTOMATIC,
    flow: ArrayLike | None = None,
    flow_method: str = "balanced",
    joint: int = 3,
    second_pass: bool | None = None,
    noise: float | None = None,
    seed: int = 0,
    fps: float | None = None,
    audio: bool = True,
    resume: bool = False,
    samples: bool = False,
    progress: Progress | None = None,
    **flow_parameters: Any,
) -> ClipResult:
    """Restore a clip from file to file, frame by frame.

    Memory does not grow with the clip, but for some kilobytes of report per frame.
    The frames are those that `unsmear.deblur_sequence` returns for the whole clip, bit
    for bit, before the target's format takes its share.

    Parameters
    ----------
    source : path-like or iterable of path-like
        As for `unsmear.read_frames`. At least 2 frames, unless ``flow`` is given.
    target : path-like
        As for `unsmear.write_frames`: a folder, .tif, .gif, .mkv, .avi, .mp4 or .mov.
        Depth (10 bit in .mp4 and .mov for every deeper source), frame rate, varying
        or not, colour range and tags, shape of pixels and sound of a video are kept.
    method : str, default "auto"
        "auto": all that `unsmear.deblur_sequence` does. Else one of
        `unsmear.deblur`, by which every frame is restored by itself.
    exposure, flow_method, joint, second_pass, noise, seed, **flow_parameters
        As for `unsmear.deblur_sequence`; ``flow_method`` may be any of
        `unsmear.optical_flow` for methods other than "auto". Those that pool all
        frames are given 15.
    flow : array_like of shape (H, W, 2), optional
        Velocity of all frames, px/frame; NaN = unknown. Default: measured. With
        "auto" it means the method "tv".
    fps : float, optional
        Frames per second of a source without a clock; default 25.
    audio : bool, default True
        Copy the sound of a video into a video.
    resume : bool, default False
        Go on where a run with the same source and parameters was broken off. What it
        finished is in the folder ``TARGET.part``, which a killed run leaves behind,
        and an interrupted or failed one if ``resume`` is set. The target is, byte for
        byte, that of an unbroken run.
    samples : bool, default False
        Return up to 24 frames, spread over the clip, with their velocity.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.

    Returns
    -------
    ClipResult

    Raises
    ------
    ValueError
        A damaged source, frames of different sizes, a parameter out of range, a target
        that cannot hold the frames or the sound, or an unfinished job that differs.
    OSError
        If the target cannot be written: no permission, no space left, another process
        at work on it.
    TypeError, ImportError
        As `unsmear.read_frames` and `unsmear.deblur_sequence`.

    Notes
    -----
    The target appears whole or not at all; a folder that exists is filled at the end,
    file by file. The source is read twice: once to check and count it.

    Examples
    --------
    >>> import tempfile, numpy as np, unsmear
    >>> texture = unsmear.synthetic.texture((100, 100), seed=3)
    >>> blurred = unsmear.synthetic.translation(texture, (5.0, 2.0), shape=(64, 64),
    ...     exposure=0.8, n_frames=3, bits=8).blurred
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     unsmear.write_frames(f"{folder}/clip.tif", blurred)
    ...     made = unsmear.deblur_clip(f"{folder}/clip.tif", f"{folder}/sharp.tif")
    ...     sharp = unsmear.read_frames(f"{folder}/sharp.tif")
    >>> made.count, bool((sharp == unsmear.deblur_sequence(blurred).frames).all())
    (3, True)
    """
    path = as_path(target, "target")
    motion = None if flow is None else as_flow(flow)
    options: dict[str, Any] = {
        "method": "tv" if motion is not None and method == AUTOMATIC else method,
        "exposure": exposure,
        "flow_method": flow_method,
        "joint": joint,
        "second_pass": second_pass,
        "noise": noise,
        "seed": seed,
        "flow_parameters": flow_parameters,
    }
    _check(options)
    with open_clip(source, fps=fps, progress=progress) as clip:
        if len(clip) < 2 and motion is None:
            msg = "one frame alone shows no motion: give more frames, or a flow"
            raise ValueError(msg)
        writer = writer_for(clip, target, audio=audio)
        job = {
            "source": clip.fingerprint,
            "frames": len(clip),
            **options,
            "flow": None if motion is None else blake2b(motion.tobytes()).hexdigest(),
            "rate": str(clip.clock.rate),
            "output": writer.describe(),
            "version": _unsmear.__version__,
        }
        with (
            _told_of_full_disks(path),
            PartFolder(path, plain_data(job), writer, resume=resume) as part,
        ):
            taken_up_at = part.done
            writer.try_out(part.path)
            restored = _restored(clip, part.done, options, motion)
            _work(clip, part, restored, progress)
            reports = list(part.reports())
            measured = motion is None
            shown = _samples(clip, part, options, measured=measured) if samples else []
            writer.publish(part.pieces, path, part.path)
    return ClipResult(path, len(clip), taken_up_at, reports, writer.warnings, shown)


def _check(options: dict[str, Any]) -> None:
    """Raise what is wrong with the parameters before anything is read."""
    method = options["method"]
    if method not in (AUTOMATIC, *METHODS):
        names = ", ".join(repr(name) for name in (AUTOMATIC, *METHODS))
        raise ValueError(f"method must be one of {names}, got {method!r}")
    if method == AUTOMATIC:
        _settings_at(options, 1.0)
    else:
        merged(options["flow_method"], options["flow_parameters"])


def _settings_at(options: dict[str, Any], scale: float) -> Settings:
    return settings_of(
        options["exposure"],
        options["noise"],
        options["flow_method"],
        options["flow_parameters"],
        options["joint"],
        options["seed"],
        scale,
    )


def _restored(
    clip: Clip,
    start: int,
    options: dict[str, Any],
    flow: NDArray[np.float32] | None,
) -> Iterator[Restored]:
    if start == len(clip):
        return iter(())
    if options["method"] == AUTOMATIC:
        return by_the_chain(
            clip,
            start,
            lambda scale: _settings_at(options, scale),
            second_pass=options["second_pass"],
        )
    return one_by_one(
        clip,
        start,
        flow=flow,
        flow_method=options["flow_method"],
        flow_parameters=options["flow_parameters"],
        method=options["method"],
        exposure=options["exposure"],
        noise=options["noise"],
    )


def _work(
    clip: Clip,
    part: PartFolder,
    restored: Iterator[Restored],
    progress: Progress | None,
) -> None:
    """Restore and keep every frame that is not done."""
    sampled = _sampled(clip)
    if progress is not None:
        progress(part.done / len(clip))
    for picture, velocity, report in restored:
        if part.done in sampled:
            part.add_sample(part.done, restored=picture, flow=velocity)
        part.add(picture, plain_data(report))
        if progress is not None:
            progress(part.done / len(clip))
    part.finish_pieces(last=True)


def _sampled(clip: Clip) -> list[int]:
    count = min(len(clip), SAMPLED)
    return sorted({int(i) for i in np.linspace(0, len(clip) - 1, count).round()})


def _samples(
    clip: Clip, part: PartFolder, options: dict[str, Any], *, measured: bool
) -> list[Sample]:
    def confidence(index: int) -> NDArray[np.float32] | None:
        if not measured:
            return None
        method, parameters = options["flow_method"], options["flow_parameters"]
        return confidence_between(clip, index, method, parameters)

    return [
        Sample(
            index,
            np.array(clip[index]),
            confidence=confidence(index),
            **part.sample(index),
        )
        for index in _sampled(clip)
    ]


@contextmanager
def _told_of_full_disks(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        msg = f"no space left on the disk of {str(path)!r}"
        raise OSError(msg) from error
