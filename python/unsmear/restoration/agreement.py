r"""Restored frames made to agree with those next to them, so that nothing flickers.

What a restoration makes up, where its data say nothing, differs from frame to frame,
and so does the noise that deblurring has raised. The mean along the motion of a frame
x_i and its neighbours x_n has less of either,

.. math:: \bar x_i(p) = \frac{x_i(p) + \sum_n w_n(p) \, x_n(p + d_n(p))}
          {1 + \sum_n w_n(p)}, \qquad
          w_n = s_n \left(\frac{c^2}{c^2 + G * (x_n(p + d_n) - x_i)^2}\right)^2,

d_n the displacement to the neighbour (`registration`), s_n in [0, 1] whether that shows
the place, restored; c^2 = 32 sigma^2 + 64, G a Gaussian of 2 px. Values between pixels
are those of cubic splines. Units: grey levels, px.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear.restoration.sampling import pulled, smoothed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Plane = NDArray[np.float32]
    Planes = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["agreed"]

SMOOTHING = 2.0


def agreed(
    own: Planes, neighbours: list[tuple[Planes, Field, Plane]], noise: float
) -> Planes:
    """Return the mean of a frame and what its neighbours show of it.

    Parameters
    ----------
    own : ndarray of shape (C, H, W), float32
        The frame, grey levels.
    neighbours : list of (ndarray like ``own``, (H, W, 2), (H, W))
        Each with the displacement to it, px, NaN = unknown, and how far it is to be
        believed at each pixel of ``own``, in [0, 1].
    noise : float
        Standard deviation of the noise of the frames as they came, grey levels.
    """
    scale = 32 * noise**2 + 64
    total = own.astype(np.float64)
    weights = np.ones(own.shape[1:])
    for planes, way, believed in neighbours:
        moved = np.stack([pulled(plane, way) for plane in planes]).astype(np.float64)
        known = np.isfinite(moved).all(axis=0) & np.isfinite(believed)
        error = ((np.where(known, moved, own) - own) ** 2).mean(axis=0)
        alike = scale / (scale + smoothed(error, SMOOTHING))
        weight = np.where(known, believed, 0.0) * alike**2
        total += weight * np.where(known, moved, 0.0)
        weights += weight
    return (total / weights).astype(np.float32)
