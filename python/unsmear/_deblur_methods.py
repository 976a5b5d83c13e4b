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

    Outcome = tuple[NDArray[Any], dict[str, Any]]

COPIED_SHARE_WORTH_A_WARNING = 0.5

MISMATCH_WORTH_A_WARNING = 1.03
"""Residual over noise: a right model overfits a little and stays below 1."""


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
    progress: Progress | None,
) -> Outcome:
    """Restore by "tv", "fast", "tikhonov" or "richardson-lucy"."""
    # Tikhonov's strength has no unit, that of total variation is an intensity.
    unit = 1.0 if method == "tikhonov" else channels.scale
    single = channels.array.itemsize == 4
    planes, report = (
        _unsmear.motion_deblur_f32 if single else _unsmear.motion_deblur_f64
    )(
        channels.array,
        channels.flow(flow),
        method,
        exposure,
        acceleration=(
            None
            if acceleration is None
            else channels.flow(acceleration, "acceleration")
        ),
        weights=None if weights is None else channels.weights(weights),
        noise=None if noise is None else float(noise) / channels.scale,
        regularization=None if regularization is None else float(regularization) / unit,
        progress=of_steps(progress),
    )
    report = {
        key: None if isinstance(value, float) and np.isnan(value) else value
        for key, value in report.items()
    }
    for key, scale in (
        ("noise", channels.scale),
        ("residual", channels.scale),
        ("regularization", unit),
    ):
        if report[key] is not None:
            report[key] *= scale
    mismatch = report["mismatch"]
    report["model_mismatch"] = bool(
        mismatch is not None and mismatch > MISMATCH_WORTH_A_WARNING
    )
    return planes, report


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
