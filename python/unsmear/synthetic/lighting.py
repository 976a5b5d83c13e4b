r"""What lights a scene and what lies behind it: sun and sky."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.pose import Pose, placed, vector

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear.synthetic.surface import Surface

__all__ = ["Light", "Sky"]

_REST = placed()


@dataclass(frozen=True)
class Light:
    """A sun: parallel light that casts shadows, and light from everywhere.

    Brightness is the surface's times ``ambient + (1 - ambient) cos(angle)``, the second
    part only where no body is in the way (J. H. Lambert, 1760).

    Parameters
    ----------
    direction : array_like of shape (3,)
        Where the light goes; (0, 1, 0) shines straight down.
    ambient : float, default 0.4
        In [0, 1].
    """

    direction: ArrayLike
    ambient: float = 0.4

    def __post_init__(self) -> None:
        if not np.linalg.norm(vector(self.direction, "direction")) > 0:
            msg = "direction must not be 0, got (0, 0, 0)"
            raise ValueError(msg)
        if not 0 <= self.ambient <= 1:
            msg = f"ambient must be in [0, 1], got {self.ambient}"
            raise ValueError(msg)


@dataclass(frozen=True)
class Sky:
    """A pattern at infinity, which may drift, and change as clouds do.

    Parameters
    ----------
    surface : Surface
        By longitude and latitude in rad; its size too.
    pose : Pose
        Only the rotation counts: a spin about y is a drift along the horizon. Default:
        at rest.
    changed : Surface, optional
        What the pattern turns into. Default: it stays.
    change : float, default 0
        Share of ``changed`` that each frame after time 0 adds (before it, takes away).
    """

    surface: Surface
    pose: Pose = _REST
    changed: Surface | None = None
    change: float = 0.0

    def at(
        self,
        time: float,
        directions: NDArray[np.float64],
        footprint: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the brightness seen along the sky's own directions (N, 3)."""
        x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
        place = np.stack([np.arctan2(x, z), np.arcsin(np.clip(y, -1, 1))], axis=1)
        value = self.surface.at(place, footprint)
        if self.changed is not None:
            share = 0.5 + self.change * time
            value += share * (self.changed.at(place, footprint) - value)
        return value
