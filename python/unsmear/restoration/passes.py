"""Passes over a clip, each measuring flow on what the one before restored.

Where motion changes much from frame to frame, blur differs between frames, and flow
between them errs by a fifth of its length. Restored by it they are sharper still, and
flow on them is better: of 15 px that turn by 60 degrees from frame to frame the
velocity errs by 3.1, 1.1 and .9 px in three passes. They go on as long as frames agree
better with their restored neighbours (`twin_frames`) than after the pass before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.restoration.chain import KEPT_BEHIND, REACH, Chain
from unsmear.restoration.looks import cropped

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from unsmear.restoration.records import Restored, Settings
    from unsmear.restoration.source import Source

__all__ = ["Passes", "reach"]

MOST_PASSES = 3
UNSTEADY = 0.25
"""Acceleration relative to velocity from which a further pass is worth its time."""
PROVEN = 0.99
"""Ratio below which a pass is shown after passes that were not."""
PROMISING = 1.3
"""Ratio of the verdict below which flow is measured on the restored frame, whether that
is good enough to be shown or not."""


def reach(again: bool | None, joint: int) -> int:
    """Return how many frames on each side a restored one may depend on, at most.

    ``again`` is that of `Passes.best`; ``joint`` frames are restored together.
    """
    passes = 1 if again is False else MOST_PASSES
    return passes * REACH + joint // 2


class Passes:
    """Passes over a clip, made when they are asked for.

    Parameters
    ----------
    source : Source
        The clip.
    settings : Settings
        Of the chain.
    """

    def __init__(
        self,
        source: Source,
        settings: Settings,
    ) -> None:
        self._source = source
        self._chains = [Chain(source, source.guide, settings)]
        for _ in range(1, MOST_PASSES):
            guide = self._restored_by(self._chains[-1])
            self._chains.append(Chain(source, guide, settings))

    def best(self, index: int, again: bool | None) -> tuple[Restored, Chain, int]:
        """Return a restored frame, the pass that made it, and its number from 1.

        ``again``: whether there is more than one pass; None: where motion is unsteady.
        """
        chain = self._chains[0]
        result = last = chain.restored(index)
        passes = 1
        if again is None:
            again = _promising(result) and chain.unsteadiness(index) > UNSTEADY
        for number, following in enumerate(self._chains[1:] if again else (), start=2):
            before, last = last, following.restored(index)
            if not last.ratio < before.ratio:
                break
            # One that is not good enough to be shown may still guide one that is. That
            # has more to prove: motion was hard to find there.
            good = result.changed.any() or last.ratio < PROVEN
            if last.changed.any() and good:
                result, chain, passes = last, following, number
        return result, chain, passes

    def _restored_by(self, chain: Chain) -> Callable[[int], NDArray[Any]]:
        def restored(index: int) -> NDArray[Any]:
            result = chain.restored(index)
            planes = result.planes
            if result.alone is not None and _promising(result):
                # What was not recorded is made up, in bars out of nothing.
                picture = cropped(result.alone.picture, result.alone.pad)
                planes = np.where(np.isnan(result.planes), result.planes, picture)
            planes = planes / self._source.scale
            return planes[0] if len(planes) == 1 else np.moveaxis(planes, 0, -1)

        return restored

    def forget_before(self, index: int) -> None:
        """Drop what no frame from ``index`` on needs."""
        for back, chain in enumerate(reversed(self._chains)):
            chain.forget_before(index, guided=back * KEPT_BEHIND)


def _promising(result: Restored) -> bool:
    return bool(result.changed.any()) or bool(result.ratio < PROMISING)
