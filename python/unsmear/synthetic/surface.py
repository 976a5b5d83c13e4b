r"""Patterns on surfaces, without aliasing.

A pattern is a periodic uniform cubic B-spline whose coefficients are the pixels of a
picture, so it is one smooth function of the place on the surface: what moves with the
surface keeps its brightness. Where a screen pixel covers more than a coefficient, the
spline of a coarser picture is taken: each halves the one before by means of 2 x 2
pixels (a pyramid, L. Williams, "Pyramidal parametrics", SIGGRAPH 1983,
doi:10.1145/800059.801126), with linear interpolation between two of them. The larger
extent of a pixel's footprint chooses, so a floor seen at a low angle loses detail
before it aliases.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear._arrays import as_floating

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Surface"]


class Surface:
    """A picture that repeats over a surface.

    Parameters
    ----------
    picture : array_like of shape (H, W)
        Grey; integers are scaled by their range. Both sides powers of 2.
    size : float
        Width of one copy in the units of the scene; > 0.

    Raises
    ------
    ValueError
        A picture of another shape or with values that are not finite, or a size <= 0.
    """

    def __init__(self, picture: ArrayLike, size: float) -> None:
        level = as_floating(picture, "picture", np.float64)
        sides = level.shape
        if len(sides) != 2 or any(n < 1 or n & (n - 1) for n in sides):
            msg = f"picture must have shape (H, W) of powers of 2, got {sides}"
            raise ValueError(msg)
        if not np.isfinite(level).all():
            msg = "picture must be finite, got NaN or infinite pixels"
            raise ValueError(msg)
        if not 0 < size < np.inf:
            msg = f"size must be > 0, got {size}"
            raise ValueError(msg)
        self.grain = size / sides[1]  # extent of a coefficient
        levels = [level]
        while level.size > 1:
            rows, columns = (min(2, n) for n in level.shape)
            h, w = level.shape[0] // rows, level.shape[1] // columns
            level = level.reshape(h, rows, w, columns).mean(axis=(1, 3))
            levels.append(level)
        self._heights = np.array([n.shape[0] for n in levels])
        self._widths = np.array([n.shape[1] for n in levels])
        self._starts = np.concatenate([[0], np.cumsum([n.size for n in levels])[:-1]])
        self._coefficients = np.concatenate([n.ravel() for n in levels])

    def at(
        self, place: NDArray[np.float64], footprint: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the pattern.

        Parameters
        ----------
        place : ndarray of shape (N, 2)
            Where on the surface.
        footprint : ndarray of shape (N,)
            Extent of what one value stands for, >= 0.

        Returns
        -------
        ndarray of shape (N,)
        """
        last = len(self._starts) - 1
        level = np.log2(np.maximum(footprint / self.grain, 1.0))
        level = np.minimum(level, last)
        fine = np.minimum(level.astype(np.intp), max(last - 1, 0))
        share = level - fine
        value = self._spline(place, fine)
        mixed = np.flatnonzero(share > 0)
        if mixed.size:
            coarse = self._spline(place[mixed], fine[mixed] + 1)
            value[mixed] += share[mixed] * (coarse - value[mixed])
        return value

    def _spline(
        self, place: NDArray[np.float64], level: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        scale = 1 / (self.grain * np.exp2(level))
        # Pixels are the means of squares, so their centres lie at halves.
        x, y = place[:, 0] * scale - 0.5, place[:, 1] * scale - 0.5
        column, row = np.floor(x), np.floor(y)
        along_x, along_y = cubic_weights(x - column), cubic_weights(y - row)
        # Sides are powers of 2, where the remainder is a mask.
        columns = [
            (column.astype(np.intp) + i) & (self._widths[level] - 1)
            for i in range(-1, 3)
        ]
        value = np.zeros(len(place))
        for j, weight in enumerate(along_y):
            line = (row.astype(np.intp) + j - 1) & (self._heights[level] - 1)
            start = self._starts[level] + line * self._widths[level]
            across = np.zeros(len(place))
            for i, other in enumerate(along_x):
                across += other * self._coefficients[start + columns[i]]
            value += weight * across
        return value


def cubic_weights(fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the uniform cubic B-spline's weights of the coefficients -1, 0, 1, 2."""
    f, g = fraction, 1 - fraction
    return (
        g**3 / 6,
        2 / 3 - f * f * (2 - f) / 2,
        2 / 3 - g * g * (2 - g) / 2,
        f**3 / 6,
    )
