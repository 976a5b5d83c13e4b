r"""How well a candidate predicts what its neighbours look like when restored.

Two frames see the same scene with other noise and other gaps in their spectra. What a
restoration makes up is not in its neighbour's: so the candidate x of frame i is
compared with the restorations y of the frames next to it, carried to i by the flow,

.. math:: e(p) = \operatorname{mean}_y \min((x(p) - y(p))^2, 30^2)

over the pixels that move and that both see; the score is the root of its mean. A
strength of the prior is chosen by it, and whether a restoration is better than the
blurred frame (J. Lehtinen et al., Noise2Noise, ICML 2018, arXiv:1803.04189, for
comparison with noisy twins). A wrong exposure is wrong in both: the score is blind
to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.sampling import composed, pulled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Plane = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["Twins", "choose_strength", "errors", "of_noise", "score", "twins"]

GREATEST_ERROR = 30.0
LEAST_BLUR = 0.45
MARGIN = 4
TOLERANCE = 1.02
LEAST_STRENGTH = 0.5 * 0.065


@dataclass(frozen=True)
class Twins:
    """Restored neighbours carried to a frame.

    Attributes
    ----------
    pictures : list of ndarray of shape (H, W)
        Grey levels; NaN where not seen.
    moving : ndarray of shape (H, W), bool
        Pixels that count.
    """

    pictures: list[Plane]
    moving: NDArray[np.bool_]


def twins(
    neighbours: list[tuple[Plane, Field, Field]],
    velocity: Field,
    exposure: float,
) -> Twins:
    """Return the neighbours, each (restored luma, flow to it, flow back), at a frame.

    A pixel is seen in a neighbour if the way there and back ends where it began.
    """
    speed = np.linalg.norm(np.nan_to_num(velocity), axis=-1)
    moving = _unsmear.dilated(exposure * speed > LEAST_BLUR, MARGIN)
    moving &= np.isfinite(velocity).all(axis=-1)
    tolerance = np.maximum(1.0, 0.2 * speed)
    pictures = []
    for restored, way, back in neighbours:
        error = np.linalg.norm(composed(way, back), axis=-1)
        seen = error < tolerance
        pictures.append(np.where(seen, pulled(restored, way), np.nan))
    return Twins(pictures, moving)


def errors(candidate: Plane, against: Twins) -> NDArray[np.float64]:
    """Return e(p), squared grey levels, (H, W); NaN where nothing is compared."""
    total = np.zeros(candidate.shape)
    number = np.zeros(candidate.shape)
    for picture in against.pictures:
        error = (candidate.astype(np.float64) - picture) ** 2
        known = np.isfinite(error)
        total[known] += np.minimum(error[known], GREATEST_ERROR**2)
        number[known] += 1
    compared = against.moving & (number > 0)
    result = np.full(candidate.shape, np.nan)
    result[compared] = total[compared] / number[compared]
    return result


def score(candidate: Plane, against: Twins) -> float:
    """Return the root mean e over all pixels compared; NaN without any."""
    error = errors(candidate, against)
    known = np.isfinite(error)
    return float(np.sqrt(error[known].mean())) if known.any() else float("nan")


def choose_strength(
    strengths: tuple[float, ...], scores: list[float], noise: float
) -> float:
    """Return the least strength, interpolated, whose score is within 2 % of the best.

    The twins themselves are smooth, which favours smoothness: hence the least. Never
    below half of what the noise alone asks for.
    """
    floor = LEAST_STRENGTH * math.sqrt(noise) ** 3
    best = min(scores)
    if not math.isfinite(best):
        return max(math.sqrt(strengths[0] * strengths[1]), floor)
    limit = TOLERANCE * best
    first = next(k for k, value in enumerate(scores) if value <= limit)
    if first == 0:
        return max(strengths[0], floor)
    before, at = scores[first - 1], scores[first]
    share = (before - limit) / (before - at)
    step = math.log(strengths[first] / strengths[first - 1])
    return max(strengths[first - 1] * math.exp(share * step), floor)


def of_noise(noise: float, strengths: tuple[float, ...]) -> float:
    """Return the strength that the noise alone asks for, not below the least tried."""
    return max(2 * LEAST_STRENGTH * math.sqrt(noise) ** 3, strengths[0])
