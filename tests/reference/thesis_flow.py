"""Optical flow of the founding method, stage by stage, in vectorised NumPy.

C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT MEng thesis, 2007,
chapter 4 and appendix D.1; the phase gradient is that of Fleet and Jepson, 1990,
doi 10.1007/BF00056772. Reproduced with its flaws, because it is the yardstick:
sigma lacks a 2 pi, the mean of normal velocities halves the speed, and the time
filter and derivative take frames beyond the ends as zero.

Frames (T, H, W) on any intensity scale; x right, y down, velocities px/frame; the
filter angle w alone has y up. f0 in cycles/px, beta in octaves:

    sigma = (2^beta + 1) / (f0 (2^beta - 1))                                  px
    g = exp(2 pi i f0 (x cos w + y sin w)) exp(-(x^2 + y^2) / 2 sigma^2)
        on a disc of radius round(sigma), unit sum, then only the DFT bins closer
        than ceil(W / sigma) to the tuning frequency                          (H, W)
    R = (I * g) * unit-sum Gaussian over all frames                  (T, H, W)
    grad phi = Im(conj(R) grad R) / |R|^2                            rad/px, rad/frame
    (un, vn) = -phi_t (phi_x, phi_y) / (phi_x^2 + phi_y^2)
    (Vx, Vy) = gated mean over filters, then over frames.

Gate, for x and y apart: with mean and N - 1 standard deviation taken over all values,
NaN counting as 0, drop where std > limit and |value - mean| > 2 std; NaN where fewer
than 10/12 of the values remain. NaN = unknown throughout (R = 0 has no phase).

Where the listing is defined for even sizes only, odd ones keep its formulas
(the filter's zero of y then lies one row below the middle, its disc half way between
pixels) and round the cropping indices down; frequency bins beyond the spectrum, an
indexing error in the listing, are dropped.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
ZeroStatic = Literal["none", "velocity", "image+velocity"]


def round_half_away(value: float) -> int:
    """Round to the nearest integer, halves away from zero, as MATLAB does."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def moving_pixels(frames: Real) -> NDArray[np.bool_]:
    """Tell where the central time difference is not 0 in every frame, (H, W)."""
    return np.asarray(np.abs(np.gradient(frames, axis=0)).sum(axis=0) > 0.0)


def upsample_linear(array: Real, times: int) -> Real:
    """Halve the spacing of the last two axes ``times`` times: n -> 2n - 1 samples."""
    for _ in range(times):
        *rest, height, width = array.shape
        rows = np.empty((*rest, 2 * height - 1, width))
        rows[..., ::2, :] = array
        rows[..., 1::2, :] = (array[..., 1:, :] + array[..., :-1, :]) / 2.0
        array = np.empty((*rest, 2 * height - 1, 2 * width - 1))
        array[..., ::2] = rows
        array[..., 1::2] = (rows[..., 1:] + rows[..., :-1]) / 2.0
    return array


def upsample_frames(frames: Real) -> Real:
    """Upsample (T, H, W) to (T, 2H, 2W); the last row and column stay 0."""
    count, height, width = frames.shape
    result = np.zeros((count, 2 * height, 2 * width))
    result[:, :-1, :-1] = upsample_linear(frames, 1)
    return result


def filter_sigma(f0: float, beta: float) -> float:
    """Width of the Gaussian window, px (and frames)."""
    octaves = math.pow(2.0, beta)
    return 1.0 / (f0 * (octaves - 1.0) / (octaves + 1.0))


def filter_angles(f0: float, sigma: float) -> Real:
    """Filter angles over the full circle, degrees, (N,)."""
    spacing = 2.0 * math.degrees(math.atan(1.0 / (sigma * f0)))
    count = math.floor(360.0 / spacing)
    return np.arange(count, dtype=np.float64) * (360.0 / count)


def centred_range(length: int) -> Real:
    """Return -n/2+1 .. n/2 for even n, -(n-1)/2 .. (n-1)/2 for odd n."""
    return np.arange(length, dtype=np.float64) - (length - 1) // 2


