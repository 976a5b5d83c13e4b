"""The deblurring methods by name: from channels to restored channels and a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_real_array
from unsmear._progress import of_steps

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._channels import Channels
    from unsmear._progress import Progress
    from unsmear._tone import Tone

    Outcome = tuple[NDArray[Any], dict[str, Any]]

COPIED_SHARE_WORTH_A_WARNING = 0.5

MISMATCH_WORTH_A_WARNING = 1.0
"""Residual over noise, the operator's own error included: a right model stays below."""


def variational(
    channels: Channels,
    flow: ArrayLike,
    method: str,
    exposure: float,
    *,
    acceleration: ArrayLike | None,
    weights: ArrayLike | None,
    noise: float | None,
    regularization: float | None,
    tone: Tone | None,
    progress: Progress | None,
) -> Outcome:
    """Restore by "tv", "fast", "tikhonov" or "richardson-lucy"."""
    motion = channels.flow(flow)
    bend = None if acceleration is None else channels.flow(acceleration, "acceleration")
    known = None if weights is None else channels.weights(weights)
    planes, spread = channels.array, 1.0
    if noise is not None:
        noise = float(noise) / channels.scale
    ceiling = channels.ceiling
    if tone is not None:
        planes = tone.light(channels.array)
        slope = tone.slope(channels.array)
        spread = float(np.sqrt(np.nanmean(slope**2)))
        known = _believed_in_light(slope, spread, known)
        if noise is None:
            noise = noise_of(channels, motion, exposure)
        if ceiling is not None:
            ceiling = float(tone.light(np.asarray(ceiling)))
    # Units of the core's results in those of the picture that came. Tikhonov's strength
    # has no unit, that of total variation is an intensity.
    unit = channels.scale / spread
    strength_unit = 1.0 if method == "tikhonov" else unit
    single = channels.array.itemsize == 4
    function = _unsmear.motion_deblur_f32 if single else _unsmear.motion_deblur_f64
    restored, report = function(
        planes,
        motion,
        method,
        exposure,
        acceleration=bend,
        weights=known,
        noise=None if noise is None else noise * spread,
        regularization=(
            None if regularization is None else float(regularization) / strength_unit
        ),
        ceiling=ceiling,
        progress=of_steps(progress),
    )
    if tone is not None:
        # What was copied is copied bit for bit.
        restored = np.where(restored == planes, channels.array, tone.code(restored))
    return restored, _in_units(report, unit, strength_unit)


def noise_of(channels: Channels, motion: NDArray[Any], exposure: float) -> float:
    """Return the root mean square over channels of their noise, white being 1."""
    wide = motion.astype(np.float64)
    powers = [
        _unsmear.estimate_noise(plane, wide, exposure) ** 2
        for plane in channels.array.astype(np.float64)
    ]
    return float(np.sqrt(np.mean(powers)))


def _believed_in_light(
    slope: NDArray[np.float64], spread: float, weights: NDArray[np.float32] | None
) -> NDArray[np.float32]:
    """Return weights against noise that decoding made larger in bright pixels."""
    power = np.nan_to_num(np.mean(slope**2, axis=0), nan=spread**2)
    believed = np.asarray(np.minimum(1.0, spread**2 / power), np.float32)
    return believed if weights is None else believed * weights


def _in_units(
    report: dict[str, Any], unit: float, strength_unit: float
) -> dict[str, Any]:
    """Return the core's report in the units of the picture, None for what is not."""
    result: dict[str, Any] = {
        key: None if isinstance(value, float) and np.isnan(value) else value
        for key, value in report.items()
    }
    units = {"noise": unit, "residual": unit, "regularization": strength_unit}
    for key, scale in units.items():
        value = result[key]
        result[key] = None if value is None else value * scale
    mismatch = result["mismatch"]
    result["model_mismatch"] = (
        mismatch is not None and mismatch > MISMATCH_WORTH_A_WARNING
    )
    return result


def wiener(
    channels: Channels,
    flow: ArrayLike,
    exposure: float,
    noise: float | None,
    regularization: float | None,
    progress: Progress | None,
) -> Outcome:
    single = channels.array.itemsize == 4
    if regularization is not None:
        regularization = float(regularization)
    planes, report = (_unsmear.wiener_f32 if single else _unsmear.wiener_f64)(
        channels.array,
        channels.flow(flow),
        float(exposure),
        None if noise is None else float(noise) / channels.scale,
        regularization,
        of_steps(progress),
    )
    # From here on in the units of the picture that came.
    automatic = regularization is None
    report["noise"] = report["noise"] * channels.scale if automatic else None
    report["regularization"] = None if automatic else regularization
    return planes, report


def thesis(
    channels: Channels,
    flow: ArrayLike,
    exposure: float,
    degree: int,
    regularization: float,
    progress: Progress | None,
) -> Outcome:
    if not (np.isfinite(exposure) and exposure > 0):
        raise ValueError(f"exposure must be finite and positive, got {exposure}")
    if degree not in (1, 2, 3, 4):
        raise ValueError(f"degree must be 1, 2, 3 or 4, got {degree!r}")
    channels.flow(flow)  # checks the shape; angles need all the precision that came
    motion = exposure * np.asarray(as_real_array(flow, "flow")[0], np.float64)
    planes, unknown = [], 0
    for plane in channels.array.astype(np.float64):
        restored, unknown = _unsmear.thesis_deblur(
            plane,
            np.ascontiguousarray(motion),
            int(degree),
            regularization,
            of_steps(progress),
        )
        planes.append(restored)
    report = {
        "noise": None,
        "regularization": regularization,
        "degree": int(degree),
        "unknown_pixels": unknown,
    }
    return np.stack(planes), report


def warnings_of(report: dict[str, Any]) -> list[str]:
    """Say in words what a user should know before trusting the picture."""
    warnings = []
    if report["method"] == "thesis":
        warnings.append(
            "the founding method makes pictures worse and blackens their border; "
            "it is kept for reference"
        )
    if report.get("model_mismatch"):
        warnings.append(
            f"what the motion leaves unexplained is {report['mismatch']:.2f} times the "
            "noise: flow or exposure are wrong somewhere, and the picture was restored "
            "with more caution"
        )
    unknown = report["unknown_pixels"]
    if unknown > COPIED_SHARE_WORTH_A_WARNING * report["pixels"]:
        warnings.append(
            f"{unknown} of {report['pixels']} pixels have unknown motion and were "
            "copied"
        )
    if report.get("too_long_pixels", 0):
        warnings.append(
            f"{report['too_long_pixels']} pixels are blurred too long to be restored "
            "and were copied"
        )
    return warnings
