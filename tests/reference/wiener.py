"""Slow twin of the per-pixel Wiener deblurring: one pixel, one kernel at a time.

For a pixel whose motion blurs by L = e |v| px, the kernel h with taps -n..n, n the even
number 2 ceil(L) + 8, that minimises

    integral S |1 - K H|^2 + N |H|^2 dw,    sum h = 1,    K = sin(w L/2) / (w L/2)

is found by least squares over frequencies (not from correlations, as the fast form
does), and applied along the streamline in steps of 1 px. S = 1 and N = r for a constant
regularisation; else N = sigma^2 / c and S is the mean of 1/|w|^2 over the frequencies
across, c the local detail (heads of inverse_kernel.rs and detail.rs).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from .blur import Real, sample, spline_coefficients, streamline

LENGTH_STEP = 0.25  # px
LEAST_RATIO, GREATEST_RATIO, LEVELS_PER_OCTAVE = 1e-4, 1.0, 2
FLAT_BELOW = 0.01  # rad/px
SMOOTHING, NEIGHBOURHOOD, DETAIL = 1.5, 3.0, 0.7


def inverse_kernel(length: float, ratio: float, *, constant: bool) -> Real:
    """Return h(0) .. h(n) for a blur of ``length`` px."""
    reach = 2 * math.ceil(length) + 8
    count = 1 << math.ceil(math.log2(max(16 * length, 4 * (2 * reach + 1), 1024)))
    w = 2.0 * math.pi * np.fft.fftfreq(count)
    k = np.sinc(w * length / (2.0 * math.pi))
    radius = np.hypot(w, FLAT_BELOW)
    s = np.ones(count) if constant else np.arctan(math.pi / radius) / (math.pi * radius)
    n = np.arange(reach + 1)
    # H = B h: real and even. The constraint fixes h(0) = 1 - 2 sum h(n).
    basis = np.where(n > 0, 2.0, 1.0) * np.cos(np.outer(w, n))
    free = basis[:, 1:] - 2.0
    rows = np.vstack([np.sqrt(s)[:, None] * k[:, None] * free, math.sqrt(ratio) * free])
    target = np.concatenate([np.sqrt(s) * (1.0 - k), np.full(count, -math.sqrt(ratio))])
    tail = np.linalg.lstsq(rows, target, rcond=None)[0]
    kernel = np.concatenate([[1.0 - 2.0 * tail.sum()], tail])
    share = min(max((length - 0.5) / 0.5, 0.0), 1.0)
    identity = np.where(n == 0, 1.0, 0.0)
    return identity + share * (kernel - identity)


def local_detail(image: Real, sigma: float) -> Real:
    """Constant c of the spectrum c / |w|^2 around each pixel."""

    def gaussian(picture: Real, deviation: float) -> Real:
        return ndimage.gaussian_filter(
            picture, deviation, mode="nearest", radius=int(4 * deviation)
        )

    padded = np.pad(gaussian(image, SMOOTHING), 1, mode="edge")
    dx = (padded[1:-1, 2:] - padded[1:-1, :-2]) / 2.0
    dy = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / 2.0
    mean = gaussian(dx**2 + dy**2, NEIGHBOURHOOD)
    excess = 4 * math.pi * SMOOTHING**2 * mean - (sigma / SMOOTHING) ** 2
    return DETAIL * np.maximum(0.0, excess)


def quantised_ratio(ratio: float) -> float:
    """Return the nearest ratio for which there is a kernel."""
    clipped = min(max(ratio, LEAST_RATIO), GREATEST_RATIO)
    level = math.floor(LEVELS_PER_OCTAVE * math.log2(clipped / LEAST_RATIO) + 0.5)
    return LEAST_RATIO * 2.0 ** (level / LEVELS_PER_OCTAVE)


def deblur(
    image: Real,
    flow: Real,
    exposure: float = 1.0,
    *,
    noise: float = 0.0,
    regularization: float | None = None,
) -> Real:
    """Restore (H, W); motion below 1/2 px or unknown is copied."""
    coefficients = spline_coefficients(image)
    detail = local_detail(image, noise)
    result = image.copy()
    kernels: dict[tuple[float, float], Real] = {}
    for row, column in np.ndindex(image.shape):
        speed = math.hypot(*flow[row, column])
        if not exposure * speed > 0.5:
            continue
        length = LENGTH_STEP * math.floor(exposure * speed / LENGTH_STEP + 0.5)
        if regularization is None:
            c = float(detail[row, column])
            ratio = quantised_ratio(noise**2 / c if c > 0.0 else math.inf)
        else:
            ratio = regularization
        if (length, ratio) not in kernels:
            constant = regularization is not None
            kernels[length, ratio] = inverse_kernel(length, ratio, constant=constant)
        kernel = kernels[length, ratio]
        total = kernel[0] * image[row, column]
        for sign in (-1.0, 1.0):
            walk = streamline(flow, row, column, sign * 2.0 / speed)
            total += sum(tap * sample(coefficients, *next(walk)) for tap in kernel[1:])
        result[row, column] = total
    return result
