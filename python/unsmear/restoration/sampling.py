"""Pictures and fields between pixels, NaN beyond their edges."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["carried", "composed", "inside", "pulled", "pulled_field", "smoothed"]


def _positions(
    field: NDArray[np.float32],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height, width = field.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float64)
    return y + field[..., 1], x + field[..., 0]


def inside(field: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where ``field`` (H, W, 2) leads to a place in the picture."""
    height, width = field.shape[:2]
    y, x = _positions(field)
    return np.asarray((y >= 0) & (y <= height - 1) & (x >= 0) & (x <= width - 1))


def pulled(
    picture: NDArray[np.float32], field: NDArray[np.float32], degree: int = 3
) -> NDArray[np.float32]:
    """Return ``picture[p + field(p)]`` by a spline; NaN outside and where unknown."""
    y, x = _positions(field)
    known = inside(field)
    safe = np.asarray(picture, np.float64)
    if degree > 1:
        safe = np.nan_to_num(safe)
    values = _unsmear.sample(
        np.ascontiguousarray(safe),
        np.where(known, y, 0.0),
        np.where(known, x, 0.0),
        degree,
        "replicate",
    )
    return np.where(known, values, np.nan).astype(np.float32)


def pulled_field(
    values: NDArray[np.float32], field: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return a field (H, W, 2) read off where ``field`` leads, linearly."""
    parts = [pulled(values[..., part], field, degree=1) for part in range(2)]
    return np.stack(parts, axis=-1)


def composed(
    first: NDArray[np.float32], second: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the displacement of going by ``first``, then by ``second``."""
    return np.asarray(first + pulled_field(second, first), np.float32)


def carried(
    offset: NDArray[np.float32], velocity: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return ``velocity`` as seen after moving by ``offset``, which bends it.

    V' = V + (V . grad) d, by the difference of d over the path.
    """
    ahead, behind = (pulled_field(offset, s * velocity) for s in (0.5, -0.5))
    change = np.nan_to_num(ahead - behind)
    # More than this is the boundary of another motion.
    limit = np.maximum(1.0, 0.4 * np.linalg.norm(velocity, axis=-1, keepdims=True))
    small = np.linalg.norm(change, axis=-1, keepdims=True) < limit
    return np.asarray(velocity + np.where(small, change, 0.0), np.float32)


def smoothed(plane: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return a plane (H, W) smoothed by a Gaussian of ``sigma`` px."""
    radius = math.ceil(3 * sigma)
    bell = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    along = list(bell / bell.sum())
    volume = np.ascontiguousarray(plane, np.float64)[np.newaxis]
    taps = [[1.0], along, along]
    return np.asarray(_unsmear.correlate_separable(volume, taps, "replicate")[0])
