"""The clip that comes with the package: blurred frames with their truth."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.flow_files import read_flow
from unsmear.sequences import read_frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["DemoClip", "demo_clip"]


@dataclass(frozen=True)
class DemoClip:
    """Five frames of a pan over a portrait, a disc crossing it.

    Attributes
    ----------
    blurred, sharp : ndarray of shape (5, 216, 288, 3), uint8
        Blurred over the whole frame interval, and at the middle of each exposure.
    flow : ndarray of shape (5, 216, 288, 2), float32
        True motion from each frame to the next, px, in steps of 1/64 px.
    exposure : float
        1: the shutter was open for the whole frame interval.
    """

    blurred: NDArray[Any]
    sharp: NDArray[Any]
    flow: NDArray[np.float32]
    exposure: float = 1.0


def demo_clip() -> DemoClip:
    """Return the bundled clip; its README names the photographers.

    Examples
    --------
    >>> import unsmear
    >>> unsmear.demo_clip().blurred.shape
    (5, 216, 288, 3)
    """
    with as_file(files("unsmear") / "data" / "demo") as folder:
        flows = sorted((folder / "flow").glob("*.png"))
        return DemoClip(
            blurred=read_frames(folder / "blurred"),
            sharp=read_frames(folder / "sharp"),
            flow=np.stack([read_flow(path) for path in flows]),
        )
