r"""Flow at one scale by weighted least squares over phase constraints.

Every filter j of the spatial bank and every pair of frames (t, t+1) gives at each pixel
one constraint on the flow w = (u, v) px/frame,

    G.w + D = 0,   G = [grad phi(t) + grad phi(t+1)] / 2  rad/px,
                   D = arg(conj(R(t)) R(t+1))             rad,

so that w minimises E(x) = sum over n, j, t of g(n) W (G.w + D)^2 at x + n, g a Gaussian
neighbourhood of ``neighbourhood`` px (0: the pixel alone). With amplitudes a, a' of the
pair, the largest amplitude a_max of all responses and the frequency deviation d in
units of tau sigma_k (the greater of the two frames),

    W = p(t) C^8 A/(A + r^2) q^2/(1 + d^4),
    A = a a',  q = 2 a a'/(a^2 + a'^2),  r = max(fraction a_max, floor),
    p(t) = exp(-(t + 1/2 - index)^2 / 2 time_sigma^2)   where |t + 1/2 - index| <=
           3 time_sigma,
    C = share of the filter's window inside the picture (gabor.coverage).

A/(A + r^2) saturates: where there is contrast, more of it tells no more about the
motion. C^8 silences the margin, where the border rule and not the scene is filtered
(at an edge C = 1/2). ``passes`` times the system is solved again with W multiplied by
1/(1 + (residual/robust)^2)^2, residual of the own pixel's flow, ``robust`` in rad:
this drops wrapped phases and the lesser of two motions.

With M = sum g W G G^T and b = sum g W G D the flow is -M^-1 b, by the 2x2 cofactors.
lambda = least eigenvalue of M / (k0^2 sum_t p(t)) says how well the worse direction is
held; lambda < ``least_eigenvalue`` gives NaN (flat picture, or stripes of one
direction), never 0. A still textured picture gives exactly 0. Confidence in [0, 1]:

    lambda/(lambda + CONFIDENCE_EIGENVALUE) / (1 + rms^2/CONFIDENCE_RESIDUAL^2),

rms the weighted residual of the last pass in rad.

Units: frames of any brightness scale. Valid for |w| < 1/(2 f0) px/frame (half a
wavelength: 4.2 px at the default), beyond which phase wraps.

References: the constraint is that of D. J. Fleet, A. D. Jepson, Int. J. Comput. Vision
5 (1990) 77-104, doi:10.1007/BF00056772; local least squares: B. D. Lucas, T. Kanade,
Proc. IJCAI (1981) 674-679; the reweighting function: S. Geman, D. McClure, Bull. Int.
Statist. Inst. 52 (1987) 5-21.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .component_velocity import amplitude_floor, frequency_deviation
from .convolve import correlate_axis
from .gabor import coverage, gaussian, respond, wavevectors, window_sigma
from .phase_gradient import phase_step, spatial_gradient

Real = NDArray[np.float64]

COVERAGE_POWER = 8
NEIGHBOURHOOD_SUPPORT = 2.5  # of its sigma
TIME_SUPPORT = 3.0  # of time_sigma
CONFIDENCE_EIGENVALUE = 0.1
CONFIDENCE_RESIDUAL = 0.3  # rad


def frame_pairs(count: int, index: int, time_sigma: float) -> list[tuple[int, float]]:
    """Return (t, p(t)) of the pairs (t, t+1) that count."""
    if count < 2 or not 0 <= index < count:
        raise ValueError(
            f"index: expected 0..{count - 1} of at least 2 frames, got {index}"
        )
    pairs = []
    for t in range(count - 1):
        distance = abs(t + 0.5 - index)
        if distance <= max(0.5, TIME_SUPPORT * time_sigma):
            pairs.append((t, float(np.exp(-((distance / time_sigma) ** 2) / 2))))
    return pairs


def constraints(
    frames: Real,
    pairs: list[tuple[int, float]],
    bank: Real,
    sigma: float,
    support: float,
    fraction: float,
    tau: float,
    border: str,
) -> tuple[Real, Real, Real]:
    """W (K, H, W), G (K, H, W, 2) and D (K, H, W) of all K constraints."""
    used = sorted({s for t, _ in pairs for s in (t, t + 1)})
    responses = [
        {s: respond(frames[s], k, sigma, support, border) for s in used} for k in bank
    ]
    amplitudes = np.array([[np.abs(r) for r in of.values()] for of in responses])
    reference = amplitude_floor(frames[used], amplitudes, fraction) ** 2
    inside = coverage(frames.shape[1:], sigma, support) ** COVERAGE_POWER
    weights, slopes, steps = [], [], []
    for k, of in zip(bank, responses, strict=True):
        gradient = {s: spatial_gradient(r, k) for s, r in of.items()}
        deviation = {
            s: frequency_deviation(g, k, sigma) / tau for s, g in gradient.items()
        }
        for t, p in pairs:
            a, b = np.abs(of[t]), np.abs(of[t + 1])
            product, total = a * b, a**2 + b**2
            alike = 2 * product / np.where(total > 0, total, 1)
            d = np.maximum(deviation[t], deviation[t + 1])
            weight = p * inside * alike**2 / (1 + d**4)
            weight *= product / np.maximum(product + reference, np.finfo(float).tiny)
            slope = (gradient[t] + gradient[t + 1]) / 2
            known = np.isfinite(slope).all(-1) & np.isfinite(weight)
            weights.append(np.where(known, weight, 0.0))
            slopes.append(np.where(known[..., None], slope, 0.0))
            steps.append(phase_step(of[t], of[t + 1]))
    return np.array(weights), np.array(slopes), np.array(steps)


def neighbourhood_sum(maps: Real, sigma: float) -> Real:
    """Gaussian mean of (N, H, W) maps with unit-sum taps; sigma 0: unchanged."""
    if sigma == 0:
        return maps
    _, g = gaussian(sigma, int(np.ceil(NEIGHBOURHOOD_SUPPORT * sigma)))
    return correlate_axis(correlate_axis(maps, g, -1, "reflect"), g, -2, "reflect")


def solve(weight: Real, slope: Real, step: Real, sigma: float) -> tuple[Real, ...]:
    """Return u, v, least eigenvalue and mean squared residual of one pass."""
    gx, gy = slope[..., 0], slope[..., 1]
    terms = (gx * gx, gx * gy, gy * gy, gx * step, gy * step, step * step, 1.0)
    sums = np.array([(weight * term).sum(0) for term in terms])
    xx, xy, yy, xd, yd, dd, mass = neighbourhood_sum(sums, sigma)
    least = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)
    determinant = xx * yy - xy * xy
    solvable = (determinant > 0) & (least > 0)
    safe = np.where(solvable, determinant, 1.0)
    u = np.where(solvable, -(yy * xd - xy * yd) / safe + 0.0, np.nan)
    v = np.where(solvable, -(xx * yd - xy * xd) / safe + 0.0, np.nan)
    # At the minimum sum W (G.w + D)^2 = sum W D^2 + w.b.
    residual = np.maximum(dd + u * xd + v * yd, 0.0) / np.where(mass > 0, mass, 1.0)
    return u, v, least, residual


def least_squares(
    frames: Real,
    index: int,
    *,
    tuning_frequency: float = 0.12,
    bandwidth_octaves: float = 0.8,
    orientations: int = 6,
    support: float = 3.0,
    neighbourhood: float = 4.0,
    time_sigma: float = 1.5,
    amplitude_fraction: float = 0.02,
    tau: float = 1.25,
    robust: float = 0.5,
    passes: int = 2,
    least_eigenvalue: float = 1e-3,
    border: str = "replicate",
) -> tuple[Real, Real]:
    """Flow (H, W, 2), NaN = unknown, and confidence (H, W) of frames (T, H, W)."""
    bank = wavevectors(tuning_frequency, orientations)
    sigma = window_sigma(tuning_frequency, bandwidth_octaves)
    pairs = frame_pairs(len(frames), index, time_sigma)
    weight, slope, step = constraints(
        frames, pairs, bank, sigma, support, amplitude_fraction, tau, border
    )
    u, v, least, residual = solve(weight, slope, step, neighbourhood)
    for _ in range(passes):
        own = slope[..., 0] * u + slope[..., 1] * v + step
        # An unsolved pixel has no residual; its own constraints stay as they are.
        own = np.where(np.isfinite(own), own, 0.0)
        again = weight / (1 + (own / robust) ** 2) ** 2
        u, v, least, residual = solve(again, slope, step, neighbourhood)
    scale = (2 * np.pi * tuning_frequency) ** 2 * sum(p for _, p in pairs)
    held = least / scale
    known = np.isfinite(u) & (held >= least_eigenvalue)
    confidence = held / (held + CONFIDENCE_EIGENVALUE)
    confidence = confidence / (1 + residual / CONFIDENCE_RESIDUAL**2)
    flow = np.where(known[..., None], np.stack([u, v], -1), np.nan)
    return flow, np.where(known, confidence, 0.0)
