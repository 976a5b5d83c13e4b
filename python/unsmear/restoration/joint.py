"""Several frames restored as one, registered to the restoration itself.

Frame n sees the scene of frame i moved: its path is D_n + d_n, with d_n(p) the flow
from n to i. A registration wrong by 0.3 px costs most of what a second frame gives; so
d_n is refined against the restoration x: with r_n = A_n x what frame n should have
recorded, and e the flow from b_n to r_n,

    d_n(p) <- e(p) + d_n(p + e(p)).

Two pictures blurred alike register to better than either to a sharp one. A datum of a
neighbour counts by

    w = seen * c^2 / (c^2 + G * min((r_n - b_n)^2, 20^2)),      c^2 = 2 sigma^2 + 1,

G a Gaussian of 6 px: where the neighbour does not show what the restoration predicts
it is left out, whatever the reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear.flow import optical_flow
from unsmear.restoration.looks import SHARP_STRENGTH, Look, look, walk
from unsmear.restoration.sampling import (
    carried,
    composed,
    inside,
    pulled_field,
    smoothed,
)
from unsmear.restoration.source import Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.clip_motion import Motion

    Planes = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["Neighbour", "restore_jointly"]

GREATEST_ERROR = 20.0
SMOOTHING = 6.0
STRENGTH = 0.6
"""lambda of the joint restoration relative to that of one frame: less noise."""
EFFORT = (4, 12)
SMOOTHNESS = 0.2
"""Of the flow that refines a registration: what is left of it varies slowly."""


class Neighbour:
    """A frame next to the one restored.

    Parameters
    ----------
    planes : ndarray of shape (C, H, W)
        Grey levels.
    motion : Motion
        Its own.
    exposure : float
        Its own.
    offset, way : ndarray of shape (H, W, 2)
        Flow from it to the restored frame, and back.
    ceiling : float or None
        Grey level from which its samples are clipped.
    """

    def __init__(
        self,
        planes: Planes,
        motion: Motion,
        exposure: float,
        offset: Field,
        way: Field,
        ceiling: float | None,
    ) -> None:
        self.planes = planes
        self.motion = motion
        self.exposure = exposure
        self.offset = offset
        self.ceiling = ceiling
        visible = _unsmear.visibility(
            np.ascontiguousarray(motion.velocity, np.float32), exposure
        )
        speed = np.linalg.norm(np.nan_to_num(offset), axis=-1)
        back = np.linalg.norm(composed(offset, way), axis=-1)
        hidden = ~(inside(offset) & (back < np.maximum(0.7, 0.1 * speed)))
        hidden |= visible == 0
        self.seen = (~_unsmear.dilated(hidden, 1)).astype(np.float32)

    def look(self, weights: NDArray[np.float32]) -> Look:
        """Return the solver's look at it."""
        velocity = carried(self.offset, self.motion.velocity)
        return look(
            self.planes,
            velocity,
            self.motion.acceleration,
            self.exposure,
            weights,
            self.offset,
            self.ceiling,
        )

    def register(self, picture: Planes, pad: int, method: str) -> None:
        """Refine the offset against the padded restoration."""
        predicted = _unsmear.record_look(self.look(self.seen), picture, pad)
        pair = np.stack([Source.luma_of(self.planes), Source.luma_of(predicted)])
        rest = optical_flow(
            np.nan_to_num(pair), index=0, method=method, smoothness=SMOOTHNESS
        ).flow
        moved = rest + pulled_field(self.offset, rest)
        self.offset = np.where(np.isfinite(moved), moved, self.offset)

    def trusted(self, picture: Planes, pad: int, noise: float) -> Look:
        """Return the look, weighted by how well the restoration predicts it."""
        every = self.look(self.seen)
        predicted = _unsmear.record_look(every, picture, pad)
        error = ((predicted - self.planes) ** 2).mean(axis=0, dtype=np.float64)
        error = np.minimum(np.nan_to_num(error, nan=GREATEST_ERROR**2), 400.0)
        scale = 2 * noise**2 + 1
        weights = scale / (scale + smoothed(error, SMOOTHING))
        every["weights"] = np.ascontiguousarray(
            every["weights"] * weights, dtype=np.float32
        )
        return every


def restore_jointly(
    own: Look,
    neighbours: list[Neighbour],
    picture: Planes,
    pad: int,
    *,
    strength: float,
    noise: float,
    method: str,
    sharp: bool,
    rounds: int = 1,
) -> tuple[Planes, int, float]:
    """Return the padded restoration, its padding, and the neighbours' mean weight.

    ``picture`` (C, H + 2 pad, W + 2 pad) is the restoration of the frame alone.
    """
    weight = 0.0
    for _ in range(rounds):
        for neighbour in neighbours:
            neighbour.register(picture, pad, method)
        looks = [own, *(n.trusted(picture, pad, noise) for n in neighbours)]
        weight = float(np.mean([look["weights"].mean() for look in looks[1:]]))
        needed = max(pad, _unsmear.looks_reach(looks))
        picture = np.pad(picture, ((0, 0), *2 * ((needed - pad,) * 2,)), mode="edge")
        pad = needed
        way = STRENGTH * strength * (SHARP_STRENGTH if sharp else 1.0)
        pictures, _ = walk(
            looks,
            (way,),
            noise,
            pad=pad,
            first=EFFORT,
            start=picture,
            sharp=sharp,
        )
        picture = pictures[-1]
    return picture, pad, weight
