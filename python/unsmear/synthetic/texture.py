"""Textures and waves made from numbers alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["checkers", "plane_wave", "texture"]

# Mean and standard deviation of a texture: few samples reach black or white.
_MEAN, _DEVIATION = 0.5, 0.18


def _shape(shape: tuple[int, int], argument: str = "shape") -> tuple[int, int]:
    if len(shape) != 2 or min(shape) < 1:
        msg = f"{argument} must be (H >= 1, W >= 1), got {tuple(shape)}"
        raise ValueError(msg)
    return int(shape[0]), int(shape[1])


def texture(
    shape: tuple[int, int], *, seed: int = 0, exponent: float = 1.0
) -> NDArray[np.float64]:
    """Return a random picture whose amplitude spectrum falls as 1 / f^exponent.

    Parameters
    ----------
    shape : (int, int)
        (H, W).
    seed : int, default 0
        The same seed gives the same picture.
    exponent : float, default 1.0
        1 is that of photographs; 0 is white noise.

    Returns
    -------
    ndarray of shape (H, W), float64
        In [0, 1], mean 0.5 and standard deviation 0.18 before clipping.

    Raises
    ------
    ValueError
        A shape without pixels.
    """
    height, width = _shape(shape)
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.normal(size=(height, width)))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    frequency[0, 0] = np.inf
    picture = np.fft.irfft2(spectrum / frequency**exponent, s=(height, width))
    deviation = picture.std()
    if deviation > 0:
        picture = (picture - picture.mean()) * (_DEVIATION / deviation)
    return np.clip(picture + _MEAN, 0.0, 1.0)


def plane_wave(
    shape: tuple[int, int],
    frequency: tuple[float, float],
    *,
    velocity: tuple[float, float] = (0.0, 0.0),
    n_frames: int = 3,
    phase: float = 0.0,
) -> NDArray[np.float64]:
    r"""Return frames of one wave, :math:`.5 + .5 \cos(2\pi f \cdot (p - v t) + phase)`.

    Parameters
    ----------
    shape : (int, int)
        (H, W).
    frequency : (float, float)
        (x, y), cycles/px.
    velocity : (float, float), default (0, 0)
        (u, v), px/frame; only its part along ``frequency`` can be seen.
    n_frames : int, default 3
        T.
    phase : float, default 0
        Phase of the first pixel at time 0, rad.

    Returns
    -------
    ndarray of shape (T, H, W), float64
        In [0, 1].
    """
    height, width = _shape(shape)
    if n_frames < 1:
        msg = f"n_frames must be >= 1, got {n_frames}"
        raise ValueError(msg)
    t, y, x = np.ogrid[:n_frames, :height, :width]
    along = frequency[0] * (x - velocity[0] * t) + frequency[1] * (y - velocity[1] * t)
    return np.asarray(0.5 + 0.5 * np.cos(2 * np.pi * along + phase))


def checkers(
    shape: tuple[int, int],
    fields: tuple[int, int],
    *,
    dark: float = 0.15,
    bright: float = 0.85,
) -> NDArray[np.float64]:
    """Return a board of ``fields`` (rows, columns) squares of two brightnesses.

    Parameters
    ----------
    shape : (int, int)
        (H, W) px.
    fields : (int, int)
        At least 1 and at most the px of that side.
    dark, bright : float, default 0.15 and 0.85
        The upper left field is dark.

    Returns
    -------
    ndarray of shape (H, W), float64

    Raises
    ------
    ValueError
        A shape without pixels, or more fields than pixels.
    """
    height, width = _shape(shape)
    rows, columns = _shape(fields, "fields")
    if rows > height or columns > width:
        msg = f"fields must be at most {height, width}, got {rows, columns}"
        raise ValueError(msg)
    row = np.arange(height)[:, None] * rows // height
    column = np.arange(width) * columns // width
    return np.where((row + column) % 2 == 0, dark, bright)
