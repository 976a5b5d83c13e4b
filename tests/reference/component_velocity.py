r"""Component (normal) velocities from the phase gradient, and their tests.

A surface of constant phase moves along grad phi = (phi_x, phi_y) with

    v_n = -phi_t grad phi / |grad phi|^2        px/frame,

the only part of the motion that one filter can see. It is believed where

    amplitude            |R| >= max(fraction * largest |R| of the bank, floor),
    frequency            |(phi_x, phi_y, phi_t) - (k_x, k_y, omega)| <= tau sigma_k,

sigma_k = 1/sigma rad/px. Steps between frames may also ask for steadiness,

    2 a_0 a_1/(a_0^2 + a_1^2) >= least        for each neighbouring frame,

which two motions in one filter, beating, do not have. The second test removes the
neighbourhoods of phase singularities, where phase turns fast while the amplitude is not
yet zero. For filters without a temporal carrier it runs over (phi_x, phi_y) only. The
floor keeps rounding from passing as signal in a blank picture: it is a share of the
largest |brightness|.

NaN where a test fails or grad phi = 0; a still picture gives exactly 0.

References: D. J. Fleet, A. D. Jepson, Int. J. Comput. Vision 5 (1990) 77-104,
doi:10.1007/BF00056772; D. J. Fleet, A. D. Jepson, IEEE Trans. Pattern Anal. Mach.
Intell. 15 (1993) 1253-1268, doi:10.1109/34.250844 (stability, singularities).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

# Share of the largest |brightness| that counts as signal: far above single precision
# rounding (6e-8 per operation), far below one grey level of 8 bits (4e-3).
ROUNDING_FLOOR = 1e-5


def amplitude_floor(frames: Real, amplitudes: Real, fraction: float) -> float:
    """Return the least amplitude that is believed."""
    largest = float(np.max(amplitudes, initial=0.0))
    return max(fraction * largest, ROUNDING_FLOOR * float(np.max(np.abs(frames))))


def frequency_deviation(gradient: Real, wavevector: Real, sigma: float) -> Real:
    """|gradient - k| / sigma_k over as many components as ``wavevector`` has."""
    difference = gradient[..., : len(wavevector)] - wavevector
    return np.asarray(sigma * np.sqrt((difference**2).sum(-1)))


def steadiness(responses: NDArray[np.complex128], index: int) -> Real:
    """Least 2 a0 a1 / (a0^2 + a1^2) of frame ``index`` with its neighbours; (H, W)."""
    here = np.abs(responses[index])
    ratios = []
    for t in (index - 1, index + 1):
        if 0 <= t < len(responses):
            there = np.abs(responses[t])
            with np.errstate(invalid="ignore"):
                ratios.append(2 * here * there / (here**2 + there**2))
    return np.nan_to_num(np.minimum.reduce(ratios), nan=1.0)


def component_velocity(gradient: Real, valid: NDArray[np.bool_]) -> Real:
    """(..., 3) of (phi_x, phi_y, phi_t) -> (..., 2) normal velocity, NaN if not valid.

    Parameters
    ----------
    gradient : ndarray of shape (..., 3)
        rad/px, rad/px, rad/frame.
    valid : ndarray of shape (...,)
        Outcome of the tests.
    """
    space, time = gradient[..., :2], gradient[..., 2]
    squared = (space**2).sum(-1)
    usable = valid & np.isfinite(gradient).all(-1) & (squared > 0)
    velocity = np.full(space.shape, np.nan)
    # Adding 0 turns the -0 of a still picture into 0.
    velocity[usable] = -(time[usable] / squared[usable])[:, None] * space[usable] + 0.0
    return velocity
