r"""Hills: a height field a ray can meet.

The ground lies at :math:`y = -h(x, z)`, h a periodic uniform cubic B-spline. No slope
exceeds the largest difference of neighbouring coefficients, :math:`L`, so from a height
g above the ground a ray :math:`o + \lambda d` may safely advance by
:math:`g / (d_y + L |d_{xz}|)`; it does so until it is as good as there (J. C. Hart,
"Sphere tracing", The Visual Computer 12, 1996, doi:10.1007/s003710050084), and Newton
steps end it. A ray that climbs faster than the slopes, or has passed the highest
summit upwards, never lands.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear._arrays import as_floating
from unsmear.synthetic.solids import positive
from unsmear.synthetic.surface import cubic_weights

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Terrain"]

_STEPS = 100  # a ray that skims the ground for longer is taken to miss
_TILES = 4  # tiles of the roof per spacing
_CLOSE = 1e-3  # of the spacing: from here Newton's steps converge
_CLOSER_THAN_SEEN = 3e-4  # of the distance: some tenth of what a pixel covers
_NEWTON_STEPS = 3
_NEAR = 30  # times the gap that counts as landed: no step along the ray is longer


class Terrain:
    """Hills without end.

    Parameters
    ----------
    heights : array_like of shape (H, W)
        Spline coefficients of the height, one period along z (rows) and x (columns);
        the units of the scene.
    spacing : float
        Distance of coefficients, > 0.

    Raises
    ------
    ValueError
        Heights of another shape or not finite, or a spacing <= 0.
    """

    radius = math.inf

    def __init__(self, heights: ArrayLike, spacing: float) -> None:
        positive("spacing", spacing)
        self._heights = as_floating(heights, "heights", np.float64)
        if self._heights.ndim != 2 or not np.isfinite(self._heights).all():
            msg = (
                "heights must be finite, of shape (H, W), "
                f"got shape {self._heights.shape}"
            )
            raise ValueError(msg)
        self._spacing = spacing
        rises = (self._heights - np.roll(self._heights, 1, axis=n) for n in (0, 1))
        self._slope = float(np.hypot(*(np.abs(r).max() for r in rises))) / spacing
        # A roof of flat tiles, nowhere below the ground: quick to look up.
        rows, columns = (n * _TILES for n in self._heights.shape)
        z, x = np.mgrid[:rows, :columns] * (spacing / _TILES)
        self._eaves = self._slope * spacing / _TILES / math.sqrt(2)
        ground = self.height(x.ravel(), z.ravel()).reshape(rows, columns)
        self._roof = ground + self._eaves
        self._summit = float(self._roof.max())

    def height(
        self, x: NDArray[np.float64], z: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the height at (N,) places."""
        across, down, patch = self._patch(x, z)
        weights = np.stack(cubic_weights(down), axis=1)
        lines = np.einsum("nji,nj->ni", patch, weights)
        return np.asarray((lines * np.stack(cubic_weights(across), axis=1)).sum(axis=1))

    def slopes(
        self, x: NDArray[np.float64], z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the slopes along x and z at (N,) places."""
        across, down, patch = self._patch(x, z)
        flat = [np.stack(cubic_weights(f), axis=1) for f in (across, down)]
        steep = [np.stack(slope_weights(f), axis=1) for f in (across, down)]
        along_x = np.einsum("nji,nj,ni->n", patch, flat[1], steep[0])
        along_z = np.einsum("nji,nj,ni->n", patch, steep[1], flat[0])
        return along_x / self._spacing, along_z / self._spacing

    def _patch(
        self, x: NDArray[np.float64], z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return fractions (N,) along x and z, and 4 x 4 coefficients (N, 4, 4)."""
        x, z = x / self._spacing, z / self._spacing
        column, row = np.floor(x), np.floor(z)
        rows, columns = self._heights.shape
        at = np.arange(-1, 3)
        row_at = (row.astype(np.intp)[:, None] + at) % rows
        column_at = (column.astype(np.intp)[:, None] + at) % columns
        place = row_at[:, :, None] * columns + column_at[:, None, :]
        return x - column, z - row, self._heights.ravel()[place]

    def meet(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where rays land on the hills."""
        distance = np.full(len(origin), np.inf)
        rate = direction[:, 1] + self._slope * np.hypot(
            direction[:, 0], direction[:, 2]
        )
        # Down to the highest summit there is only air.
        fall = np.maximum(-self._summit - origin[:, 1], 0)
        can_land = (rate > 0) & ((fall == 0) | (direction[:, 1] > 0))
        way = np.flatnonzero(can_land)
        here = np.zeros(len(way))
        high = fall[way] > 0
        here[high] = fall[way][high] / direction[way, 1][high]
        for ground, close in (
            (self._roof_at, self._eaves),
            (self.height, _CLOSE * self._spacing),
        ):
            o, d, speed = origin[way], direction[way], rate[way]
            length = np.linalg.norm(d, axis=1)
            landed = np.full(len(way), np.inf)
            left = np.arange(len(way))
            for _ in range(_STEPS):
                at = o[left] + here[left, None] * d[left]
                gap = -at[:, 1] - ground(at[:, 0], at[:, 2])
                down = gap <= close + _CLOSER_THAN_SEEN * here[left] * length[left]
                landed[left[down]] = here[left[down]]
                gone = (at[:, 1] < -self._summit) & (d[left, 1] <= 0)
                on = ~down & ~gone
                left = left[on]
                if not left.size:
                    break
                here[left] += gap[on] / speed[left]
            way, here = way[np.isfinite(landed)], landed[np.isfinite(landed)]
        distance[way] = here
        return self._ended(origin, direction, distance)

    def _roof_at(
        self, x: NDArray[np.float64], z: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        scale, (rows, columns) = _TILES / self._spacing, self._roof.shape
        row = np.rint(z * scale).astype(np.intp) % rows
        column = np.rint(x * scale).astype(np.intp) % columns
        return np.asarray(self._roof[row, column])

    def _ended(
        self,
        origin: NDArray[np.float64],
        direction: NDArray[np.float64],
        distance: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Take Newton steps from close above the ground."""
        met = np.flatnonzero(np.isfinite(distance))
        o, d, here = origin[met], direction[met], distance[met]
        length = np.linalg.norm(d, axis=1)
        close = _CLOSE * self._spacing + _CLOSER_THAN_SEEN * here * length
        at = o + here[:, None] * d
        gap = -at[:, 1] - self.height(at[:, 0], at[:, 2])
        for _ in range(_NEWTON_STEPS):
            slope_x, slope_z = self.slopes(at[:, 0], at[:, 2])
            closing = d[:, 1] + slope_x * d[:, 0] + slope_z * d[:, 2]
            # At a glancing ray the tangent is no guide: it stays where it is.
            step = gap / np.where(closing > 0, closing, np.inf)
            there = at + step[:, None] * d
            left = -there[:, 1] - self.height(there[:, 0], there[:, 2])
            better = np.abs(left) < np.abs(gap)
            better &= np.abs(step) * length < _NEAR * close
            here = here + np.where(better, step, 0.0)
            at = np.where(better[:, None], there, at)
            gap = np.where(better, left, gap)
        distance[met] = here
        return distance

    def chart(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (x, z) and the upward normal."""
        slope_x, slope_z = self.slopes(points[:, 0], points[:, 2])
        normal = np.stack([-slope_x, -np.ones(len(points)), -slope_z], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return points[:, [0, 2]], normal


def slope_weights(fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the derivatives of `cubic_weights`."""
    f, g = fraction, 1 - fraction
    return (-g * g / 2, f * (1.5 * f - 2), g * (2 - 1.5 * g), f * f / 2)
