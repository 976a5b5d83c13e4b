"""Who is measured: our methods by name, and rivals of other libraries.

A contender takes frames and the index of one and returns the flow to the next. Rivals
are part of the package, not of the benches, so that an installed copy can repeat the
comparison; their libraries (``pip install "unsmear[bench]"``) are imported when one of
them runs. All run with their library's defaults and see what their interface takes:
two frames, grey.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import luma
from unsmear._parameters import PARAMETERS, merged, of_pairs
from unsmear.flow import optical_flow

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Flow = NDArray[np.float32]
    Rival = Callable[[NDArray[Any], NDArray[Any]], Flow]

__all__ = ["RIVALS", "Contender", "contender", "versions"]

# Frames used on each side of the reference; two-frame methods see it and the next.
_TWO_FRAMES: frozenset[str] = frozenset({"fast", "balanced", "accurate"})
_THREE_FRAMES: frozenset[str] = frozenset({"thesis"})
_DISTRIBUTIONS = ("opencv-contrib-python-headless", "opencv-contrib-python")


@dataclass(frozen=True)
class Contender:
    """A method and its parameters."""

    name: str
    method: str
    parameters: dict[str, Any] = field(default_factory=dict)

    def frames_of(self, count: int, index: int) -> tuple[slice, int]:
        """Return which of ``count`` frames it is given, and where ``index`` then is."""
        if self.method in RIVALS or self.method in _TWO_FRAMES:
            return slice(index, index + 2), 0
        if self.method in _THREE_FRAMES:
            first = max(index - 1, 0)
            return slice(first, index + 2), index - first
        return slice(0, count), index

    def flow(self, frames: NDArray[Any], index: int) -> Flow:
        """Return the flow (H, W, 2) from frame ``index`` of what it was given."""
        if self.method in RIVALS:
            return RIVALS[self.method](frames[index], frames[index + 1])
        axis = 3 if frames.ndim == 4 else None
        return optical_flow(
            frames,
            index=index,
            method=self.method,
            channel_axis=axis,
            **self.parameters,
        ).flow


def contender(text: str) -> Contender:
    """Return the contender called ``NAME`` or ``NAME:parameter=value,...``.

    Raises
    ------
    ValueError
        No such method, or parameters it does not have.
    """
    name, _, rest = text.partition(":")
    wanted = "method must look like NAME:parameter=value,..."
    parameters = of_pairs(filter(None, rest.split(",")), wanted)
    if name in RIVALS:
        if parameters:
            msg = f"method {name!r} is run with its library's defaults, got {text!r}"
            raise ValueError(msg)
    elif name in PARAMETERS:
        merged(name, parameters)
    else:
        known = ", ".join([*PARAMETERS, *RIVALS])
        msg = f"method must be one of {known}, got {name!r}"
        raise ValueError(msg)
    return Contender(text, name, parameters)


def versions(*, rivals: bool) -> dict[str, str]:
    """Return the versions of what is measured and of what it stands on."""
    names = ["unsmear", "numpy"] + (["scikit-image"] if rivals else [])
    found = {name: version(name) for name in names}
    for name in _DISTRIBUTIONS if rivals else ():
        try:
            found["opencv-contrib"] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _library(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        msg = f'rivals need more libraries: pip install "unsmear[bench]" ({error})'
        raise ImportError(msg) from error


def _grey(frame: NDArray[Any]) -> NDArray[Any]:
    grey = luma(frame.astype(np.float64)) if frame.ndim == 3 else frame
    return grey if frame.dtype != np.uint8 else np.rint(grey).astype(np.uint8)


def _opencv(create: Callable[[Any], Any]) -> Rival:
    def flow(first: NDArray[Any], second: NDArray[Any]) -> Flow:
        if first.dtype != np.uint8:
            msg = f"frames must be of 8 bit for OpenCV's methods, got {first.dtype}"
            raise ValueError(msg)
        cv2 = _library("cv2")
        cv2.setNumThreads(1)
        return np.asarray(create(cv2).calc(_grey(first), _grey(second), None))

    return flow


def _skimage(name: str) -> Rival:
    def flow(first: NDArray[Any], second: NDArray[Any]) -> Flow:
        registration = _library("skimage.registration")
        rows, columns = getattr(registration, name)(_grey(first), _grey(second))
        return np.stack([columns, rows], axis=-1).astype(np.float32)

    return flow


RIVALS: dict[str, Rival] = {
    "OpenCV DeepFlow": _opencv(lambda cv2: cv2.optflow.createOptFlow_DeepFlow()),
    "OpenCV DIS": _opencv(
        lambda cv2: cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    ),
    "OpenCV Farneback": _opencv(lambda cv2: cv2.FarnebackOpticalFlow_create()),
    "OpenCV TV-L1": _opencv(lambda cv2: cv2.optflow.DualTVL1OpticalFlow_create()),
    "scikit-image TV-L1": _skimage("optical_flow_tvl1"),
    "scikit-image iLK": _skimage("optical_flow_ilk"),
}
"""Methods of other libraries: (frame, next frame) -> flow."""
