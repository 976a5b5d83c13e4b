"""Point spread functions of straight, uniform motion.

**Exact line** ``motion_psf``. During the exposure a point travels the segment
x(s) = s (u, v), s in [-1/2, 1/2] (px; x right, y down). Every instant is spread over
the four pixels around it by the bilinear tent L(z) = max(0, 1 - |z|):

    w[y, x] = integral_{-1/2}^{1/2} L(x - s u) L(y - s v) ds.

Between two crossings of a grid line the integrand is a polynomial of degree 2 in s,
which the two-point Gauss-Legendre rule integrates without error: the result is exact to
rounding. sum w = 1 and sum (x, y) w = 0 because the tents add up to 1 and reproduce
linear functions. Second moments are those of the segment, u^2/12 and v^2/12, widened by
the tents' mean variance (integral of z (1 - z) over the fractional parts). Array:
(2 ceil(|v|/2) + 1) x (2 ceil(|u|/2) + 1), the smallest odd centred one.

**MATLAB's line** ``fspecial_motion`` (the rule of its ``fspecial('motion', L, a)``, as
documented there: a line of L pixels at a degrees, counter-clockwise). The half line
of extent e = (L - 1)/2 is drawn in one quadrant at cos a -> |cos a| and mirrored
through the centre; a pixel at distance d of the line weighs max(0, 1 - d), where d is
measured to the line's end for pixels at radius >= e whose distance to the line is
at most 1. Divided by the sum. Two consequences worth knowing: L = 1 gives a delta,
and the angle is modulo 180 degrees.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

EPS = float(np.finfo(np.float64).eps)

# Two-point Gauss-Legendre nodes on [-1, 1]; both weights are 1.
GAUSS_NODE = 1.0 / math.sqrt(3.0)


def tent(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bilinear weight L(z) = max(0, 1 - |z|)."""
    return np.maximum(0.0, 1.0 - np.abs(z))


def grid_crossings(extent: float) -> list[float]:
    """Return the s in (-1/2, 1/2) at which s * extent is an integer."""
    reach = math.ceil(abs(extent) / 2.0)
    if extent == 0.0:
        return []
    crossings = (k / extent for k in range(-reach, reach + 1))
    return [s for s in crossings if -0.5 < s < 0.5]


def motion_psf(u: float, v: float) -> NDArray[np.float64]:
    """Return the exact sub-pixel PSF of the motion (u, v).

    Parameters
    ----------
    u, v : float
        Displacement during the exposure, px, x right and y down. Finite.

    Returns
    -------
    ndarray of shape (2 ceil(|v|/2) + 1, 2 ceil(|u|/2) + 1)
        Non-negative, sum 1, symmetric about its centre; (1, 1) for no motion.
    """
    if not (math.isfinite(u) and math.isfinite(v)):
        raise ValueError(f"u, v: expected finite numbers, got ({u}, {v})")
    half_x, half_y = math.ceil(abs(u) / 2.0), math.ceil(abs(v) / 2.0)
    x = np.arange(-half_x, half_x + 1, dtype=np.float64)
    y = np.arange(-half_y, half_y + 1, dtype=np.float64)
    psf = np.zeros((y.size, x.size))
    knots = sorted({-0.5, *grid_crossings(u), *grid_crossings(v), 0.5})
    for start, stop in pairwise(knots):
        middle, half = (start + stop) / 2.0, (stop - start) / 2.0
        for node in (-GAUSS_NODE, GAUSS_NODE):
            s = middle + half * node
            psf += half * np.outer(tent(y - s * v), tent(x - s * u))
    return psf


def fspecial_motion(length: float, angle: float) -> NDArray[np.float64]:
    """Return MATLAB's motion kernel.

    Parameters
    ----------
    length : float
        Pixels; below 1 counts as 1.
    angle : float
        Degrees, counter-clockwise with y up.

    Returns
    -------
    ndarray of odd shape
        Non-negative, sum 1 (to rounding), symmetric about its centre.
    """
    length = max(1.0, float(length))
    end = (length - 1.0) / 2.0
    phi = (angle % 180.0) / 180.0 * math.pi
    cosine, sine = math.cos(phi), math.sin(phi)
    lean = abs(cosine)
    # The tiny term keeps an end that lies exactly on a pixel from growing the array;
    # the original subtracts it from a signed quantity, hence the sign.
    columns = math.trunc(end * lean + 1.0 - math.copysign(length * EPS, cosine))
    rows = math.trunc(end * sine + 1.0 - length * EPS)
    x = np.arange(columns + 1, dtype=np.float64)[None, :]
    y = np.arange(rows + 1, dtype=np.float64)[:, None]

    across = y * lean - x * sine
    beyond = (np.hypot(x, y) >= end) & (np.abs(across) <= 1.0)
    # Way that is left along the line from the pixel's foot to the line's end.
    overshoot = end - np.abs((x + across * sine) / lean)
    distance = np.where(beyond, np.hypot(across, overshoot), np.abs(across))
    quadrant = np.maximum(0.0, 1.0 + EPS - distance)

    psf = np.zeros((2 * rows + 1, 2 * columns + 1))
    psf[: rows + 1, : columns + 1] = quadrant[::-1, ::-1]
    psf[rows:, columns:] = quadrant
    psf /= psf.sum() + EPS * length * length
    # The quadrant was drawn downwards to the right; an angle below 90 degrees rises.
    return psf[::-1] if cosine > 0.0 else psf
