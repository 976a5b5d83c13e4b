r"""Affine motions as functions of time.

A motion maps a point of the *scene*, measured in px from the middle of the picture at
time 0, to where the picture shows it at time t,

.. math:: p(t) = A(t)\, q + b(t),

x right, y down, t in frame intervals. Its inverse is exact, so a picture is rendered by
looking up scene points, and the flow from t to t + 1 is
:math:`A(t+1) q + b(t+1) - p` with :math:`q = A(t)^{-1} (p - b(t))`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Motion", "flowing", "rotating", "shaking", "translating", "zooming"]

Motion = Callable[[float], "tuple[NDArray[np.float64], NDArray[np.float64]]"]
"""t -> (A of shape (2, 2), b of shape (2,)), both acting on (x, y)."""


def _constants(argument: str, *values: float) -> None:
    if not all(math.isfinite(value) for value in values):
        msg = f"{argument} must be finite, got {values}"
        raise ValueError(msg)


def translating(
    velocity: tuple[float, float], acceleration: tuple[float, float] = (0.0, 0.0)
) -> Motion:
    """Move by ``velocity`` (u, v) px/frame, changing by ``acceleration`` px/frame^2."""
    _constants("velocity", *velocity)
    _constants("acceleration", *acceleration)
    v, a = np.array(velocity, float), np.array(acceleration, float)
    return lambda t: (np.eye(2), v * t + a * (t * t / 2))


def rotating(degrees: float, center: tuple[float, float] = (0.0, 0.0)) -> Motion:
    """Turn by ``degrees`` per frame about ``center`` (x, y), from right to down."""
    _constants("degrees", degrees)
    _constants("center", *center)
    c = np.array(center, float)

    def motion(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        angle = math.radians(degrees) * t
        cos, sin = math.cos(angle), math.sin(angle)
        turn = np.array([[cos, -sin], [sin, cos]])
        return turn, c - turn @ c

    return motion


def zooming(rate: float, center: tuple[float, float] = (0.0, 0.0)) -> Motion:
    """Grow by ``exp(rate)`` per frame about ``center`` (x, y)."""
    _constants("rate", rate)
    _constants("center", *center)
    c = np.array(center, float)
    return lambda t: (np.eye(2) * math.exp(rate * t), c * (1 - math.exp(rate * t)))


def flowing(
    velocity: tuple[float, float],
    gradient: ArrayLike = ((0.0, 0.0), (0.0, 0.0)),
    *,
    quickening: float = 0.0,
) -> Motion:
    r"""Move along the affine velocity field ``velocity + gradient @ p``.

    At time t the field is :math:`(1 + k t)` times that, k the ``quickening``, so what
    passes a fixed point speeds up by k times the field. The path of a point solves
    :math:`dp/d\tau = v + G p` with :math:`\tau = t + k t^2 / 2`: the matrix exponential
    of :math:`\tau (G, v; 0, 0)`, by its series.

    Parameters
    ----------
    velocity : (float, float)
        (u, v) in the middle at time 0, px/frame.
    gradient : array_like of shape (2, 2)
        ((du/dx, du/dy), (dv/dx, dv/dy)), 1/frame.
    quickening : float, default 0
        Share of the speed gained per frame.
    """
    G = np.asarray(gradient, dtype=np.float64)
    if G.shape != (2, 2):
        msg = f"gradient must have shape (2, 2), got {G.shape}"
        raise ValueError(msg)
    _constants("velocity, gradient, quickening", *velocity, *G.ravel(), quickening)
    field = np.zeros((3, 3))
    field[:2, :2], field[:2, 2] = G, velocity

    def motion(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        step = field * (t + quickening * t * t / 2)
        total, term, n = np.eye(3), np.eye(3), 0
        # Terms shrink at last as |G|^n / n!.
        while np.abs(term).max() > np.finfo(float).eps * np.abs(total).max():
            n += 1
            term = term @ step / n
            total = total + term
        return total[:2, :2], total[:2, 2]

    return motion


def shaking(
    amplitude: float, *, size: float = 200.0, period: float = 4.0, seed: int = 0
) -> Motion:
    """Shake as a hand does: smooth random translation, rotation and zoom.

    Each is a sum of three sines of about ``period`` frames; the translation has a
    standard deviation of ``amplitude`` px, rotation and zoom a quarter of that at
    ``size`` / 2 px from the middle.
    """
    _constants("amplitude, size, period", amplitude, size, period)
    if period <= 0 or size <= 0:
        msg = f"period and size must be > 0, got {period} and {size}"
        raise ValueError(msg)
    rng = np.random.default_rng(seed)
    rates = 2 * np.pi / period * rng.uniform(0.6, 1.4, (4, 3))
    phases = rng.uniform(0, 2 * np.pi, (4, 3))
    weights = rng.normal(size=(4, 3))
    weights *= math.sqrt(2) / np.linalg.norm(weights, axis=1, keepdims=True)
    turn = amplitude / 4 / (size / 2)
    scale = np.array([amplitude, amplitude, turn, turn])[:, None]

    def motion(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        x, y, angle, growth = (scale * weights * np.sin(rates * t + phases)).sum(1)
        cos, sin = math.cos(angle), math.sin(angle)
        matrix = math.exp(growth) * np.array([[cos, -sin], [sin, cos]])
        return matrix, np.array([x, y])

    return motion
