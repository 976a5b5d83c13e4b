"""Pictures in [0, 1] as a camera of 8 bits records them: noise, then rounding."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["in_eight_bits"]

_WHITE = 255.0


def in_eight_bits(
    exposed: NDArray[np.float64], noise: float = 0.0, seed: int = 0
) -> NDArray[np.uint8]:
    """Return ``exposed`` with noise of a standard deviation in grey levels."""
    if not 0 <= noise < math.inf:
        msg = f"noise must be >= 0 grey levels, got {noise}"
        raise ValueError(msg)
    levels = _WHITE * exposed
    if noise > 0:
        grain = np.random.default_rng(seed).normal(scale=noise, size=exposed.shape)
        levels = levels + grain
    return np.rint(np.clip(levels, 0, _WHITE)).astype(np.uint8)
