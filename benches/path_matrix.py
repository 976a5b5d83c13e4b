r"""The blur along curved paths as a sparse matrix, made in the plainest way.

A pixel p of the blurred picture is the mean over :math:`-1/2 < t < 1/2` of the sharp
one at :math:`p - t v + t^2/2\, q`, with :math:`q = (v \cdot \nabla) v - a`, v the
velocity and a its change at a fixed pixel. The mean is taken at midpoints less than a
pixel apart, each sampled by Keys' cubic convolution
(doi:10.1109/TASSP.1981.1163711). Independent of the library's own operator, which
integrates exactly along one axis.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]

SPACING = 0.6  # px between samples of the longest path, at most
ROWS_AT_ONCE = 4096


def keys_weights(fraction: Array) -> Array:
    """Return the cubic convolution's four weights (..., 4), a = -1/2."""
    away = np.abs(fraction[..., None] - np.arange(-1, 3))
    near = (1.5 * away - 2.5) * away**2 + 1
    far = ((-0.5 * away + 2.5) * away - 4) * away + 2
    return np.where(away < 1, near, far)


def path_matrix(
    velocity: Array, acceleration: Array, reach: int
) -> tuple[Any, tuple[int, int]]:
    """Return the operator in CSR form and the shape of what it acts on.

    ``reach`` px on every side of the picture are unknowns, too; paths that leave even
    those are held at their rim.
    """
    height, width = velocity.shape[:2]
    shape = (height + 2 * reach, width + 2 * reach)
    down, across = np.gradient(velocity, axis=(0, 1))
    bend = velocity[..., :1] * across + velocity[..., 1:] * down - acceleration
    v, q = velocity.reshape(-1, 2), bend.reshape(-1, 2)
    y, x = (c.ravel() + float(reach) for c in np.mgrid[:height, :width])
    parts = []
    for first in range(0, len(v), ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        longest = float(np.linalg.norm(v[rows], axis=1).max())
        count = max(1, math.ceil(longest / SPACING))
        t = ((np.arange(count) + 0.5) / count - 0.5)[:, None]
        at_x = x[rows] - t * v[rows, 0] + t * t / 2 * q[rows, 0]
        at_y = y[rows] - t * v[rows, 1] + t * t / 2 * q[rows, 1]
        parts.append(sampled(at_x, at_y, shape))
    return sparse.vstack(parts, format="csr"), shape


def sampled(at_x: Array, at_y: Array, shape: tuple[int, int]) -> Any:
    """Return the rows that take the mean over samples at places (S, N)."""
    count, pixels = at_x.shape
    left, top = np.floor(at_x), np.floor(at_y)
    weights = (
        keys_weights(at_y - top)[..., :, None] * keys_weights(at_x - left)[..., None, :]
    )
    steps = np.arange(-1, 3)
    column = np.clip(left[..., None].astype(np.intp) + steps, 0, shape[1] - 1)
    line = np.clip(top[..., None].astype(np.intp) + steps, 0, shape[0] - 1)
    place = line[..., :, None] * shape[1] + column[..., None, :]
    row = np.broadcast_to(np.arange(pixels)[None, :, None, None], place.shape)
    size = (pixels, shape[0] * shape[1])
    entries = (weights.ravel() / count, (row.ravel(), place.ravel()))
    return sparse.coo_array(entries, shape=size).tocsr()
