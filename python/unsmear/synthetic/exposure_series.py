r"""One scene exposed several times, each time blurred in another direction.

Between exposures the camera moves to another pose (a shift and a small turn about the
middle of the picture), during each it moves at a constant velocity of its own, like a
hand held still as well as it can:

.. math:: p(t) = R_k q + c_k + (t - k) v_k, \qquad |t - k| < \tfrac12,

k the number of the exposure, counted from that in the middle, which has the pose of the
scene (R = 1, c = 0). A frequency that one blur wipes out is kept by the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.eight_bits import in_eight_bits
from unsmear.synthetic.scene import Layer, Scene
from unsmear.synthetic.sequence import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from unsmear.synthetic.motion import Motion

__all__ = ["ExposureSeries", "exposure_series"]

_POSE = (2.7, -140.0, 0.7)
"""Shift of the exposure after the middle one, px, its direction and the turn, degrees;
the others lie on the same line, those before on the other side."""


@dataclass(frozen=True)
class ExposureSeries:
    """A scene seen by T exposures.

    Attributes
    ----------
    sharp : ndarray of shape (T, H, W) or (T, H, W, C), uint8
        At the middle of each exposure.
    blurred : ndarray like ``sharp``
        Exposed, with noise.
    exposed : ndarray like ``sharp``, float64
        Before noise and rounding, in [0, 1]; see `with_noise`.
    velocity : ndarray of shape (T, H, W, 2), float32
        True (u, v) during each exposure, px/frame; constant in time.
    offset, way : ndarray of shape (T, H, W, 2), float32
        True displacement from each exposure to the one in the middle, and back, px.
    """

    sharp: NDArray[np.uint8]
    blurred: NDArray[np.uint8]
    exposed: NDArray[np.float64]
    velocity: NDArray[np.float32]
    offset: NDArray[np.float32]
    way: NDArray[np.float32]

    def with_noise(self, noise: float, seed: int = 0) -> ExposureSeries:
        """Return the series with other noise, deviation in grey levels, >= 0."""
        return replace(self, blurred=in_eight_bits(self.exposed, noise, seed))


def exposure_series(
    picture: ArrayLike,
    *,
    shape: tuple[int, int],
    directions: Sequence[float] = (0.0, 60.0, 120.0),
    lengths: Sequence[float] | float = 15.0,
    noise: float = 1.0,
    seed: int = 0,
    n_subframes: int = 96,
) -> ExposureSeries:
    """Expose a picture several times.

    Parameters
    ----------
    picture : array_like of shape (H, W) or (H, W, C)
        The content, seen through a window in its middle; it should be larger than
        ``shape`` by what moves in (mirrored beyond). Integers are scaled by their
        range, floats are in [0, 1].
    shape : (int, int)
        (H, W) of the window.
    directions : sequence of float, default (0, 60, 120)
        Direction of each exposure's blur, degrees from x (right) to y (down); an odd
        number of them.
    lengths : float or sequence of float, default 15.0
        Lengths of blur, px, one for all or one for each.
    noise : float, default 1.0
        Standard deviation, in grey levels of 255.
    seed : int, default 0
        Of the noise.
    n_subframes : int, default 96
        Pictures averaged per exposure, >= 1; at least one per px of blur is smooth.

    Returns
    -------
    ExposureSeries

    Raises
    ------
    ValueError
        An even number of directions, lengths that do not match them, or what `record`
        refuses.

    Examples
    --------
    >>> from unsmear import synthetic
    >>> picture = synthetic.texture((96, 96), seed=1)
    >>> series = synthetic.exposure_series(picture, shape=(64, 64), n_subframes=16)
    >>> series.blurred.shape, series.offset.shape
    ((3, 64, 64), (3, 64, 64, 2))
    """
    count = len(directions)
    if count % 2 == 0:
        msg = f"directions must be an odd number of angles, got {count}"
        raise ValueError(msg)
    each = np.atleast_1d(np.asarray(lengths, np.float64))
    if each.shape not in ((1,), (count,)):
        msg = f"lengths must be one, or one for each direction, got {each.size}"
        raise ValueError(msg)
    motion = _series(list(directions), list(np.broadcast_to(each, count)))
    scene = Scene((Layer(picture, motion),), shape)
    s = record(scene, n_frames=count, exposure=1.0, n_subframes=n_subframes)
    times = np.arange(count) - (count - 1) / 2
    offset = np.stack([scene.displacement(t, 0.0)[0] for t in times])
    way = np.stack([scene.displacement(0.0, t)[0] for t in times])
    return ExposureSeries(
        sharp=in_eight_bits(s.sharp),
        blurred=in_eight_bits(s.blurred),
        exposed=s.blurred,
        velocity=s.velocity,
        offset=offset.astype(np.float32),
        way=way.astype(np.float32),
    ).with_noise(noise, seed)


def _series(directions: list[float], lengths: list[float]) -> Motion:
    middle = len(directions) // 2
    distance, towards, turn = _POSE

    def motion(time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        k = min(max(round(time), -middle), middle)
        pose = k * distance * _unit(towards)
        course = lengths[k + middle] * _unit(directions[k + middle])
        cos, sin = math.cos(math.radians(k * turn)), math.sin(math.radians(k * turn))
        return np.array([[cos, -sin], [sin, cos]]), pose + (time - k) * course

    return motion


def _unit(degrees: float) -> NDArray[np.float64]:
    angle = math.radians(degrees)
    return np.array([math.cos(angle), math.sin(angle)])
