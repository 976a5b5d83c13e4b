"""Pictures blurred by steady motion with exact truth, independent of the library.

A steady affine velocity field v(p) = A (p - centre) + b carries the point p to
exp(t M) p, M the 3 x 3 matrix of the field. The blurred picture is the mean of 64
sub-frames sampled through exp(-t M) by splines of order 5 from a larger picture, so
that real content enters at the edges. The deblurring uses other interpolation, other
integration and other borders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.linalg import expm

Real = NDArray[np.float64]

SUBFRAMES = 64


def affine(kind: str, amount: float, angle: float, size: int) -> Real:
    """Return M (per frame) about the centre of a ``size`` x ``size`` picture.

    "translation": ``amount`` px at ``angle`` degrees, y up; "zoom": ``amount`` px at
    the corners; "rotation": ``amount`` degrees.
    """
    matrix = np.zeros((3, 3))
    if kind == "translation":
        a = np.radians(angle)
        matrix[:2, 2] = amount * np.cos(a), -amount * np.sin(a)
    elif kind == "zoom":
        matrix[:2, :2] = np.eye(2) * amount / np.hypot(size / 2, size / 2)
    else:
        matrix[0, 1] = np.radians(amount)
        matrix[1, 0] = -np.radians(amount)
    return matrix


def centred_grid(size: int) -> tuple[Real, Real]:
    """Return x and y of each pixel about the centre."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    return x, y


def velocity(matrix: Real, size: int) -> NDArray[np.float32]:
    """Return the flow (size, size, 2) in px/frame."""
    x, y = centred_grid(size)
    u, v = (matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] for i in (0, 1))
    return np.stack([u, v], axis=-1).astype(np.float32)


def blurred(
    picture: Real, matrix: Real, size: int, sigma: float, seed: int = 0
) -> tuple[Real, NDArray[np.uint8]]:
    """Return (sharp, blurred) crops; the latter with noise, rounded to 8 bits."""
    top, left = ((n - size) // 2 for n in picture.shape)
    coefficients = ndimage.spline_filter(picture, order=5, mode="mirror")
    x, y = centred_grid(size)
    mean = np.zeros((size, size))
    for t in (np.arange(SUBFRAMES) + 0.5) / SUBFRAMES - 0.5:
        m = expm(-t * matrix)
        there = [m[i, 0] * x + m[i, 1] * y + m[i, 2] + (size - 1) / 2 for i in (1, 0)]
        mean += ndimage.map_coordinates(
            coefficients,
            [there[0] + top, there[1] + left],
            order=5,
            mode="mirror",
            prefilter=False,
        )
    mean = np.rint(mean / SUBFRAMES)
    noise = sigma * np.random.default_rng(seed).standard_normal(mean.shape)
    dirty = np.clip(np.rint(mean + noise), 0, 255).astype(np.uint8)
    return picture[top : top + size, left : left + size], dirty


def psnr(a: NDArray[np.generic], b: NDArray[np.generic], margin: int = 24) -> float:
    """Return the peak signal to noise ratio of 8-bit pictures inside a margin, dB."""
    inner = slice(margin, -margin)
    error = (np.asarray(a, float) - np.asarray(b, float))[inner, inner]
    return float(10 * np.log10(255**2 / np.mean(error**2)))
