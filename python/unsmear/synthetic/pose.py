r"""Where a body is and how it is turned, as functions of time.

A pose maps a point of a body to the world,

.. math:: X(t) = R(t)\, q + p(t),

R a rotation, t in frame intervals. Axes are those of a camera at rest: x right, y down,
z ahead; lengths are in any one unit. A body's point q never changes, so flow is the
difference of where X(t) and X(t + 1) are seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Path", "Pose", "looking", "placed", "turned"]

Pose = Callable[[float], "tuple[NDArray[np.float64], NDArray[np.float64]]"]
"""t -> (R of shape (3, 3), p of shape (3,))."""

Path = Callable[[float], "ArrayLike"]
"""t -> a point (x, y, z)."""

_DOWN = np.array([0.0, 1.0, 0.0])


def vector(value: ArrayLike, argument: str) -> NDArray[np.float64]:
    """Return ``value`` as three finite numbers."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        msg = f"{argument} must be three finite numbers, got {value!r}"
        raise ValueError(msg)
    return array


def turned(axis: ArrayLike, degrees: float) -> NDArray[np.float64]:
    r"""Return the rotation by ``degrees`` about ``axis``, (3, 3).

    Rodrigues' formula, :math:`R = I + \sin\theta\, K + (1 - \cos\theta) K^2` with K the
    cross product with the unit axis. About y (down): from z (ahead) to x (right).

    Parameters
    ----------
    axis : array_like of shape (3,)
        Not 0; its length does not matter.
    degrees : float
        Any finite angle.

    Raises
    ------
    ValueError
        An axis without direction, or an angle that is not finite.
    """
    direction = vector(axis, "axis")
    length = float(np.linalg.norm(direction))
    if length == 0 or not math.isfinite(degrees):
        msg = f"axis must not be 0 and degrees be finite, got {axis!r} and {degrees}"
        raise ValueError(msg)
    x, y, z = direction / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(degrees)
    rotation = np.eye(3) + math.sin(angle) * cross
    return np.asarray(rotation + (1 - math.cos(angle)) * (cross @ cross))


def placed(
    position: ArrayLike = (0.0, 0.0, 0.0),
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
    orientation: ArrayLike | None = None,
    axis: ArrayLike = (0.0, 1.0, 0.0),
    degrees: float = 0.0,
) -> Pose:
    """Return the pose of a body that moves steadily and spins.

    Parameters
    ----------
    position, velocity, acceleration : array_like of shape (3,)
        Of the body's origin at time 0; per frame, and per frame^2.
    orientation : array_like of shape (3, 3), optional
        Rotation from the body's axes to the world's at time 0; see `turned`. Default:
        none.
    axis : array_like of shape (3,), default (0, 1, 0)
        Axis of the spin, in the body's own axes.
    degrees : float, default 0
        Spin per frame.

    Returns
    -------
    Pose

    Raises
    ------
    ValueError
        Vectors that are not three finite numbers, or an orientation that is no
        rotation.
    """
    p, v = vector(position, "position"), vector(velocity, "velocity")
    a = vector(acceleration, "acceleration")
    still = np.eye(3) if orientation is None else np.asarray(orientation, np.float64)
    if still.shape != (3, 3) or not np.allclose(still @ still.T, np.eye(3)):
        msg = f"orientation must be a rotation of shape (3, 3), got {orientation!r}"
        raise ValueError(msg)
    turned(axis, degrees)  # says now what is wrong with them, not when used

    def pose(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rotation = still @ turned(axis, degrees * t) if degrees else still
        return rotation, p + v * t + a * (t * t / 2)

    return pose


def looking(position: Path, target: Path, roll: Callable[[float], float]) -> Pose:
    """Return the pose of a camera at ``position`` that looks at ``target``.

    Parameters
    ----------
    position, target : Path
        Points as functions of time; they must differ, and not by a vertical line.
    roll : callable
        t -> degrees by which the camera turns about its axis, from right to down; what
        it sees turns the other way.

    Returns
    -------
    Pose
        Of axes (right, down, ahead). Raises ValueError when called at a time at which
        the view is vertical or has no direction.
    """

    def pose(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        eye = vector(position(t), "position")
        ahead = vector(target(t), "target") - eye
        right = np.cross(_DOWN, ahead)
        if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(ahead):
            msg = f"target must not be above, below or at the camera, got {ahead} off"
            raise ValueError(msg)
        ahead /= np.linalg.norm(ahead)
        right /= np.linalg.norm(right)
        level = np.stack([right, np.cross(ahead, right), ahead], axis=1)
        return level @ turned((0.0, 0.0, 1.0), float(roll(t))), eye

    return pose