def spatial_kernel(
    shape: tuple[int, int], f0: float, sigma: float, angle: float
) -> Complex:
    """Gabor kernel on a disc, unit complex sum, before its spectrum is trimmed."""
    height, width = shape
    x, y = centred_range(width), 1.0 - centred_range(height)
    w = math.radians(angle)

    def factor(position: Real, direction: float) -> Complex:
        phase = 2.0 * math.pi * f0 * direction * position
        return np.exp(-(position**2) / (2.0 * sigma**2) + 1j * phase)

    kernel = np.outer(factor(y, math.sin(w)), factor(x, math.cos(w)))
    row = np.arange(height)[:, None] - height / 2.0
    column = np.arange(width)[None, :] - (width / 2.0 - 1.0)
    kernel[np.hypot(row, column) >= round_half_away(sigma)] = 0.0
    return np.asarray(kernel / kernel.sum())


def frequency_mask(
    shape: tuple[int, int], f0: float, sigma: float, angle: float
) -> NDArray[np.bool_]:
    """Bins (zero frequency in the middle) close enough to the tuning frequency."""
    height, width = shape
    w = math.radians(angle)
    row = math.ceil(height / 2 + 1) - round_half_away(height * f0 * math.sin(w)) - 1
    column = math.floor(width / 2 + 1) + round_half_away(width * f0 * math.cos(w)) - 1
    dy, dx = np.arange(height)[:, None] - row, np.arange(width)[None, :] - column
    return np.asarray(np.hypot(dy, dx) < math.ceil(width / sigma))


def trim_spectrum(kernel: Complex, mask: NDArray[np.bool_]) -> Complex:
    """Keep only the masked bins of a kernel's DFT."""
    return np.fft.ifft2(np.fft.fft2(kernel) * np.fft.ifftshift(mask))


def temporal_taps(count: int, sigma: float) -> Real:
    """Unit-sum Gaussian taps as long as the sequence, (T,)."""
    taps = np.exp(-(centred_range(count) ** 2) / (2.0 * sigma**2))
    return np.asarray(taps / taps.sum())


def frame_spectra(frames: Real) -> Complex:
    """DFT of the frames, zero-padded to (T, 2H, 2W); shared by all filters."""
    _, height, width = frames.shape
    return np.fft.fft2(frames, (2 * height, 2 * width))


def filter_in_space(spectra: Complex, kernel: Complex) -> Complex:
    """Convolve every frame with the kernel, (T, H, W).

    The part kept starts at row H/2, column W/2 of the full convolution. As the
    kernel's middle is (H/2, W/2 - 1) this moves the response by one column.
    """
    height, width = kernel.shape
    top, left = height // 2, width // 2
    # Axis by axis, so that empty rows are not transformed and unused ones dropped.
    spectrum = np.fft.fft(np.fft.fft(kernel, 2 * width, axis=1), 2 * height, axis=0)
    columns = np.fft.ifft(spectra * spectrum, axis=1)[:, top : top + height]
    return np.fft.ifft(columns, axis=2)[:, :, left : left + width]


def filter_in_time(response: Complex, taps: Real) -> Complex:
    """'Same' convolution along the frames, zero beyond both ends."""
    count = len(response)
    lag = np.arange(count)[:, None] - np.arange(count)[None, :] + taps.size // 2
    inside = (lag >= 0) & (lag < taps.size)
    matrix = np.where(inside, taps[np.clip(lag, 0, taps.size - 1)], 0.0)
    return np.tensordot(matrix.astype(response.dtype), response, 1)


def differentiate(array: Complex, axis: int) -> Complex:
    """Five-tap derivative (-1 8 0 -8 1)/12, zero beyond both ends."""
    a = np.moveaxis(array, axis, 0)
    slope = np.zeros_like(array)
    d = np.moveaxis(slope, axis, 0)
    near, far = a * (8.0 / 12.0), a / 12.0
    d[:-1] += near[1:]
    d[1:] -= near[:-1]
    d[:-2] -= far[2:]
    d[2:] += far[:-2]
    return slope


def phase_gradient(response: Complex) -> tuple[Real, Real, Real]:
    """(phi_x, phi_y, phi_t), each (T, H, W): rad/px, rad/px, rad/frame."""
    power = response.real**2 + response.imag**2

    def along(axis: int) -> Real:
        slope = differentiate(response, axis)
        cross = response.real * slope.imag - response.imag * slope.real
        return np.asarray(cross / power)

    with np.errstate(divide="ignore", invalid="ignore"):
        return along(2), along(1), along(0)


