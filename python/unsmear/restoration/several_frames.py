"""Frames of a clip restored with what their neighbours saw of them.

Each by `joint`, from its own restoration; then the means along the motion, by
`agreement`, over those of the frame and of its neighbours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from unsmear.restoration.agreement import agreed
from unsmear.restoration.joint import Joint, Neighbour, restore_jointly
from unsmear.restoration.looks import cropped
from unsmear.restoration.memo import Memo
from unsmear.restoration.sampling import pulled

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from unsmear.restoration.looks import Look
    from unsmear.restoration.neighbours import Neighbours
    from unsmear.restoration.records import Restored

__all__ = ["SeveralFrames"]


class SeveralFrames:
    """Joint restorations, made when they are asked for.

    Parameters
    ----------
    neighbours : Neighbours
        Of the frames.
    alone : callable
        Returns a frame restored by itself, by its index.
    own : callable
        Returns the solver's look at a frame.
    noise : callable
        Returns the noise of a frame, grey levels.
    reach : int
        Frames on each side that are used.
    """

    def __init__(
        self,
        neighbours: Neighbours,
        alone: Callable[[int], Restored],
        own: Callable[[int], Look],
        noise: Callable[[int], float],
        reach: int,
    ) -> None:
        self._neighbours = neighbours
        self._alone = alone
        self._own = own
        self._noise = noise
        self._reach = reach
        self._memo = Memo()

    def restored(self, index: int) -> tuple[NDArray[np.float32], int, dict[str, Any]]:
        """Return the channels of a frame that is blurred, padded, the pad and a report.

        The channels have shape (C, H + 2 pad, W + 2 pad).
        """
        joint, registered = self._joint(index)
        near = []
        for other in registered:
            theirs = self._alone(other).alone
            if theirs is not None and theirs.share.any():
                found, back = self._joint(other)
                way, seen = back[index].offset, back[index].seen
                seen = seen * pulled(theirs.share, way, degree=1)
                near.append((cropped(found.picture, found.pad), way, seen))
        own = cropped(joint.picture, joint.pad)
        picture, inner = joint.picture.copy(), slice(joint.pad, -joint.pad or None)
        picture[:, inner, inner] = agreed(own, near, self._noise(index))
        report = {"neighbours_weight": joint.weight, "kept_alone": joint.kept}
        return picture, joint.pad, report

    def _joint(self, index: int) -> tuple[Joint, dict[int, Neighbour]]:
        """Return the joint restoration, and the neighbours registered to it."""
        return self._memo.get("joint", index, lambda: self._join(index))

    def _join(self, index: int) -> tuple[Joint, dict[int, Neighbour]]:
        alone = self._alone(index).alone
        assert alone is not None, "a frame that was restored"
        registered = self._neighbours.around(index, self._reach)
        joint = restore_jointly(
            self._own(index),
            list(registered.values()),
            alone.picture,
            alone.pad,
            strength=alone.strength,
            noise=self._noise(index),
        )
        return joint, registered

    def forget_before(self, index: int) -> None:
        """Drop what no frame from ``index`` on needs."""
        self._memo.forget_before(index)
        self._neighbours.forget_before(index)
