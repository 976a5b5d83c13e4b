r"""Phase gradient of complex filter responses.

For R = rho exp(i phi) the gradient of the phase needs no unwrapping,

    grad phi = Im(conj(R) grad R) / |R|^2,

in rad/px along x (right) and y (down) and rad/frame along t. R oscillates near its
filter's wavevector k, which difference formulas resolve badly, so the carrier is taken
out first: z(n) = R(x + n) exp(-i k n) varies slowly, and

    phi_x = k + Im(conj(R) D z) / |R|^2,  D z = [z(-2) - 8 z(-1) + 8 z(1) - z(2)] / 12.

For a plane wave at k + d this gives k + (8 sin d - sin 2d)/6 = k + d - d^5/30 + ...,
below 1e-3 rad/px within |d| <= 0.5 (1.25 bandwidths of the default filters; the three
point rule would be 2e-2 off). Past the picture's edge z goes on in a straight line.

Along t there are two forms. ``time_slope`` takes the same demodulated difference of
windows moved in time, folded into one set of taps (gabor.temporal_taps): all frames
serve the reference frame at the cost of one more correlation. The derivative of the
window itself, n g(n), is no cheaper and 20 times less exact, as a Gaussian cut at 3
sigma is not the one whose derivative n g(n) is (plane waves within 1.25 sigma_k, 15
frames: 1.7e-2 rad/frame at worst against 9e-4). ``phase_step`` is the phase difference
of two frames: exact for any uniform shift below half a wavelength, which is what two or
three frames allow.

NaN where R = 0 (no phase). References: D. J. Fleet, A. D. Jepson, Int. J. Comput.
Vision 5 (1990) 77-104, doi:10.1007/BF00056772.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .gabor import STENCILS

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

REACH = 2


def rate_of_phase(response: Complex, derivative: Complex) -> Real:
    """Im(conj(R) dR) / |R|^2, NaN where R = 0."""
    power = response.real**2 + response.imag**2
    # Written out: a fused complex product need not vanish for parallel arguments.
    crossed = response.real * derivative.imag - response.imag * derivative.real
    known = power > 0
    rate = np.full(power.shape, np.nan)
    rate[known] = crossed[known] / power[known]
    return rate


def phase_derivative(response: Complex, wavenumber: float, axis: int) -> Real:
    """Phase derivative along one spatial axis of (..., H, W), rad/px."""
    lines = np.moveaxis(response, axis, -1)
    length = lines.shape[-1]
    if length < 2:
        raise ValueError(f"response: expected 2 or more samples, got {length}")
    padded = np.pad(lines, [(0, 0)] * (lines.ndim - 1) + [(REACH, REACH)])
    step = np.exp(1j * wavenumber)
    for q in reversed(range(REACH)):
        first, second = padded[..., q + 1] / step, padded[..., q + 2] / step**2
        padded[..., q] = 2 * first - second
    for q in range(length + REACH, length + 2 * REACH):
        first, second = padded[..., q - 1] * step, padded[..., q - 2] * step**2
        padded[..., q] = 2 * first - second
    derivative = np.zeros_like(lines)
    for n, weight in STENCILS[REACH].items():
        start = REACH + n
        derivative += weight * step ** (-n) * padded[..., start : start + length]
    rate = rate_of_phase(lines, derivative) + wavenumber
    return np.moveaxis(rate, -1, axis)


def spatial_gradient(response: Complex, wavevector: Real) -> Real:
    """(..., H, W) responses -> (..., H, W, 2) of (phi_x, phi_y), rad/px."""
    phi_x = phase_derivative(response, float(wavevector[0]), -1)
    phi_y = phase_derivative(response, float(wavevector[1]), -2)
    return np.stack([phi_x, phi_y], -1)


def time_slope(response: Complex, slope: Complex, omega: float) -> Real:
    """phi_t in rad/frame from a response and its demodulated slope in time."""
    return rate_of_phase(response, slope) + omega


def phase_step(first: Complex, second: Complex) -> Real:
    """Phase advance from one frame to the next, in (-pi, pi], rad.

    Exactly 0 for equal responses; 0 where either is 0 (its weight must be 0 there).
    """
    across = first.real * second.imag - first.imag * second.real
    along = first.real * second.real + first.imag * second.imag
    return np.arctan2(across, along)


def mean_phase_step(responses: Complex, index: int) -> Real:
    """phi_t at frame ``index``: mean of the steps from and to its neighbours."""
    count = responses.shape[0]
    if count < 2 or not 0 <= index < count:
        raise ValueError(f"index: expected 0..{count - 1} of 2+ frames, got {index}")
    steps = [
        phase_step(responses[t], responses[t + 1])
        for t in (index - 1, index)
        if 0 <= t < count - 1
    ]
    return np.asarray(np.mean(steps, axis=0))
