r"""Flow of Fleet and Jepson: velocity-tuned filters, local affine least squares.

Each of the 22 filters of gabor.velocity_tuned_wavevectors gives at the reference frame
a phase gradient (phi_x, phi_y, phi_t) and, where the amplitude and frequency tests of
component_velocity hold, one constraint on the flow (u, v) px/frame. Written with the
unit normal n = grad phi / |grad phi| and the normal speed s = v_n.n px/frame:

    n.w(x + d) = s(x + d),   w(x + d) = (u + u_x dx + u_y dy, v + v_x dx + v_y dy).

Over the (2 r + 1)^2 window, weights W = A^2/(A^2 + (3 a_0)^2), A the amplitude and a_0
the amplitude threshold, the six unknowns p = (u, u_x, u_y, v, v_x, v_y) solve M p = b,

    M = sum W [n_i n_j] (x) [z z^T],  b = sum W s [n_i] (x) z,  z = (1, dx, dy)/scale,

with dx, dy divided by their rms over the window so that M has no units. All sums are
window moments of five maps (W nx nx, W nx ny, W ny ny, W s nx, W s ny). A result stands
where

    constraints           >= least_constraints in the window,
    condition             tr(M) tr(M^-1) / 36 <= condition_limit,
    residual              sqrt((sum W s^2 - p.b) / sum W) <= residual_limit px/frame,

else NaN. tr(M) tr(M^-1)/36 is the arithmetic over the harmonic mean of M's eigenvalues:
1 when all directions are held alike; unlike the ratio of extreme eigenvalues it comes
from a Cholesky factor. Confidence in [0, 1], 0 where NaN:

    (1 - residual/residual_limit) (1 - (condition - 1)/(condition_limit - 1)).

Speeds 0..about 5 px/frame at 4.25 px wavelength, and motion steady over the window in
time (15 frames at the default; fewer widen the filters in omega). A still textured
picture gives exactly 0: only the carriers at rest pass the frequency test, for
tau < sin(30 deg) k0 sigma = 1.85.

References: D. J. Fleet, A. D. Jepson, Int. J. Comput. Vision 5 (1990) 77-104,
doi:10.1007/BF00056772 (filters, tests, affine model); J. L. Barron, D. J. Fleet, S. S.
Beauchemin, Int. J. Comput. Vision 12 (1994) 43-77, doi:10.1007/BF01420984 (parameters
of the program). Different here: saturating amplitude weights, and the trace form of the
condition number.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from .component_velocity import (
    amplitude_floor,
    component_velocity,
    frequency_deviation,
)
from .convolve import correlate_axis
from .gabor import respond, respond_in_time, velocity_tuned_wavevectors, window_sigma
from .phase_gradient import spatial_gradient, time_slope

Real = NDArray[np.float64]

AFFINE = ((0, 0), (1, 0), (0, 1))  # powers of (dx, dy) of one flow component
WEIGHT_HALF = 3.0  # amplitude of half weight, in units of the threshold


def components(
    frames: Real,
    index: int,
    tuning_frequency: float,
    bandwidth_octaves: float,
    support: float,
    border: str,
) -> tuple[Real, Real, Real, float]:
    """Phase gradients (22, H, W, 3), amplitudes, centres (22, 3) and sigma."""
    bank = velocity_tuned_wavevectors(tuning_frequency)
    sigma = window_sigma(tuning_frequency, bandwidth_octaves)
    # Time first: the filters share three carriers in time, and the border rule in space
    # commutes with sums over frames, so only one frame per filter is left for space.
    in_time = {
        omega: np.stack(respond_in_time(frames, index, omega, sigma, support))
        for omega in set(bank[:, 2].tolist())
    }
    gradients, amplitudes = [], []
    for centre in bank:
        omega = float(centre[2])
        response, slope = respond(in_time[omega], centre[:2], sigma, support, border)
        gradient = np.empty((*response.shape, 3))
        gradient[..., :2] = spatial_gradient(response, centre[:2])
        gradient[..., 2] = time_slope(response, slope, omega)
        gradients.append(gradient)
        amplitudes.append(np.abs(response))
    return np.array(gradients), np.array(amplitudes), bank, sigma


def window_moments(maps: Real, radius: int) -> dict[tuple[int, int], Real]:
    """Sums of (N, H, W) maps times (dx/s)^p (dy/s)^q, p + q <= 2, s the rms offset."""
    offsets = np.arange(-radius, radius + 1, dtype=np.float64)
    scaled = offsets / max(np.sqrt((offsets**2).mean()), 1.0)
    return {
        (p, q): correlate_axis(
            correlate_axis(maps, scaled**p, -1, "zero"), scaled**q, -2, "zero"
        )
        for p, q in product(range(3), repeat=2)
        if p + q <= 2
    }


def solve_affine(
    weight: Real, normal: Real, speed: Real, radius: int
) -> tuple[Real, Real, Real, Real]:
    """Flow (H, W, 2), condition, residual and constraint count of every window."""
    nx, ny = normal[..., 0], normal[..., 1]
    terms = (nx * nx, nx * ny, ny * ny, nx * speed, ny * speed, speed**2, 1.0)
    maps = [(weight * term).sum(0) for term in terms] + [(weight > 0).sum(0)]
    moments = window_moments(np.array(maps, dtype=np.float64), radius)
    height, width = weight.shape[1:]
    matrix = np.zeros((height, width, 6, 6))
    vector = np.zeros((height, width, 6))
    for i, (pi, qi) in enumerate(AFFINE):
        for j, (pj, qj) in enumerate(AFFINE):
            xx, xy, yy = moments[pi + pj, qi + qj][:3]
            matrix[..., i, j], matrix[..., i + 3, j + 3] = xx, yy
            matrix[..., i, j + 3] = matrix[..., i + 3, j] = xy
        vector[..., i], vector[..., i + 3] = moments[pi, qi][3:5]
    squares, mass, count = moments[0, 0][5:]
    least = np.linalg.eigvalsh(matrix)[..., 0]
    trace = np.trace(matrix, axis1=-2, axis2=-1)
    # Beyond this the inverse is rounding; any sensible limit is far stricter.
    solvable = least > 1e-9 * trace
    inverse = np.linalg.inv(np.where(solvable[..., None, None], matrix, np.eye(6)))
    unknowns = (inverse @ vector[..., None])[..., 0]
    squared = np.maximum(squares - (unknowns * vector).sum(-1), 0.0)
    residual = np.sqrt(squared / np.where(mass > 0, mass, 1.0))
    condition = trace * np.trace(inverse, axis1=-2, axis2=-1) / 36
    flow = np.where(solvable[..., None], unknowns[..., [0, 3]] + 0.0, np.nan)
    return flow, np.where(solvable, condition, np.inf), residual, count


def fleet_jepson(
    frames: Real,
    index: int,
    *,
    tuning_frequency: float = 1 / 4.25,
    bandwidth_octaves: float = 0.8,
    support: float = 3.0,
    amplitude_fraction: float = 0.05,
    tau: float = 1.25,
    window_radius: int = 2,
    least_constraints: int = 12,
    condition_limit: float = 8.0,
    residual_limit: float = 0.05,
    border: str = "replicate",
) -> tuple[Real, Real]:
    """Flow (H, W, 2), NaN = unknown, and confidence (H, W) of frames (T, H, W)."""
    gradient, amplitude, bank, sigma = components(
        frames, index, tuning_frequency, bandwidth_octaves, support, border
    )
    threshold = amplitude_floor(frames, amplitude, amplitude_fraction)
    deviation = np.array(
        [frequency_deviation(g, k, sigma) for g, k in zip(gradient, bank, strict=True)]
    )
    valid = (amplitude >= threshold) & (deviation <= tau)
    velocity = component_velocity(gradient, valid)
    used: NDArray[np.bool_] = np.asarray(np.isfinite(velocity).all(-1))
    normal = np.where(used[..., None], gradient[..., :2], 1.0)
    normal = normal / np.sqrt((normal**2).sum(-1, keepdims=True))
    speed = (np.where(used[..., None], velocity, 0.0) * normal).sum(-1)
    half = (WEIGHT_HALF * threshold) ** 2
    weight = np.where(used, amplitude**2, 0.0) / (amplitude**2 + half + (half == 0))
    flow, condition, residual, count = solve_affine(
        weight, normal, speed, window_radius
    )
    known = (
        np.isfinite(flow).all(-1)
        & (count >= least_constraints)
        & (condition <= condition_limit)
        & (residual <= residual_limit)
    )
    sure = 1 - residual / residual_limit
    held = 1 - (np.where(known, condition, 1.0) - 1) / (condition_limit - 1)
    confidence = np.clip(np.where(known, sure * held, 0.0), 0.0, 1.0)
    return np.where(known[..., None], flow, np.nan), confidence
