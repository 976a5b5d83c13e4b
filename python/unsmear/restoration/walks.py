"""Every frame's luma restored with growing strength of the prior.

From these a strength is chosen, the neighbours take their twins and the channels their
start; and they tell what clipped samples mean (`clipping`). They go line by line, which
is enough to compare and takes half the time of splines: what is shown is made from them
by the finer operator.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.clipping import brighter_than_white
from unsmear.restoration.looks import (
    LINES,
    SPLINE,
    TWIN,
    WALK,
    Look,
    cropped,
    look,
    walk,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.clip_exposure import ClipExposure
    from unsmear.restoration.clip_motion import ClipMotion
    from unsmear.restoration.line_pairing import LinePairing
    from unsmear.restoration.memo import Memo
    from unsmear.restoration.source import Source

    Plane = NDArray[np.float32]
    Planes = NDArray[np.float32]

__all__ = ["Walks"]


class Walks:
    """The frames' walks, each made when it is first asked for.

    Parameters
    ----------
    source : Source
        The clip.
    motion : ClipMotion
        What blurred its frames.
    exposure : ClipExposure
        Theirs.
    lines : LinePairing
        Where their lines lie.
    memo : Memo
        Keeps what was computed.
    """

    def __init__(
        self,
        source: Source,
        motion: ClipMotion,
        exposure: ClipExposure,
        lines: LinePairing,
        memo: Memo,
    ) -> None:
        self._source = source
        self._motion = motion
        self._exposure = exposure
        self._lines = lines
        self._memo = memo

    def pictures(self, index: int) -> tuple[list[Planes], int]:
        """Return the padded restorations of a frame, one per strength, and the pad."""
        pictures, pad, _ = self._walk(index)
        return pictures, pad

    def twin(self, index: int) -> Plane:
        """Return the restoration that neighbours are compared with, (H, W)."""
        pictures, pad = self.pictures(index)
        return np.asarray(cropped(pictures[TWIN], pad)[0])

    def ceiling(self, index: int) -> float | None:
        """Return the grey level from which samples of a frame are clipped light."""
        return self._walk(index)[2]

    def look(self, index: int, taps: str = SPLINE) -> Look:
        """Return the solver's look at all channels of a frame."""
        return self._look(index, self._source.planes(index), self.ceiling(index), taps)

    def _look(
        self, index: int, planes: Planes, ceiling: float | None, taps: str
    ) -> Look:
        motion = self._motion.motion(index)
        exposure = self._exposure.exposure(index).value
        visible = _unsmear.visibility(motion.velocity, exposure)
        return look(
            planes,
            motion.velocity,
            motion.acceleration,
            exposure,
            visible,
            self._lines.field(index),
            ceiling=ceiling,
            taps=taps,
        )

    def _walk(self, index: int) -> tuple[list[Planes], int, float | None]:
        return self._memo.get("walk", index, lambda: self._start(index))

    def _start(self, index: int) -> tuple[list[Planes], int, float | None]:
        luma = self._source.luma(index)[np.newaxis]
        noise = self._exposure.exposure(index).noise
        ceiling = self._source.ceiling
        own = self._look(index, luma, ceiling, LINES)
        pictures, pad = walk([own], WALK, noise)
        if ceiling is not None and not brighter_than_white(own, pictures[TWIN], pad):
            ceiling = own["ceiling"] = None
            pictures, pad = walk([own], WALK, noise)
        return pictures, pad, ceiling
