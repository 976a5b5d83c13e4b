"""What the solver takes: a recorded picture, the paths of its light, its weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from unsmear import _unsmear

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Look", "cropped", "limited_squares", "look", "robust_scale", "walk"]

WALK = (0.015, 0.045, 0.13, 0.4)
"""Strengths of the prior that are compared, grey levels."""

TWIN = 1
"""Which of them makes the restorations that frames are compared with."""

FIRST = (4, 12)
"""Turns and steps of a restoration that starts from half size."""

SHARP_STRENGTH = 1.4
"""Strength of the sharper prior, relative to that of total variation."""

SPLINE, LINES = "spline", "cubic"
"""Taps of the operators: along paths of up to 8 px an interpolating spline, in
up to twice the time; or line by line, which damps the finest detail."""

NEXT = (3, 12)
"""Turns and steps of one that starts from another of nearly the same strength."""

GREATEST_ERROR = 20.0
"""Grey levels beyond which samples do not differ more: another scene, not an error."""


class Look(TypedDict):
    """A recorded picture (C, H, W) in grey levels and the paths of its light."""

    planes: NDArray[np.float32]
    weights: NDArray[np.float32]
    velocity: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    offset: NDArray[np.float32] | None
    exposure: float
    ceiling: float | None
    taps: str


def look(
    planes: NDArray[np.float32],
    velocity: NDArray[np.float32],
    acceleration: NDArray[np.float32],
    exposure: float,
    weights: NDArray[np.float32],
    offset: NDArray[np.float32] | None = None,
    ceiling: float | None = None,
    taps: str = SPLINE,
) -> Look:
    """Return one look; unknown motion and offset are not believed."""
    known = np.isfinite(velocity).all(axis=-1)
    if offset is not None:
        known &= np.isfinite(offset).all(axis=-1)
        offset = np.ascontiguousarray(np.nan_to_num(offset), np.float32)
    return {
        "planes": np.ascontiguousarray(planes, np.float32),
        "weights": np.ascontiguousarray(np.where(known, weights, 0), np.float32),
        "velocity": np.ascontiguousarray(np.nan_to_num(velocity), np.float32),
        "acceleration": np.ascontiguousarray(np.nan_to_num(acceleration), np.float32),
        "offset": offset,
        "exposure": float(exposure),
        "ceiling": ceiling,
        "taps": taps,
    }


def robust_scale(noise: float) -> float:
    """Return Cauchy's scale for noise of standard deviation ``noise``, grey levels."""
    return 3.0 * max(noise, 0.7)


def walk(
    looks: list[Look],
    lambdas: tuple[float, ...],
    noise: float,
    *,
    pad: int | None = None,
    first: tuple[int, int] = FIRST,
    start: NDArray[np.float32] | None = None,
    sharp: bool = False,
) -> tuple[list[NDArray[np.float32]], int]:
    """Return the padded restorations (C, H + 2 pad, W + 2 pad), and the padding."""
    if pad is None:
        pad = _unsmear.looks_reach(looks)
    pictures, _ = _unsmear.restore_looks(
        looks,
        pad,
        list(lambdas),
        noise,
        robust_scale(noise),
        first,
        NEXT,
        sharp,
        start,
    )
    return pictures, pad


def limited_squares(
    difference: NDArray[np.float32], unknown: float
) -> NDArray[np.float64]:
    """Return squares as the mean of the channels (C, H, W), limited; (H, W).

    ``unknown`` grey levels are what NaN differs by.
    """
    mean = (difference**2).mean(axis=0, dtype=np.float64)
    known = np.nan_to_num(mean, nan=unknown**2)
    return np.asarray(np.minimum(known, GREATEST_ERROR**2))


def cropped(picture: NDArray[np.float32], pad: int) -> NDArray[np.float32]:
    """Return a padded picture (C, H + 2 pad, W + 2 pad) without its padding."""
    inner = slice(pad, -pad) if pad else slice(None)
    return np.ascontiguousarray(picture[:, inner, inner])
