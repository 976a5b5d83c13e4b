r"""What stands still in a clip, though flow says that it moves.

Around a thing that moves before a ground at rest, smooth flow carries its motion on to
the ground, some 30 px where the thing is blurred; restored along it the ground rings.
The frames themselves know better. With n the frames next to frame i and f_n the flow to
them, a place is still where

.. math:: r_n = G * (I_n(p) - I_i(p))^2, \quad
          m_n = G * (I_n(p + f_n(p)) - I_i(p))^2, \qquad
          r_n + c < 0.15 \, \max_k m_k, \quad r_n < 1.5 \, m_n + c

for one n, G a Gaussian of 2 px, c 4e-4 of the variance of I_i (the square of one grey
level in ordinary photographs): rest explains that frame as well as flow does, and far
better than flow explains the other, in which the thing may hide the place. Without
texture all are noise and the motion stays: blur along it changes nothing there. Where
things do move rest explains less than flow, and where they turn round, at rest for a
moment, flow explains both frames.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear.restoration.sampling import pulled, smoothed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Plane = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["still"]

SMOOTHING = 2.0
BETTER = 0.15
AS_WELL = 1.5
LEAST_POWER = 4e-4
"""Of the picture's variance: what rest is charged with, lest white be called still."""
LEAST_MOTION = 0.3
"""px, below which there is nothing to decide."""
MARGIN = 6
"""Pixels around unknown ones, which the spline rings from, that are not compared."""


def still(own: Plane, others: list[tuple[Plane, Field]]) -> NDArray[np.bool_]:
    """Return where rest explains a frame's neighbours far better than their flow.

    Parameters
    ----------
    own : ndarray of shape (H, W), float32
        Luma of the frame; NaN = unknown.
    others : list of (ndarray like ``own``, ndarray of shape (H, W, 2))
        Each neighbour with the flow to it, px; NaN = unknown, and never still.
    """
    seen = own[np.isfinite(own)].astype(np.float64)
    least = LEAST_POWER * float(seen.var()) if seen.size else 0.0
    worst = np.zeros(own.shape)
    moves = np.zeros(own.shape, bool)
    at_rest = []
    for other, way in others:
        holes = _unsmear.dilated(~(np.isfinite(own) & np.isfinite(other)), MARGIN)
        # Compared where both can be: a place that leaves the picture says nothing.
        known = ~holes & (pulled(holes.astype(np.float32), way, degree=1) == 0)
        rest, flow = (
            smoothed(
                np.where(known, (there - own.astype(np.float64)) ** 2, 0), SMOOTHING
            )
            for there in (other, pulled(other, way))
        )
        worst = np.where(known, np.maximum(worst, flow), worst)
        moves |= known & (np.linalg.norm(way, axis=-1) > LEAST_MOTION)
        at_rest.append(np.where(known & (rest < AS_WELL * flow + least), rest, np.inf))
    best = np.min(at_rest, axis=0)
    return np.asarray(moves & (best + least < BETTER * worst))
