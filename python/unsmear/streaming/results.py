"""What restoring a clip returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["ClipResult", "Sample"]


@dataclass(frozen=True)
class Sample:
    """One of the frames kept for a report.

    Attributes
    ----------
    index : int
        Its number in the clip.
    blurred, restored : ndarray of shape (H, W) or (H, W, 3)
        As it came and as it was written.
    flow : ndarray of shape (H, W, 2), float32
        Velocity at mid-exposure, px/frame; NaN = unknown.
    confidence : ndarray of shape (H, W), float32, or None
        Of the motion to the next frame (of the last, to the one before) measured on the
        frames as they came, in [0, 1]; None where motion was given or pooled over many
        frames.
    """

    index: int
    blurred: NDArray[Any]
    restored: NDArray[Any]
    flow: NDArray[np.float32]
    confidence: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class ClipResult:
    """What was made of a clip.

    Attributes
    ----------
    written : pathlib.Path
        The file or folder.
    count : int
        Number of frames.
    taken_up_at : int
        Frames that an earlier run had finished.
    reports : list of dict
        One per frame, as `unsmear.SequenceResult.reports` or
        `unsmear.DeblurResult.report`.
    warnings : list of str
        What of the source the target does not hold.
    samples : list of Sample
        Up to 24 frames spread over the clip, if asked for.
    """

    written: Path
    count: int
    taken_up_at: int
    reports: list[dict[str, Any]] = field(repr=False)
    warnings: list[str]
    samples: list[Sample] = field(repr=False)
