"""Several frames restored as one, registered to the restoration itself.

Frame n sees the scene of frame i moved: its path is D_n + d_n, with d_n(p) the smooth
displacement from n to i (`registration`). The frames' own blurs differ, so it is found
between restorations, and refined against the restoration x that is being made: with
r_n = A_n x what frame n should have recorded and e the displacement from b_n to r_n,

    d_n(p) <- e(p) + d_n(p + e(p)).

Two pictures blurred alike register to better than either to a sharp one. A datum of a
neighbour counts by

    w = seen * c^2 / (c^2 + G * min((r_n - b_n)^2, 20^2)),      c^2 = 8 sigma^2 + 4,

G a Gaussian of 6 px: where the neighbour does not show what the restoration predicts
it is left out, whatever the reason. One frame alone knows little of what another one,
blurred otherwise, recorded: hence two rounds, the second from what the first found. In
the end x must still explain what the frame itself recorded: where the root of

    G * min((A x - b)^2, 20^2) + sigma^2

exceeds that of the restoration of the frame alone by a fifth to a half, the former
gives way to the latter.

K frames blurred alike are as one with a K-th of the noise's variance, for which the
prior is weaker by K^(1.25 / 2) (`deblur/total_variation.rs`), while data count K times:
lambda_K = K^0.375 lambda. Frames blurred differently leave less to the prior to guess
and were best with K^0.5 to K^0.7 (photographs, noise 0 to 5); K^0.5 is used. The prior
is the sharper one, even where that was not better for one frame: .3 to 1.2 dB better
than total variation for two layers, a rotation and a translation whose motion was
found, not given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.looks import (
    GREATEST_ERROR,
    SHARP_STRENGTH,
    Look,
    cropped,
    limited_squares,
    look,
    walk,
)
from unsmear.restoration.registration import settled
from unsmear.restoration.sampling import carried, pulled_field, smoothed
from unsmear.restoration.source import Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.clip_motion import Motion

    Plane = NDArray[np.float32]
    Planes = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["Joint", "Neighbour", "restore_jointly"]

SMOOTHING = 6.0
STRENGTH_EXPONENT = 0.5
ROUNDS = ((2, 12), (3, 12))
"""Turns and steps of each solution, after as many registrations."""
UNEXPLAINED = (1.2, 1.5)
"""Residual relative to that of the frame alone from which, and at which at last, the
frame alone is kept. A single frame fits its own noise by a tenth or so."""


@dataclass
class Neighbour:
    """A frame next to the one restored.

    Attributes
    ----------
    planes : ndarray of shape (C, H, W)
        Grey levels.
    motion : Motion
        Its own.
    exposure : float
        Its own.
    offset : ndarray of shape (H, W, 2)
        Displacement from it to the restored frame, px; NaN = unknown.
    seen : ndarray of shape (H, W)
        How far its pixels are believed to show what the restored frame shows, [0, 1].
    ceiling : float or None
        Grey level from which its samples are clipped.
    lines : ndarray of shape (H, W, 2) or None
        Where its lines lie, px from their own place (`line_pairing`).
    """

    planes: Planes
    motion: Motion
    exposure: float
    offset: Field
    seen: Plane
    ceiling: float | None = None
    lines: Field | None = None

    def look(self, weights: Plane) -> Look:
        """Return the solver's look at it."""
        return look(
            self.planes,
            carried(self.offset, self.motion.velocity),
            self.motion.acceleration,
            self.exposure,
            weights,
            self.offset if self.lines is None else self.offset + self.lines,
            self.ceiling,
        )

    def register(self, picture: Planes, pad: int) -> None:
        """Refine the offset against the padded restoration."""
        predicted = _unsmear.record_look(self.look(self.seen), picture, pad)
        recorded = np.nan_to_num(Source.luma_of(self.planes))
        nothing = np.zeros_like(self.offset)
        rest = settled(recorded, Source.luma_of(predicted), nothing, self.seen)
        moved = rest + pulled_field(self.offset, rest)
        self.offset = np.where(np.isfinite(moved), moved, self.offset)

    def trusted(self, picture: Planes, pad: int, noise: float) -> Look:
        """Return the look, weighted by how well the restoration predicts it."""
        every = self.look(self.seen)
        error = _errors(every, picture, pad)
        scale = 8 * noise**2 + 4
        weights = every["weights"] * (scale / (scale + smoothed(error, SMOOTHING)))
        every["weights"] = np.ascontiguousarray(weights, np.float32)
        return every


@dataclass(frozen=True)
class Joint:
    """What several frames gave.

    Attributes
    ----------
    picture : ndarray of shape (C, H + 2 pad, W + 2 pad), float32
        Grey levels.
    pad : int
        Of the picture.
    weight : float
        The neighbours' mean weight.
    kept : float
        Share of the frame in which its own restoration was kept.
    """

    picture: Planes
    pad: int
    weight: float
    kept: float


def restore_jointly(
    own: Look,
    neighbours: list[Neighbour],
    alone: Planes,
    pad: int,
    *,
    strength: float,
    noise: float,
) -> Joint:
    """Return the restoration of a frame with what its neighbours saw of it.

    Parameters
    ----------
    own : Look
        The frame itself.
    neighbours : list of Neighbour
        Their offsets are refined in place.
    alone : ndarray of shape (C, H + 2 pad, W + 2 pad)
        The frame restored by itself.
    pad : int
        Of ``alone``.
    strength : float
        lambda of one frame by total variation, grey levels.
    noise : float
        Standard deviation, grey levels.
    """
    picture, now, weight = alone, pad, 0.0
    for effort in ROUNDS if neighbours else ():
        for neighbour in neighbours:
            neighbour.register(picture, now)
        looks = [own, *(n.trusted(picture, now, noise) for n in neighbours)]
        each = [float(one["weights"].mean()) for one in looks[1:]]
        weight = float(np.mean(each))
        way = strength * SHARP_STRENGTH * (1 + sum(each)) ** STRENGTH_EXPONENT
        needed = max(now, _unsmear.looks_reach(looks))
        picture, now = _padded(picture, needed - now), needed
        pictures, _ = walk(
            looks, (way,), noise, pad=now, first=effort, start=picture, sharp=True
        )
        picture = pictures[-1]
    alone = _padded(alone, now - pad)
    share = _explained(own, picture, alone, now, noise)
    mixed = alone + share * (picture - alone)
    kept = float(1 - cropped(share[np.newaxis], now).mean())
    return Joint(np.ascontiguousarray(mixed, np.float32), now, weight, kept)


def _explained(
    own: Look, picture: Planes, alone: Planes, pad: int, noise: float
) -> Plane:
    """Return the share of the joint restoration to use, (H + 2 pad, W + 2 pad)."""
    ours, before = (
        np.sqrt(smoothed(_errors(own, one, pad), SMOOTHING) + noise**2 + 1e-6)
        for one in (picture, alone)
    )
    low, high = UNEXPLAINED
    share = np.clip((high - ours / before) / (high - low), 0.0, 1.0)
    return np.pad(share, pad, mode="edge").astype(np.float32)


def _errors(at: Look, picture: Planes, pad: int) -> NDArray[np.float64]:
    """Return (A x - b)^2, limited, as the mean of the channels; (H, W)."""
    predicted = _unsmear.record_look(at, picture, pad)
    return limited_squares(predicted - at["planes"], unknown=GREATEST_ERROR)


def _padded(picture: Planes, more: int) -> Planes:
    return np.pad(picture, ((0, 0), (more, more), (more, more)), mode="edge")
