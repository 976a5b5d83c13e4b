"""Motion deblurring of the founding method: one regularised inverse per pixel.

C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT MEng thesis, 2007,
section 4.2 and appendix D.2. Image (H, W) on any scale, flow px/frame (x right, y down,
exposure = one frame), degree n >= 1, regularisation r > 0 (power of a unit-sum PSF):

    m = 2^(n-1); image upsampled linearly to m (s - 1) + 1 samples a side
    L = round(m |v|), a = atan2(-v, u) in degrees, per pixel of the original grid
    k = fspecial_motion(L, a);  K = DFT of k at its own size (p, q)
    H = conj(K) / (|K|^2 + r);  h = inverse DFT of H
    out = sum of h, flipped on both axes and laid over the upsampled image so that its
          element floor((p+1)/2), floor((q+1)/2) (from 1) lies on the pixel's node.

The DFT takes the corner of k as its origin, so the inverse's peak sits half an array
off; after the flip it lies one sample before the node on each axis: the output is
shifted by 1/m px. The overlay wraps round the upsampled image. Pixels with unknown
(NaN) motion, with L = 0, or whose PSF is a single sample, are copied. (L = 1 gives one
sample at angles of 0 to 90 degrees modulo 180, but three in a row beyond: those pixels
are filtered, by shift and 1/(1 + r).) Rows and columns 10 .. s - 10 (from 1) are
computed, all others stay 0. Cost: about (m L)^2 per pixel; for small pictures only.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .psf import fspecial_motion
from .thesis_flow import upsample_linear

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# First row and column computed, counted from 1.
MARGIN = 10


def inverse_filter(psf: Real, regularization: float) -> tuple[Complex, Complex]:
    """Return the regularised inverse (H, h), each of the PSF's own shape."""
    spectrum = np.fft.fft2(psf)
    inverse = spectrum.conj() / (np.abs(spectrum) ** 2 + regularization)
    return inverse, np.fft.ifft2(inverse)


def lengths_and_angles(vx: Real, vy: Real, degree: int) -> tuple[Real, Real]:
    """Return lengths rounded on the upsampled grid (px) and angles (degrees)."""
    scale = 2.0 ** (degree - 1)
    # Halves away from zero; lengths are never negative.
    length = np.floor(np.sqrt((scale * vx) ** 2 + (scale * vy) ** 2) + 0.5)
    return length, np.degrees(np.arctan2(-vy, vx))


def overlay_sum(image: Real, kernel: Complex, row: int, column: int) -> float:
    """Sum the flipped kernel over the image, wrapping round it; node from 0."""
    p, q = kernel.shape
    rows = np.arange(p) + row - ((p + 1) // 2 - 1)
    columns = np.arange(q) + column - ((q + 1) // 2 - 1)
    patch = image[np.ix_(rows % image.shape[0], columns % image.shape[1])]
    return float(np.sum(kernel[::-1, ::-1].real * patch))


def deblur(
    image: ArrayLike,
    vx: ArrayLike,
    vy: ArrayLike,
    degree: int = 4,
    regularization: float = 0.02,
) -> Real:
    """Return the deblurred image, (H, W), 0 outside the computed rows and columns.

    Parameters
    ----------
    image, vx, vy : ndarray of shape (H, W)
    degree : int
        Interpolation degree n >= 1.
    regularization : float
        r, against the power |K|^2 <= 1 of a unit-sum PSF.
    """
    blurred = np.asarray(image, dtype=np.float64)
    u, v = np.asarray(vx, dtype=np.float64), np.asarray(vy, dtype=np.float64)
    if blurred.ndim != 2 or u.shape != blurred.shape or v.shape != blurred.shape:
        raise ValueError(
            "image, vx, vy: expected one shape (H, W), "
            f"got {blurred.shape}, {u.shape}, {v.shape}"
        )
    scale = 2 ** (degree - 1)
    fine = upsample_linear(blurred, degree - 1)
    lengths, angles = lengths_and_angles(u, v, degree)
    inverses: dict[tuple[float, float], Complex] = {}
    result = np.zeros_like(blurred)
    height, width = blurred.shape
    for i in range(MARGIN - 1, height - MARGIN):
        for j in range(MARGIN - 1, width - MARGIN):
            length, angle = float(lengths[i, j]), float(angles[i, j])
            if math.isnan(length) or length == 0.0:
                result[i, j] = blurred[i, j]
                continue
            key = (length, angle)
            if key not in inverses:
                psf = fspecial_motion(length, angle)
                inverses[key] = inverse_filter(psf, regularization)[1]
            if inverses[key].size == 1:
                result[i, j] = blurred[i, j]
            else:
                result[i, j] = overlay_sum(fine, inverses[key], scale * i, scale * j)
    return result
