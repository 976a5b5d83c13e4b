"""Sequences with exact motion: sums of plane waves, evaluated and never interpolated.

    I(t, y, x) = sum_w a_w cos(k_w . (x - u s, y - v s) + p_w),     s = t - t0

with wavevectors uniform in angle and in |k| within ``band`` (rad/px). Every frame is
exact for any motion, so what a method gets wrong is the method's own error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

# Within reach of both flow methods' filters (0.75 and 1.48 rad/px, half widths 0.2 and
# 0.4), well below the highest frequency pi that pixels can hold.
BAND = (0.4, 1.9)


def moving_texture(
    velocity: tuple[float, float],
    shape: tuple[int, int, int] = (3, 48, 52),
    *,
    seed: int = 0,
    waves: int = 60,
    band: tuple[float, float] = BAND,
    origin: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
) -> Real:
    """Frames (T, H, W) of a texture of about unit contrast that moves at ``velocity``.

    ``origin`` is the frame at which the texture is in place, ``offset`` the place (x,
    y) of the top left pixel on it.
    """
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, waves)
    length = rng.uniform(*band, waves)
    phase = rng.uniform(0, 2 * np.pi, waves)
    kx, ky = length * np.cos(angle), length * np.sin(angle)
    t, y, x = (np.arange(n, dtype=np.float64) for n in shape)
    frames = np.zeros(shape)
    for wave in range(waves):
        along_x = kx[wave] * (x + offset[0])
        along_y = ky[wave] * (y + offset[1])
        drift = kx[wave] * velocity[0] + ky[wave] * velocity[1]
        carrier = phase[wave] - drift * (t - origin)
        frames += np.cos(
            along_x[None, None, :] + along_y[None, :, None] + carrier[:, None, None]
        )
    return frames * np.sqrt(2 / waves)


def standardized(frames: Real) -> Real:
    """What the flow methods do to brightness first: mean 0, largest deviation 1."""
    centred = frames - frames.mean()
    return np.asarray(centred / np.abs(centred).max())
