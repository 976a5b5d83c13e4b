"""Slow twin of the motion operator: a dense matrix, one pixel at a time, in float64.

Each pixel reads, on every grid line of the axis on which it moves faster, what its
parabola p + d - t V + t^2/2 q passes there, interpolated by Keys' cubic (slope -1/2) or
the triangle, for as long as the kernel on that line overlaps the path. Row sums are 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

# Bounds of the definition, px.
LEAST_MOTION = 0.02
SHORT = 1.0
STRAIGHT = 0.1
MOST_BEND = 1.8


def kernel(z: Real, cubic: bool) -> Real:
    """Interpolation kernel."""
    y = np.abs(z)
    if not cubic:
        return np.maximum(0.0, 1.0 - y)
    near = 1.5 * y**3 - 2.5 * y**2 + 1.0
    far = -0.5 * y**3 + 2.5 * y**2 - 4.0 * y + 2.0
    return np.where(y < 1.0, near, np.where(y < 2.0, far, 0.0))


def integral(z: float, cubic: bool) -> float:
    """Integral of the kernel from minus infinity, by Gauss's rule piece by piece."""
    knots = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    nodes, weights = np.polynomial.legendre.leggauss(2)
    total = 0.0
    for low, high in zip(knots[:-1], np.minimum(knots[1:], z), strict=True):
        if high > low:
            at = low + (high - low) * (nodes + 1.0) / 2.0
            total += (high - low) / 2.0 * float(weights @ kernel(at, cubic))
    return total


def row(
    velocity: Real, curvature: Real, offset: Real, cubic: bool
) -> dict[tuple[int, int], float]:
    """Weights of one pixel by (rows down, columns right) from it."""
    down = bool(abs(velocity[1]) > abs(velocity[0]))
    order = slice(None, None, -1) if down else slice(None)
    (a, b), (qa, qb), (da, db) = (
        (float(z) for z in vector[order]) for vector in (velocity, curvature, offset)
    )
    if math.isnan(a + b) or (abs(a) < LEAST_MOTION and da == db == 0.0):
        return {(0, 0): 1.0}
    if abs(a) < LEAST_MOTION:
        a, b = LEAST_MOTION, 0.0
    if abs(a) <= SHORT or max(abs(qa), abs(qb)) <= STRAIGHT:
        qa = qb = 0.0
    share = min(1.0, MOST_BEND * abs(a) / abs(qa)) if qa else 1.0
    qa, qb = share * qa, share * qb
    z0, z1 = sorted((-a / 2.0 + qa / 8.0, a / 2.0 + qa / 8.0))
    weights: dict[tuple[int, int], float] = {}
    for k in range(math.floor(da + z0) - 2, math.ceil(da + z1) + 3):
        z = k - da
        e = min(max(z, z0), z1)
        speed = math.sqrt(a * a + 2.0 * qa * e)
        t = -2.0 * e / (a + math.copysign(speed, a))
        weight = (integral(z - z0, cubic) - integral(z - z1, cubic)) / speed
        beyond = min(max(z - e, -2.0), 2.0)
        minor = db - t * b + t * t / 2.0 * qb + beyond * b / a
        for j in range(math.floor(minor) - 1, math.floor(minor) + 3):
            tap = weight * float(kernel(np.array(j - minor), cubic))
            place = (k, j) if down else (j, k)
            weights[place] = weights.get(place, 0.0) + tap
    total = sum(weights.values())
    return {place: weight / total for place, weight in weights.items()}


def matrix(
    velocity: Real, curvature: Real, offset: Real, pad: int, *, cubic: bool
) -> Real:
    """Return the operator of paths (H, W, 2) as a matrix of (data, unknowns)."""
    height, width = velocity.shape[:2]
    rows, columns = height + 2 * pad, width + 2 * pad
    result = np.zeros((height * width, rows * columns))
    for y, x in np.ndindex(height, width):
        weights = row(velocity[y, x], curvature[y, x], offset[y, x], cubic)
        for (below, right), weight in weights.items():
            at_row = min(max(y + pad + below, 0), rows - 1)
            at_column = min(max(x + pad + right, 0), columns - 1)
            result[y * width + x, at_row * columns + at_column] += weight
    return result
