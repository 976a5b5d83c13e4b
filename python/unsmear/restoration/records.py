"""What goes into the chain and what comes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Planes = NDArray[np.float32]

__all__ = ["Alone", "Restored", "Settings"]


@dataclass(frozen=True)
class Settings:
    """What the user may set; see `unsmear.deblur_sequence`."""

    exposure: float | None
    noise: float | None
    flow_method: str
    flow_options: dict[str, Any]
    joint: int
    seed: int


@dataclass(frozen=True)
class Alone:
    """A frame restored by itself, before it is mixed with what came.

    Attributes
    ----------
    picture : ndarray of shape (C, H + 2 pad, W + 2 pad), float32
        Grey levels.
    pad : int
        Of the picture.
    strength : float
        lambda of total variation, grey levels.
    share : ndarray of shape (H, W), float32
        Of the restoration in the result.
    """

    picture: Planes
    pad: int
    strength: float
    share: Planes


@dataclass(frozen=True)
class Restored:
    """A restored frame and how it came about.

    Attributes
    ----------
    planes : ndarray of shape (C, H, W), float32
        Grey levels.
    changed : ndarray of shape (H, W), bool
        Where it differs from what came.
    ratio : float
        Of the verdict.
    report : dict
        Plain data.
    alone : Alone or None
        What a joint restoration starts from; None where nothing was restored.
    """

    planes: Planes
    changed: NDArray[np.bool_]
    ratio: float
    report: dict[str, Any]
    alone: Alone | None = None
