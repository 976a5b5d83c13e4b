r"""Gabor filters tuned to a wavevector: corrected spatial bank, velocity-tuned bank.

A filter tuned to k = (k_x, k_y) rad/px is a Gaussian window on a complex carrier,

    h(x, y) = a(x) b(y),  a(n) = g(n) exp(i k_x n),  b(n) = g(n) exp(i k_y n),
    g(n) = exp(-n^2 / 2 sigma^2) / sum,  |n| <= ceil(support sigma),

used by *convolution*, so a plane wave exp(i k.x) answers exp(i k.x) itself and the
phase of a response advances as +k.x (x right, y down). For an amplitude bandwidth of
beta octaves about k0 = 2 pi f0 (half widths sigma_k = 1/sigma, in rad/px),

    sigma = (2^beta + 1) / ((2^beta - 1) k0)   px.

Constant brightness must not answer: in the factor with the larger |k| (x on a tie) the
cosine taps c become c - g sum(c); the sine taps are odd and sum to zero already.

In time the same window carries exp(i omega n), omega = -k.v for a pattern of velocity
v. The velocity-tuned bank puts its 22 centres on the sphere of radius k0 in
(k_x, k_y, omega): elevations 0, 30, 60 degrees (speeds 0, 1/sqrt 3, sqrt 3 px/frame),
with 6 directions over 180 degrees for speed 0 and 10 and 6 over 360 for the others.

Valid for 0 < f0 < 1/2 cycle/px and beta > 0. Differs from the 2007 listings: sigma has
its 2 pi, there is no DC response, directions cover 180 degrees (real pictures have
conjugate responses at k and -k), and the window ends at ``support`` sigma, not one.

References: D. J. Fleet, A. D. Jepson, Int. J. Comput. Vision 5 (1990) 77-104,
doi:10.1007/BF00056772.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .convolve import correlate_axis

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# First derivatives by central differences: {reach: {offset: weight}}.
STENCILS = {
    1: {-1: -1 / 2, 1: 1 / 2},
    2: {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12},
}
# With fewer frames on each side the window is worth more than two more points.
FIVE_POINT_RADIUS = 5
# (elevation in degrees, number of directions, span of directions in degrees)
VELOCITY_TUNED_RINGS = ((0.0, 6, 180.0), (30.0, 10, 360.0), (60.0, 6, 360.0))


def window_sigma(tuning_frequency: float, bandwidth_octaves: float) -> float:
    """Width of the window in pixels (and frames)."""
    if not 0 < tuning_frequency < 0.5:
        raise ValueError(
            f"tuning_frequency: expected 0 < f0 < 0.5 cycle/px, got {tuning_frequency}"
        )
    if not bandwidth_octaves > 0:
        raise ValueError(f"bandwidth_octaves: expected > 0, got {bandwidth_octaves}")
    ratio = 2.0**bandwidth_octaves
    return float((ratio + 1) / ((ratio - 1) * 2 * np.pi * tuning_frequency))


def wavevectors(tuning_frequency: float, orientations: int) -> Real:
    """Spatial bank: (N, 2) wavevectors in rad/px at angles j pi / N, y down."""
    angle = np.arange(orientations) * np.pi / orientations
    return 2 * np.pi * tuning_frequency * np.stack([np.cos(angle), np.sin(angle)], -1)


def velocity_tuned_wavevectors(tuning_frequency: float) -> Real:
    """Velocity-tuned bank: (22, 3) of (k_x, k_y, omega), rad/px, rad/px, rad/frame."""
    centres = []
    for elevation, count, span in VELOCITY_TUNED_RINGS:
        rise = np.radians(elevation)
        angle = np.radians(np.arange(count) * span / count)
        flat = np.cos(rise) * np.stack([np.cos(angle), np.sin(angle)], -1)
        # omega = -k.v is negative for motion along +k.
        centres.append(np.column_stack([flat, np.full(count, -np.sin(rise))]))
    return 2 * np.pi * tuning_frequency * np.concatenate(centres)


def gaussian(sigma: float, radius: int) -> tuple[Real, Real]:
    """Offsets -radius..radius and the sampled Gaussian of unit sum on them."""
    offsets = np.arange(-radius, radius + 1, dtype=np.float64)
    weights = np.exp(-(offsets**2) / (2 * sigma**2))
    return offsets, weights / weights.sum()


def spatial_taps(
    wavevector: Real, sigma: float, support: float = 3.0
) -> tuple[Complex, Complex]:
    """Convolution taps (a along x, b along y), free of DC."""
    kx, ky = float(wavevector[0]), float(wavevector[1])
    offsets, g = gaussian(sigma, int(np.ceil(support * sigma)))
    along_x = g * np.exp(1j * kx * offsets)
    along_y = g * np.exp(1j * ky * offsets)
    # The slack keeps rounding from moving a true tie (45 degrees) to y.
    if abs(kx) >= abs(ky) * (1 - 1e-12):
        along_x = along_x - g * along_x.real.sum()
    else:
        along_y = along_y - g * along_y.real.sum()
    return along_x, along_y


def respond(
    frames: Real | Complex,
    wavevector: Real,
    sigma: float,
    support: float = 3.0,
    border: str = "replicate",
) -> Complex:
    """Spatial responses (..., H, W) of frames (..., H, W) to one filter."""
    along_x, along_y = spatial_taps(wavevector, sigma, support)
    # Correlation with mirrored taps is convolution.
    rows = correlate_axis(frames, along_x[::-1], -1, border)
    return correlate_axis(rows, along_y[::-1], -2, border)


def temporal_taps(omega: float, sigma: float, radius: int) -> tuple[Complex, Complex]:
    r"""Correlation taps in time, n = -radius..radius: response and slope.

    With z(n) = S(t + n) exp(-i omega n) the response is R = sum g(n) z(n) over a window
    ``reach`` frames shorter than ``radius`` at both ends, and the slope is the central
    difference of such windows moved by -reach..reach: sum_q d(q) sum_n g(n) z(n + q).
    Both therefore take in every frame and cost one correlation each. omega = 0 gives
    the plain Gaussian and its derivative.
    """
    reach = 2 if radius >= FIVE_POINT_RADIUS else 1
    _, g = gaussian(sigma, radius - reach)
    offsets = np.arange(-radius, radius + 1)
    window, slope = np.zeros(offsets.size), np.zeros(offsets.size)
    window[reach : reach + g.size] = g
    for q, weight in STENCILS[reach].items():
        slope[reach + q : reach + q + g.size] += weight * g
    # Odd to the last bit, so that equal frames cancel exactly.
    slope = (slope - slope[::-1]) / 2
    carrier = np.exp(-1j * omega * offsets)
    return window * carrier, slope * carrier


def respond_in_time(
    frames: Real, index: int, omega: float, sigma: float, support: float = 3.0
) -> tuple[Complex, Complex]:
    """Response and demodulated time slope at frame ``index`` of (T, H, W) frames.

    Filtering in space commutes with this and may come before or after. Equal frames
    give a slope of exactly 0 at omega = 0.
    The window is cut symmetrically to the frames there are on *both* sides: a lopsided
    one would measure the motion of another instant.
    """
    count = frames.shape[0]
    radius = min(index, count - 1 - index, int(np.ceil(support * sigma)))
    if radius < 1:
        raise ValueError(
            f"index: expected a frame on each side of it, got {index} of {count} frames"
        )
    taps, slopes = temporal_taps(omega, sigma, radius)
    centre: Complex = taps[radius] * frames[index]
    rate = np.zeros_like(centre)
    # Pair by pair, for the exact cancellation; the slope's middle tap is zero.
    for n in range(1, radius + 1):
        later, earlier = frames[index + n], frames[index - n]
        centre = centre + (taps[radius + n] * later + taps[radius - n] * earlier)
        rate = rate + (slopes[radius + n] * later + slopes[radius - n] * earlier)
    return centre, rate


def coverage(shape: tuple[int, int], sigma: float, support: float = 3.0) -> Real:
    """Share (H, W) in (0, 1] of the Gaussian window lying inside the picture.

    1 in the interior, about 1/2 at an edge, 1/4 in a corner: what lies outside is made
    up by the border rule and does not move with the picture.
    """
    _, g = gaussian(sigma, int(np.ceil(support * sigma)))
    rows, columns = (correlate_axis(np.ones(length), g, 0, "zero") for length in shape)
    return np.outer(rows, columns)
