"""What of a restoration to use, where, and why, in words.

Every connected region that moves is judged by itself, so that a small mover on a still
scene is not voted down by it: with e the squared errors against the restored
neighbours (`twin_frames`),

    ratio = sqrt(mean e(restored) / mean e(blurred)),

used up to a limit that depends on the trust in the exposure, to which the ratio is
blind, and on the blur: neighbours carried by flow with its small errors fit a sharper
picture worse, so that short blur is used although the ratio is a little above 1; long
blur only below, for its ringing costs more than it could gain. Within a region used,
places where the restoration is clearly worse than the blurred frame are left out
softly,

    local(p) = sqrt((G e_x + k E_x) / (G e_b + k E_b)),

G a Gaussian of 12 px, E the region's means. What blurs by less than 0.3 px is returned
as it came, bit for bit, fading in up to 0.6 px. So is, from 3 to 6 px on, what moves
far in a frame in which hardly anything does: the exposure that is assumed there was
assumed for short blur, and a fast thing alone does not tell its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.sampling import smoothed
from unsmear.restoration.twin_frames import errors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.twin_frames import Twins

    Plane = NDArray[np.float32]

__all__ = ["Verdict", "judge"]

LIMITS = {"given": 1.08, "ok": 1.08, "small": 1.1, "unsure": 0.98, "beyond": 0.9}
SHORT_BLUR, LONG_BLUR = 3.0, 6.0
LIMIT_OF_LONG_BLUR = 0.97
LOCAL_SMOOTHING = 12.0
REGION_SHARE = 0.5
LOCAL_LIMIT = (1.15, 1.3)
STILL, FULL = 0.3, 0.6
SMALLEST_REGION = 64
LOW_RISK, HIGH_RISK = 0.85, 1.0


@dataclass(frozen=True)
class Verdict:
    """What to use.

    Attributes
    ----------
    share : ndarray of shape (H, W), float32
        Of the restoration in the result; 0 = as it came.
    ratio : float
        Over all regions; NaN where nothing could be compared.
    report : dict
        In numbers and words.
    """

    share: Plane
    ratio: float
    report: dict[str, Any]


def judge(
    blurred: Plane, restored: Plane, against: Twins, blur: Plane, status: str
) -> Verdict:
    """Judge a restoration; ``blur`` is the length of blur (px) of every pixel."""
    length = np.nan_to_num(blur)
    fade = np.clip((length - STILL) / (FULL - STILL), 0.0, 1.0)
    if status == "small":
        fade *= np.clip((LONG_BLUR - length) / (LONG_BLUR - SHORT_BLUR), 0.0, 1.0)
    own, input_ = errors(restored, against), errors(blurred, against)
    known = np.isfinite(own) & np.isfinite(input_)
    labels, count = _unsmear.regions(against.moving)
    share = np.zeros(blurred.shape)
    found: list[dict[str, Any]] = []
    for number in range(1, count + 1):
        region = labels == number
        pixels = int(region.sum())
        if pixels < SMALLEST_REGION:
            continue
        compared = region & known
        ratio = _ratio(own, input_, compared)
        limit = _limit(status, float(np.median(blur[region])))
        # Without a neighbour to compare with, only a trusted exposure speaks for it.
        used = ratio <= limit if np.isfinite(ratio) else status in ("given", "ok")
        one = {"pixels": pixels, "ratio": _plain(ratio), "limit": limit}
        found.append(one | {"used": bool(used)})
        if used:
            share[region] = _locally(own, input_, compared)[region]
    left = bool(((share > 0) & (fade == 0) & (length > LONG_BLUR)).any())
    share *= fade
    ratio = _ratio(own, input_, known)
    report = {
        "ratio": _plain(ratio),
        "regions": sorted(found, key=lambda one: -one["pixels"]),
        **_words(ratio, found, status),
    }
    if left:
        report["verdict"] += (
            f"; what is blurred by more than {LONG_BLUR:.0f} px as it was, for its "
            "exposure is not known"
        )
    return Verdict(share.astype(np.float32), ratio, report)


def _limit(status: str, blur: float) -> float:
    """Return the greatest ratio to use; ``blur`` is the median of a region, px."""
    limit = LIMITS[status]
    share = np.clip((blur - SHORT_BLUR) / (LONG_BLUR - SHORT_BLUR), 0.0, 1.0)
    return round(limit - float(share) * max(limit - LIMIT_OF_LONG_BLUR, 0.0), 3)


def _ratio(
    own: NDArray[np.float64], input_: NDArray[np.float64], where: NDArray[np.bool_]
) -> float:
    if not where.any():
        return float("nan")
    return float(np.sqrt(own[where].mean() / max(input_[where].mean(), 1e-9)))


def _locally(
    own: NDArray[np.float64], input_: NDArray[np.float64], where: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return how far to use the restoration in a region that is used."""
    if not where.any():
        return np.ones(own.shape)
    weight = smoothed(where.astype(np.float64), LOCAL_SMOOTHING) + REGION_SHARE
    parts = [
        smoothed(np.where(where, error, 0.0), LOCAL_SMOOTHING)
        + REGION_SHARE * error[where].mean()
        for error in (own, input_)
    ]
    local = np.sqrt(parts[0] / np.maximum(parts[1], 1e-9 * weight))
    low, high = LOCAL_LIMIT
    return np.asarray(np.clip((high - local) / (high - low), 0.0, 1.0))


def _words(ratio: float, found: list[dict[str, Any]], status: str) -> dict[str, Any]:
    """Say what was found, what to expect and what was done."""
    used = [one for one in found if one["used"]]
    if not found:
        text = "left as is: nothing moves enough to be blurred"
    elif not used:
        limit = max(found, key=lambda one: one["pixels"])["limit"]
        text = f"left as is: restored frames disagree (ratio {ratio:.2f}, at most "
        text += f"{limit:.2f})"
        if status == "beyond":
            text += (
                " and the blur is longer than a shutter makes it: flow must be wrong"
            )
        elif status == "unsure":
            text += " and the exposure could not be found with certainty"
    elif len(used) < len(found):
        text = (
            f"restored {len(used)} of {len(found)} moving regions, the rest as it was"
        )
    else:
        text = "restored"
    gain = None
    if used and np.isfinite(ratio):
        # Both restorations err by s, independently: e_x = 2 s^2, e_b = b^2 + s^2.
        gain = round(float(10 * np.log10(max(2 / max(ratio, 1e-3) ** 2 - 1, 0.1))), 1)
    risk = "none" if not used else "low"
    if used and (not np.isfinite(ratio) or ratio > HIGH_RISK):
        risk = "high"
    elif used and (ratio > LOW_RISK or status in ("unsure", "small")):
        risk = "medium"
    return {"verdict": text, "expected_gain_db": gain, "ringing_risk": risk}


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