def component_velocity(phi_x: Real, phi_y: Real, phi_t: Real) -> tuple[Real, Real]:
    """Velocity along the phase gradient, px/frame."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        scale = -phi_t / (phi_x**2 + phi_y**2)
        return scale * phi_x, scale * phi_y


def gate(values: Real, axis: int, std_limit: float, distance_limit: float) -> Real:
    """Replace outliers along an axis by NaN."""
    filled = np.where(np.isnan(values), 0.0, values)
    with np.errstate(divide="ignore", invalid="ignore"):
        # One sample has no spread; the listing's std is 0 there.
        ddof = min(1, values.shape[axis] - 1)
        std = filled.std(axis=axis, ddof=ddof, keepdims=True)
        distance = np.abs(values - filled.mean(axis=axis, keepdims=True)) / std
        outlier = (distance > distance_limit) & (std > std_limit)
    return np.where(outlier, np.nan, values)


def mean_of_rest(gated: Real, axis: int, least_fraction: float) -> Real:
    """Mean of what the gate left; NaN where that is too little."""
    count = np.sum(~np.isnan(gated), axis=axis)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.nansum(gated, axis=axis) / count
    return np.where(count < gated.shape[axis] * least_fraction, np.nan, mean)


def combine(components: Real, limits: tuple[float, float], least: float) -> Real:
    """Reduce (N, T, H, W) components to (H, W): over filters, then frames."""
    over_filters = mean_of_rest(gate(components, 0, *limits), 0, least)
    return mean_of_rest(gate(over_filters, 0, *limits), 0, least)


def all_components(frames: Real, f0: float, beta: float) -> tuple[Real, Real]:
    """Component velocities of every filter, two arrays (N, T, H, W)."""
    shape = (frames.shape[1], frames.shape[2])
    sigma = filter_sigma(f0, beta)
    angles = filter_angles(f0, sigma)
    taps = temporal_taps(len(frames), sigma)
    spectra = frame_spectra(frames)
    un, vn = np.empty((2, angles.size, *frames.shape))
    for n, angle in enumerate(angles):
        kernel = trim_spectrum(
            spatial_kernel(shape, f0, sigma, angle),
            frequency_mask(shape, f0, sigma, angle),
        )
        response = filter_in_time(filter_in_space(spectra, kernel), taps)
        un[n], vn[n] = component_velocity(*phase_gradient(response))
    return un, vn


def flow(
    frames_thw: ArrayLike,
    tuning_frequency: float = 0.06,
    bandwidth_octaves: float = 0.8,
    zero_static: ZeroStatic = "none",
    interpolate: bool = False,
    std_limit: float = 5.0,
    distance_limit: float = 2.0,
    least_fraction: float = 10 / 12,
) -> tuple[Real, Real]:
    """Return (Vx, Vy), each (H, W), of frames (T, H, W), T >= 2; NaN = unknown.

    ``interpolate`` doubles the picture first and, as the listing does, leaves the
    velocities in half pixels.
    """
    frames = np.asarray(frames_thw, dtype=np.float64)
    if frames.ndim != 3 or len(frames) < 2:
        raise ValueError(f"frames_thw: expected (T >= 2, H, W), got {frames.shape}")
    if zero_static not in ("none", "velocity", "image+velocity"):
        raise ValueError(f"zero_static: expected a known rule, got {zero_static!r}")
    moving = moving_pixels(frames)
    if zero_static == "image+velocity":
        frames = frames * moving
    f0 = tuning_frequency
    if interpolate:
        frames, f0 = upsample_frames(frames), f0 / 2.0
    components: tuple[Any, Any] = all_components(frames, f0, bandwidth_octaves)
    if interpolate:
        components = tuple(c[..., ::2, ::2] for c in components)
    if zero_static != "none":
        # In place of NaN too the product is NaN, as in the listing.
        components = tuple(c * moving for c in components)
    limits = (std_limit, distance_limit)
    vx, vy = (combine(c, limits, least_fraction) for c in components)
    return vx, vy
