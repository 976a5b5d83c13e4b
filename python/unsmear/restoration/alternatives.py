"""Shorter and longer exposures, tried where the search was not sure."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from unsmear.restoration.chain import Chain
from unsmear.restoration.clip_exposure import LIMITS

if TYPE_CHECKING:
    from unsmear.restoration.records import Restored, Settings
    from unsmear.restoration.source import Source

__all__ = ["Alternatives"]

ALTERNATIVES = (0.7, 1.4)
"""Exposures tried where the search was not sure, relative to the one assumed."""
AS_GOOD = 1.05
"""Twins tell exposures apart whose ratios differ by more than this factor."""
LONGEST = 1.0
"""No shutter is open for more: longer ones cost a small mover 1 to 4 dB."""
LEAST_BLUR = 4.0
"""Blur (95 % quantile, px) from which twins tell exposures apart at all."""
CONVINCING = 0.9
"""Ratio below which one is used of a frame that would otherwise be left as it came."""
MOST_CHAINS = 4


class Alternatives:
    """Shorter and longer exposures, tried where the search for it was not sure.

    Twin frames err alike under a wrong exposure and hardly notice a small error of it;
    half as much again they do. Of those as good to them as the best the one next to
    what the search found likeliest is taken. A frame that would be left as it came may
    only have had neighbours restored by a wrong exposure: of it they are tried too. Of
    blur without gaps in its spectrum twins know nothing: they would take the longest
    for the best, and lose 1 to 8 dB.
    """

    def __init__(
        self,
        source: Source,
        settings: Settings,
    ) -> None:
        self._source = source
        self._settings = settings
        self._chains: dict[float, Chain] = {}

    def best(
        self, index: int, result: Restored, chain: Chain
    ) -> tuple[Restored, Chain]:
        """Return the restoration its twins, or the search among equals, speak for."""
        if result.alone is None or result.report["blur_px"] < LEAST_BLUR:
            return result, chain
        value = result.report["exposure"]
        likeliest = result.report["exposure_found"]["likeliest"]
        found = likeliest is not None and LIMITS[0] < likeliest < LIMITS[1]
        tried = [(value, result, chain)]
        for factor in ALTERNATIVES:
            exposure = min(round(factor * value, 2), LONGEST)
            if exposure == value:
                continue
            other = self._chain(exposure)
            restored = other.restored(index)
            convincing = result.changed.any() or restored.ratio < CONVINCING
            if restored.changed.any() and convincing:
                tried.append((exposure, restored, other))
        limit = AS_GOOD * min(one.ratio for _, one, _ in tried)
        if not found:
            _, best, best_chain = min(tried, key=lambda one: one[1].ratio)
        else:
            _, best, best_chain = min(
                (one for one in tried if one[1].ratio <= limit),
                key=lambda one: abs(math.log(one[0] / likeliest)),
            )
        if best is not result:
            best.report["exposure_status"] = "unsure"
        return best, best_chain

    def _chain(self, exposure: float) -> Chain:
        if exposure not in self._chains:
            if len(self._chains) >= MOST_CHAINS:
                self._chains.pop(next(iter(self._chains)))
            settings = replace(self._settings, exposure=exposure)
            self._chains[exposure] = Chain(self._source, self._source.guide, settings)
        return self._chains[exposure]

    def forget_before(self, index: int) -> None:
        """Drop what no frame from ``index`` on needs."""
        for chain in self._chains.values():
            chain.forget_before(index)
