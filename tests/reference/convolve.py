"""Separable correlation with explicit border rules, and 2-D 'same' convolution.

Correlation of samples a_0 .. a_{n-1} with k taps w, along one axis:

    b_i = sum_j w_j a_{i + j - floor(k/2)},        i = 0 .. n-1,

so an odd set of taps is centred on the sample and an even set leans one to the left.
Taps are *not* mirrored: for a convolution hand in ``taps[::-1]``. Samples outside the
line follow the border rule (line ``a b c d``):

    replicate   a a a | a b c d | d d d      the edge sample repeated
    reflect     d c b | a b c d | c b a      mirrored, edge sample not repeated
    zero        0 0 0 | a b c d | 0 0 0      also called "constant"

The mirrored continuation has period 2 (n - 1) (1 for a single sample), hence any line
may be shorter than the taps. Units: those of ``array`` times those of ``taps``; real
and complex values alike; NaN spreads over every sum it takes part in.

2-D convolution with a (p, q) kernel, of which the part as large as the array is kept
with the first full-size row and column dropped being floor(p/2), floor(q/2):

    b[y, x] = sum_{r,c} w[r, c] a[y + floor(p/2) - r, x + floor(q/2) - c],

zero outside: the meaning of 'same' in MATLAB's ``conv2``. It keeps the size of the
*array* even when the kernel is larger, unlike ``numpy.convolve(..., "same")``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]

PAD_MODE = {
    "replicate": "edge",
    "reflect": "reflect",
    "zero": "constant",
    "constant": "constant",
}


def extend(array: Array, before: int, after: int, axis: int, border: str) -> Array:
    """Continue ``array`` along one axis by the border rule."""
    if border not in PAD_MODE:
        raise ValueError(f"border: expected one of {sorted(PAD_MODE)}, got {border!r}")
    widths = [(0, 0)] * array.ndim
    widths[axis] = (before, after)
    # The mode is a plain string here; NumPy's overloads want a literal.
    mode: Any = PAD_MODE[border]
    return np.pad(array, widths, mode=mode)


def correlate_axis(
    array: ArrayLike, taps: ArrayLike, axis: int, border: str
) -> NDArray[Any]:
    """Correlate along one axis.

    Parameters
    ----------
    array : ndarray of any shape, real or complex
    taps : ndarray of shape (k,), k >= 1
    axis : int
    border : {"replicate", "reflect", "zero", "constant"}

    Returns
    -------
    ndarray of the shape of ``array``
        float64, or complex128 where either input is complex.
    """
    samples = np.asarray(array)
    weights = np.asarray(taps)
    if weights.ndim != 1 or weights.size == 0:
        raise ValueError(f"taps: expected shape (k,), k >= 1, got {weights.shape}")
    dtype = np.result_type(samples, weights, np.float64)
    length = samples.shape[axis]
    before = weights.size // 2
    after = weights.size - 1 - before
    extended = np.moveaxis(extend(samples, before, after, axis, border), axis, 0)
    total = np.zeros((length, *extended.shape[1:]), dtype)
    for j, weight in enumerate(weights):
        total += weight * extended[j : j + length]
    return np.moveaxis(total, 0, axis)


def separable_3d(
    volume: ArrayLike,
    taps_t: ArrayLike,
    taps_y: ArrayLike,
    taps_x: ArrayLike,
    border: str,
) -> NDArray[Any]:
    """Correlate a (T, H, W) volume with the outer product of three sets of taps."""
    result = np.asarray(volume)
    if result.ndim != 3:
        raise ValueError(f"volume: expected shape (T, H, W), got {result.shape}")
    for axis, taps in enumerate((taps_t, taps_y, taps_x)):
        result = correlate_axis(result, taps, axis, border)
    return result


def convolve_same(array: ArrayLike, kernel: ArrayLike) -> NDArray[Any]:
    """Zero-bordered 2-D convolution, cropped to the array as MATLAB's 'same' does.

    Parameters
    ----------
    array : ndarray of shape (H, W), real or complex
    kernel : ndarray of shape (p, q), real or complex

    Returns
    -------
    ndarray of shape (H, W)
    """
    samples = np.asarray(array)
    weights = np.asarray(kernel)
    if samples.ndim != 2 or weights.ndim != 2:
        raise ValueError(
            "array, kernel: expected shapes (H, W) and (p, q), "
            f"got {samples.shape} and {weights.shape}"
        )
    height, width = samples.shape
    rows, columns = weights.shape
    full = np.zeros(
        (height + rows - 1, width + columns - 1),
        np.result_type(samples, weights, np.float64),
    )
    for r in range(rows):
        for c in range(columns):
            full[r : r + height, c : c + width] += weights[r, c] * samples
    top, left = rows // 2, columns // 2
    return full[top : top + height, left : left + width]
