"""From coded intensities to light and back: motion adds light, files hold codes.

``gamma=g`` is the law ``light = code^g``; ``"srgb"`` that of IEC 61966-2-1. Both are
continued to negative codes as odd functions, so that noise about black stays noise.
White is 1: integers come divided by their range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# IEC 61966-2-1:1999: a line near black, a shifted power above.
_LINE, _LINE_END, _SHIFT, _POWER = 12.92, 0.04045, 0.055, 2.4
_LEAST_LIGHT = 1e-6  # below every sensor's black; keeps slopes finite


@dataclass(frozen=True)
class Tone:
    """A coding of light; build it with `tone_of`."""

    gamma: float | None
    """The power; None: sRGB."""

    def light(self, code: NDArray[Any]) -> NDArray[Any]:
        """Return the light that ``code`` stands for, in the same precision."""
        size = np.abs(code)
        if self.gamma is not None:
            light = size**self.gamma
        else:
            upper = ((size + _SHIFT) / (1 + _SHIFT)) ** _POWER
            light = np.where(size <= _LINE_END, size / _LINE, upper)
        return np.asarray(np.copysign(light, code), code.dtype)

    def code(self, light: NDArray[Any]) -> NDArray[Any]:
        """Return the code of ``light``; the inverse of `light`."""
        size = np.abs(light)
        if self.gamma is not None:
            code = size ** (1 / self.gamma)
        else:
            upper = (1 + _SHIFT) * size ** (1 / _POWER) - _SHIFT
            code = np.where(size <= _LINE_END / _LINE, size * _LINE, upper)
        return np.asarray(np.copysign(code, light), light.dtype)

    def slope(self, code: NDArray[Any]) -> NDArray[np.float64]:
        """Return d light / d code."""
        size = np.abs(code).astype(np.float64)
        if self.gamma is not None:
            least = _LEAST_LIGHT ** (1 / self.gamma)
            return np.asarray(self.gamma * np.maximum(size, least) ** (self.gamma - 1))
        upper = ((size + _SHIFT) / (1 + _SHIFT)) ** (_POWER - 1) * _POWER / (1 + _SHIFT)
        return np.asarray(np.where(size <= _LINE_END, 1 / _LINE, upper))


def tone_of(gamma: float | str | None) -> Tone | None:
    """Return the coding that ``gamma`` names; None if the picture is light itself."""
    if gamma is None:
        return None
    if isinstance(gamma, str):
        if gamma != "srgb":
            raise ValueError(f"gamma must be a number > 0 or 'srgb', got {gamma!r}")
        return Tone(None)
    if not (np.isfinite(gamma) and gamma > 0):
        raise ValueError(f"gamma must be finite and positive, got {gamma}")
    return Tone(float(gamma))
