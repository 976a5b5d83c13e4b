"""The motion that a picture is restored with: what was told, and what its blur says.

A flow from another camera, another idea of the axes or a compass may run beside the
blur by one angle for the whole picture, or be of another length: the dark lines of the
picture's spectrum show both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import as_real_array
from unsmear.exposure import estimate_exposure, estimate_turn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear.exposure import ExposureEstimate


@dataclass(frozen=True)
class MotionFound:
    """Velocity and acceleration, turned where need be, and what was found of them."""

    flow: ArrayLike
    acceleration: ArrayLike | None
    exposure: float
    turn: float
    found: ExposureEstimate | None
    turn_found: float

    def warnings(self) -> list[str]:
        """Say in words what is not as it was told, or not sure."""
        warnings = []
        if self.turn_found != 0:
            warnings.append(
                f"the blur runs {self.turn_found:+.1f} degrees (from right to down) "
                "beside the flow, which was turned by that; turn=0 takes it as it is"
            )
        if self.found is not None and self.found.status != "ok":
            warnings.append(
                "the exposure could not be found with certainty "
                f"({self.found.status}): {self.exposure:.2f} was assumed"
            )
        return warnings


def motion_found(
    image: ArrayLike,
    flow: ArrayLike,
    acceleration: ArrayLike | None,
    *,
    exposure: float | None,
    turn: float | None,
    noise: float | None,
    channel_axis: int | None,
) -> MotionFound:
    """Return the motion to restore ``image`` with; None is found in its blur."""
    told = 0.0 if turn is None else turn
    motion, bend = turned(flow, told), acceleration
    if acceleration is not None:
        bend = turned(acceleration, told, "acceleration")
    about: dict[str, Any] = {"acceleration": bend, "noise": noise}
    about["channel_axis"] = channel_axis
    found, more = None, 0.0
    if exposure is None:
        found = estimate_exposure(image, motion, turn=turn is None, **about)
        exposure, more = found.value, found.turn
    elif turn is None and np.size(flow):
        more = estimate_turn(image, motion, exposure, **about)
    if more != 0:
        motion = turned(flow, more)
        if acceleration is not None:
            bend = turned(acceleration, more, "acceleration")
    return MotionFound(motion, bend, exposure, told + more, found, more)


def turned(field: ArrayLike, degrees: float, argument: str = "flow") -> ArrayLike:
    """Return vectors (H, W, 2) turned from right to down; by nothing, as they came."""
    if degrees == 0:
        return field
    array, _ = as_real_array(field, argument)
    angle = np.deg2rad(degrees)
    cos, sin = np.cos(angle), np.sin(angle)
    u, v = array[..., 0].astype(np.float64), array[..., 1].astype(np.float64)
    both: NDArray[np.float64] = np.stack([cos * u - sin * v, sin * u + cos * v], -1)
    return both if array.dtype.kind != "f" else both.astype(array.dtype)
