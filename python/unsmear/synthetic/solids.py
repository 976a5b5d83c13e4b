r"""Shapes a ray can meet: rectangle, disc, box, sphere.

A ray is :math:`o + \lambda d` with d of any length, in the axes of the body (x right, y
down, z ahead when it is not turned). Each shape answers two questions: the least
:math:`\lambda > 0` at which a ray meets it (infinite: never), and for points on it, the
place on the surface in the units of the scene, with the outward normal. ``radius`` is
that of a ball about the body's origin which holds the shape.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Box", "Disc", "Rectangle", "Solid", "Sphere"]

_GOLDEN_RATIO = (1 + math.sqrt(5)) / 2


class Solid(Protocol):
    """What the ray caster asks of a shape."""

    radius: float

    def meet(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the least lambda > 0 of rays (N, 3), infinite where there is none."""

    def chart(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return places (N, 2) and unit normals (N, 3) of points (N, 3) on it."""


def positive(argument: str, *values: float) -> None:
    """Refuse sizes that are not > 0."""
    if not all(value > 0 for value in values):
        msg = f"{argument} must be > 0, got {', '.join(map(str, values))}"
        raise ValueError(msg)


class Rectangle:
    """A flat plate across z, seen from both sides; of infinite extent by default.

    Parameters
    ----------
    width, height : float, default infinite
        Along x and y; > 0.
    """

    def __init__(self, width: float = math.inf, height: float = math.inf) -> None:
        positive("width and height", width, height)
        self._half = np.array([width, height]) / 2
        self.radius = math.hypot(width, height) / 2

    def meet(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where rays cross the plate."""
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -origin[:, 2] / direction[:, 2]
            place = origin[:, :2] + distance[:, None] * direction[:, :2]
            met = (distance > 0) & np.isfinite(distance) & self._holds(place)
        return np.where(met, distance, np.inf)

    def _holds(self, place: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray((np.abs(place) <= self._half).all(axis=1))

    def chart(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (x, y) from the upper left corner (the middle if infinite), and -z."""
        corner = np.where(np.isfinite(self._half), self._half, 0.0)
        normal = np.broadcast_to([0.0, 0.0, -1.0], points.shape)
        return points[:, :2] + corner, np.asarray(normal)


class Disc(Rectangle):
    """A flat round plate across z, seen from both sides.

    Parameters
    ----------
    radius : float
        > 0.
    """

    def __init__(self, radius: float) -> None:
        super().__init__(2 * radius, 2 * radius)
        self.radius = radius

    def _holds(self, place: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray((place**2).sum(axis=1) <= self.radius**2)


class Box:
    """A box about its middle, seen from outside, or from inside by a camera in it.

    Parameters
    ----------
    width, height, depth : float
        Along x, y and z; > 0. Each side shows another part of the surface's pattern.
    """

    def __init__(self, width: float, height: float, depth: float) -> None:
        positive("width, height and depth", width, height, depth)
        self._half = np.array([width, height, depth]) / 2
        self.radius = float(np.linalg.norm(self._half))

    def meet(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where rays enter the box, or leave it if they start inside."""
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (-self._half - origin) / direction
            two = (self._half - origin) / direction
        # A ray within the plane of a side (0 / 0) is held to be between the sides.
        inside = np.isnan(one) | np.isnan(two)
        enter = np.where(inside, -np.inf, np.minimum(one, two)).max(axis=1)
        leave = np.where(inside, np.inf, np.maximum(one, two)).min(axis=1)
        first = np.where(enter > 0, enter, leave)
        return np.where((enter <= leave) & (leave > 0), first, np.inf)

    def chart(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the place on its side, and that side's normal."""
        rows = np.arange(len(points))
        side = np.argmin(np.abs(np.abs(points) - self._half), axis=1)
        sign = np.sign(points[rows, side])
        normal = np.zeros_like(points)
        normal[rows, side] = sign
        # Upright walls keep y downwards; top and bottom are laid out as (x, z).
        across = np.array([2, 0, 0])[side]
        down = np.array([1, 2, 1])[side]
        corner = points + self._half
        place = np.stack([corner[rows, across], corner[rows, down]], axis=1)
        # An irrational step, so that no two sides show the same part.
        extent = 2 * float(self._half.max())
        place[:, 0] += _GOLDEN_RATIO * extent * (side + 3 * (sign > 0))
        return place, normal


class Sphere:
    """A ball about its middle, with the pattern on longitude and latitude.

    Parameters
    ----------
    radius : float
        > 0. Places are arc lengths on the equator; the poles lie on y.
    """

    def __init__(self, radius: float) -> None:
        positive("radius", radius)
        self.radius = radius

    def meet(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where rays enter the ball, or leave it if they start inside."""
        a = (direction**2).sum(axis=1)
        b = (origin * direction).sum(axis=1)
        c = (origin**2).sum(axis=1) - self.radius**2
        inside = b * b - a * c
        root = np.sqrt(np.maximum(inside, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = (-b - root) / a, (-b + root) / a
        first = np.where(near > 0, near, far)
        return np.where((inside >= 0) & (first > 0), first, np.inf)

    def chart(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (longitude, latitude) times the radius, and the outward normal."""
        normal = points / self.radius
        longitude = np.arctan2(normal[:, 0], -normal[:, 2])
        latitude = np.arcsin(np.clip(normal[:, 1], -1, 1))
        return self.radius * np.stack([longitude, latitude], axis=1), normal
