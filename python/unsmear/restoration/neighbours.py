"""What the frames next to one can tell of it, and where.

Frames that are blurred differently do not register: flow between them errs by a pixel
and more, where .03 px is wanted. Their restorations do. So flow is measured between the
restored neighbours, both ways, and settled (`registration`); a pixel of a neighbour is
seen in the frame if the way there and back ends where it began, inside the picture, and
its own path crosses no jump of the flow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.clip_motion import ClipMotion
from unsmear.restoration.joint import Neighbour
from unsmear.restoration.memo import Memo
from unsmear.restoration.registration import settled
from unsmear.restoration.sampling import composed, inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.clip_exposure import ClipExposure
    from unsmear.restoration.line_pairing import LinePairing
    from unsmear.restoration.source import Source
    from unsmear.restoration.walks import Walks

    Plane = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["Neighbours", "seen_in"]

LEAST_RETURN, RELATIVE_RETURN = 0.7, 0.1
"""Of the way there and back, px, and as a share of the way: farther is hidden."""


class Neighbours:
    """The neighbours of the frames of a clip, registered when they are asked for.

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
    walks : Walks
        Its frames, restored by themselves.
    method : str
        Of `unsmear.optical_flow`.
    options : dict
        Its parameters.
    """

    def __init__(
        self,
        source: Source,
        motion: ClipMotion,
        exposure: ClipExposure,
        lines: LinePairing,
        walks: Walks,
        *,
        method: str,
        options: dict[str, Any],
    ) -> None:
        self._source = source
        self._motion = motion
        self._exposure = exposure
        self._lines = lines
        self._walks = walks
        self._memo = Memo()
        self._between = ClipMotion(
            walks.twin,
            source.count,
            colour=False,
            method=method,
            options=options,
            memo=self._memo,
        )

    def around(self, index: int, reach: int) -> dict[int, Neighbour]:
        """Return the frames up to ``reach`` away, registered to frame ``index``."""
        first = max(0, index - reach)
        last = min(self._source.count - 1, index + reach)
        others = [other for other in range(first, last + 1) if other != index]
        return {other: self._neighbour(other, index) for other in others}

    def _neighbour(self, other: int, index: int) -> Neighbour:
        way, back = self._between.flow(other, index), self._between.flow(index, other)
        assert way is not None, "frames of the clip"
        assert back is not None, "frames of the clip"
        motion = self._motion.motion(other)
        exposure = self._exposure.exposure(other).value
        visible = _unsmear.visibility(
            np.ascontiguousarray(motion.velocity, np.float32), exposure
        )
        seen = seen_in(way, back, visible)
        return Neighbour(
            self._source.planes(other),
            motion,
            exposure,
            settled(self._walks.twin(other), self._walks.twin(index), way, seen),
            seen,
            self._walks.ceiling(other),
            self._lines.field(other),
        )

    def forget_before(self, index: int) -> None:
        """Drop what no frame from ``index`` on needs."""
        self._memo.forget_before(index)


def seen_in(way: Field, back: Field, visible: Plane) -> Plane:
    """Return 1 where a frame's pixels are seen in another, 0 elsewhere and beside.

    ``way`` and ``back`` are the flows (H, W, 2) to the other and from it, ``visible``
    (H, W) is 0 where a pixel mixes several motions.
    """
    limit = np.maximum(LEAST_RETURN, RELATIVE_RETURN * np.linalg.norm(way, axis=-1))
    returned = np.linalg.norm(composed(way, back), axis=-1) < limit  # false for NaN
    hidden = ~(inside(way) & returned & (visible > 0))
    return (~_unsmear.dilated(hidden, 1)).astype(np.float32)
