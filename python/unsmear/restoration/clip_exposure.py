"""Exposure of every frame: searched over three frames, smoothed over five.

Of the estimates s_j around a frame those that can be relied on count, by how near and
how sharp they are,

    log s = sum w_j log s_j / sum w_j,   w_j = (1 - |j - i| / 3) / (spread_j^2 + .02^2),

so that a shutter that stays as it is gives an exposure that stays as it is. Found a
little above 1 it is as good as 1: recorded clips open all the time are found at 1.04 to
1.09, and gain 1 to 4 dB from the truth. Where less than half of them can be relied on,
or those scatter by more than a shutter that stays as it is, none can, and the frame's
own cautious value is used; where it is cautious because blur is short, the mean over
frames like it, by how near they are.

Codecs leave out what is weaker than their steps. Of H.264 at usual settings (crf 17 to
28) the search then made nothing. It says "unsure" with hardly any blur for likeliest,
and is asked again as if noise hid what is missing: the zeros of the blur among the
stronger, slower waves tell the exposure within 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from unsmear.restoration.clip_motion import ClipMotion
    from unsmear.restoration.memo import Memo
    from unsmear.restoration.source import Source

__all__ = ["ClipExposure", "Exposure"]

LIMITS = (0.06, 2.0)
LONGEST = 1.25
"""No shutter is open for more than 1; flow too short by a fifth is nothing unusual."""
WHOLE = 1.012
"""What restores a clip best whose shutter is open all the time, flow being a hundredth
too short: 1.006 to 1.018 of a recorded clip and four of photographs."""
ERROR = 0.1
"""By which an exposure of 1 may be found too long; twice that is another one."""
MANY_TILES = 32
"""Of which an exposure longer than that is believed. Fewer show one thing, whose own
spectrum may have a gap: cars of 30 px gave exposures from 1.6 to 2.3."""
CODED_NOISE = (3.0, 5.0)
"""Noise, grey levels, below which a codec may have taken away what was recorded."""
CODED_LIKELIEST = 0.2
CODED_GREATEST_NOISE = 1.5
POOLED = 1
SMOOTHED = 2
LEAST_SPREAD = 0.02
GREATEST_SCATTER = 0.25
"""Of log s over the frames around one. Those of shaken clips scatter by .1, those found
in lines of print, which have gaps of their own in their spectra, by .4 and more."""
NEARLY, CLOSE_SCATTER = 0.6, 0.05
"""Least vote of frames that are nearly sure, and how far they may scatter: two of three
plausible kinds of scene, and as far as the exposure of a clip is read wrong at all."""


@dataclass(frozen=True)
class Exposure:
    """Exposure of a frame.

    Attributes
    ----------
    value : float
        Share of the frame interval.
    status : {"given", "ok", "unsure", "small", "beyond"}
        "beyond": longer than a shutter makes it, so the flow is wrong at least.
    noise : float
        Standard deviation of the noise, grey levels.
    found : dict
        What the search over the frame and its neighbours said.
    """

    value: float
    status: str
    noise: float
    found: dict[str, Any]


class ClipExposure:
    """Exposures of a clip, each found when it is first asked for."""

    def __init__(
        self,
        source: Source,
        motion: ClipMotion,
        memo: Memo,
        *,
        given: float | None,
        noise: float | None,
        seed: int,
    ) -> None:
        self._source = source
        self._motion = motion
        self._memo = memo
        self._given = given
        self._noise = noise
        self._seed = seed

    def exposure(self, index: int) -> Exposure:
        """Return the exposure of a frame."""
        return self._memo.get("exposure", index, lambda: self._smoothed(index))

    def _found(self, index: int) -> dict[str, Any]:
        return self._memo.get("found", index, lambda: self._search(index))

    def _search(self, index: int) -> dict[str, Any]:
        found = self._likeliest(index, self._noise)
        if self._noise is None and self._given is None and _looks_coded(found):
            for noise in CODED_NOISE:
                again = self._likeliest(index, noise)
                if again["status"] == "ok":
                    # What is left of noise is what the restoration has to bear.
                    return again | {"noise": found["noise"]}
        return found

    def _likeliest(self, index: int, noise: float | None) -> dict[str, Any]:
        frames = self._around(index, POOLED)
        motions = [self._motion.motion(j).everywhere for j in frames]
        return dict(
            _unsmear.estimate_exposure(
                np.stack([self._source.luma(j) for j in frames]),
                _stack([velocity for velocity, _ in motions]),
                _stack([acceleration for _, acceleration in motions]),
                LIMITS,
                noise,
                self._seed + index,
                of_content=True,
            )
        )

    def _around(self, index: int, reach: int) -> range:
        return range(max(0, index - reach), min(self._source.count, index + reach + 1))

    def _smoothed(self, index: int) -> Exposure:
        own = self._found(index)
        if self._given is not None:
            return Exposure(self._given, "given", own["noise"], own)
        near = self._around(index, SMOOTHED)
        value = self._agreed(index, near, _sure, GREATEST_SCATTER)
        if value is None:
            value = self._agreed(index, near, _nearly_sure, CLOSE_SCATTER)
        if value is None:
            value, status = own["value"], own["status"]
            if status == "ok":
                value, status = min(value, 1.0), "unsure"
            elif status == "small":
                alike = [j for j in near if self._found(j)["status"] == "small"]
                value = self._mean(alike, [_nearness(j, index) for j in alike])
            return Exposure(float(value), status, own["noise"], own)
        value = _of_shutter(value)
        status = "ok" if value <= LONGEST else "beyond"
        return Exposure(value, status, own["noise"], own)

    def _agreed(
        self,
        index: int,
        near: range,
        reading: Callable[[dict[str, Any]], float | None],
        limit: float,
    ) -> float | None:
        """Return what half of the frames at least say, if it scatters little."""
        logs, weights = [], []
        for j in near:
            found = self._found(j)
            value = reading(found)
            if value is not None:
                logs.append(np.log(value))
                spread = found["spread"] ** 2 + LEAST_SPREAD**2
                weights.append(_nearness(j, index) / spread)
        if 2 * len(logs) < len(near):
            return None
        mean = np.average(logs, weights=weights)
        scatter = np.sqrt(np.average((np.array(logs) - mean) ** 2, weights=weights))
        return float(np.exp(mean)) if scatter <= limit else None

    def _mean(self, frames: list[int], weights: list[float]) -> float:
        logs = [np.log(self._found(j)["value"]) for j in frames]
        return float(np.exp(np.average(logs, weights=weights)))


def _sure(found: dict[str, Any]) -> float | None:
    """Return what the search found, if that can be relied on."""
    possible = found["value"] <= LONGEST or found["tiles"] >= MANY_TILES
    return float(found["value"]) if found["status"] == "ok" and possible else None


def _nearly_sure(found: dict[str, Any]) -> float | None:
    """Return what is likeliest where a third of the kinds of scene say otherwise.

    Believed only of many tiles that agree, and if frames do: print has gaps of its own
    in its spectrum, which some kinds of scene take for those of blur.
    """
    value = _sure(found)
    if value is not None or found["status"] != "unsure":
        return value
    alike = found["tiles"] >= MANY_TILES and found["spread"] <= LEAST_SPREAD
    inside = LIMITS[0] < found["likeliest"] <= LONGEST
    sure = alike and found["vote"] >= NEARLY and inside
    return float(found["likeliest"]) if sure else None


def _of_shutter(found: float) -> float:
    """Return the exposure to use: no shutter is open for longer than the interval."""
    far, last = 1 + 2 * ERROR, LIMITS[1]
    return float(
        np.interp(found, (0, WHOLE, 1 + ERROR, far, last), (0, WHOLE, WHOLE, far, last))
    )


def _looks_coded(found: dict[str, Any]) -> bool:
    """Return whether fine detail is missing as codecs leave it out.

    They drop what is weaker than their steps, noise first: the spectrum ends early, as
    no scene's does, and the search takes hardly any blur for likeliest.
    """
    return bool(
        found["status"] == "unsure"
        and found["likeliest"] < CODED_LIKELIEST
        and found["noise"] < CODED_GREATEST_NOISE
    )


def _nearness(other: int, index: int) -> float:
    return 1 - abs(other - index) / (SMOOTHED + 1)


def _stack(fields: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.stack(fields), np.float32)
