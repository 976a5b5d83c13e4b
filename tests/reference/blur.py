"""Slow twin of streamlines, local splines and the forward blur: one pixel at a time.

Everything in float64 and as the formulas stand:

* values between pixels: cubic B-spline through the samples, coefficients from the
  filter sqrt(3) z^|n| cut at |n| <= 11, z = sqrt(3) - 2 (Unser, Aldroubi, Eden 1993,
  doi:10.1109/78.193220); edge pixels continue;
* streamlines: strides of h frames, the flow read once per stride at the point reached
  by half of it with the motion of the stride before; a jump of more than
  max(1, 0.2 |v(p)|) px/frame in a component, or an unknown, is not followed;
* blur: Simpson's rule over the exposure with two intervals per stride.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]

PREFILTER_REACH = 11
POLE = math.sqrt(3.0) - 2.0


def spline_coefficients(image: Real) -> Real:
    """Return cubic B-spline coefficients with two more beyond each edge."""
    n = np.arange(-PREFILTER_REACH, PREFILTER_REACH + 1)
    taps = POLE ** np.abs(n)
    taps /= taps.sum()
    padded = np.pad(image, PREFILTER_REACH + 2, mode="edge")
    for axis in (0, 1):
        padded = np.apply_along_axis(np.convolve, axis, padded, taps, "valid")
    return padded


def b_spline(z: Real) -> Real:
    """Cubic B-spline, centred, support 4."""
    d = np.abs(z)
    near = 2.0 / 3.0 - d**2 + d**3 / 2.0
    return np.where(d < 1.0, near, np.maximum(0.0, 2.0 - d) ** 3 / 6.0)


def sample(coefficients: Real, x: float, y: float) -> float:
    """Value of the spline at a point inside the picture."""
    column, row = math.floor(x), math.floor(y)
    patch = coefficients[row + 1 : row + 5, column + 1 : column + 5]
    offsets = np.arange(-1.0, 3.0)
    down, across = b_spline(offsets - (y - row)), b_spline(offsets - (x - column))
    return float(down @ patch @ across)


def bilinear(flow: Real, x: float, y: float) -> Point:
    """Flow between the pixels of the picture."""
    column, row = math.floor(x), math.floor(y)
    fx, fy = x - column, y - row
    padded = np.pad(flow, ((0, 1), (0, 1), (0, 0)), mode="edge")
    top = padded[row, column] + fx * (padded[row, column + 1] - padded[row, column])
    below = padded[row + 1, column : column + 2]
    bottom = below[0] + fx * (below[1] - below[0])
    u, v = top + fy * (bottom - top)
    return float(u), float(v)


def streamline(flow: Real, row: int, column: int, time: float) -> Iterator[Point]:
    """Yield points half a stride of ``time`` frames apart; the pixel itself is not."""
    height, width = flow.shape[:2]
    x, y = float(column), float(row)
    u, v = (float(c) for c in flow[row, column])
    jump = max(1.0, 0.2 * math.hypot(u, v))

    def inside(a: float, b: float) -> Point:
        return min(max(a, 0.0), width - 1.0), min(max(b, 0.0), height - 1.0)

    while True:
        m, n = bilinear(flow, *inside(x + time / 2 * u, y + time / 2 * v))
        if not (abs(m - u) <= jump and abs(n - v) <= jump):
            m, n = u, v
        yield inside(x + time * (u + 3 * m) / 8, y + time * (v + 3 * n) / 8)
        x, y = inside(x + time * m, y + time * n)
        yield x, y
        u, v = m, n


def blur(image: Real, flow: Real, exposure: float = 1.0) -> Real:
    """Mean of (H, W) along each pixel's streamline; unknown motion is copied."""
    coefficients = spline_coefficients(image)
    result = image.copy()
    for row, column in np.ndindex(image.shape):
        length = exposure * math.hypot(*flow[row, column])
        if not length > 0.0:
            continue
        strides = math.ceil(length / 2.0)
        total = 2.0 * image[row, column]
        for sign in (-1.0, 1.0):
            walk = streamline(flow, row, column, sign * exposure / (2 * strides))
            for k in range(1, 2 * strides + 1):
                weight = 4.0 if k % 2 else (1.0 if k == 2 * strides else 2.0)
                total += weight * sample(coefficients, *next(walk))
        result[row, column] = total / (12 * strides)
    return result
