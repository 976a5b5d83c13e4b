"""Levels of the pyramid, seen from outside: nothing shifts between them."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from textures import moving_texture


@pytest.mark.parametrize("factor", [0.5, 0.6, 0.75, 0.9])
@pytest.mark.parametrize("size", [(64, 64), (61, 83)])
def test_levels_are_centred_on_each_other(factor: float, size: tuple[int, int]) -> None:
    # Were a level displaced against the next, the enlarged flow of a zoom would be too:
    # half a pixel of displacement is 0.02 px of flow at this rate.
    rate = 0.04
    height, width = size
    y, x = np.mgrid[:height, :width]
    u, v = rate * (x - (width - 1) / 2), rate * (y - (height - 1) / 2)
    first = moving_texture((0, 0), (1, *size), waves=120, band=(0.1, 1.5))[0]
    second = unsmear_warp(first, u, v)
    found = unsmear.optical_flow(
        np.stack([first, second]), pyramid_factor=factor, warps=3, finest_warps=3
    ).flow
    middle = (slice(12, -12), slice(12, -12))
    assert abs(np.mean((found[..., 0] - u)[middle])) < 0.01
    assert abs(np.mean((found[..., 1] - v)[middle])) < 0.01
    assert np.mean(np.hypot(found[..., 0] - u, found[..., 1] - v)[middle]) < 0.06


def unsmear_warp(first: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The frame that a zoom by 1 + rate about the centre makes of ``first``."""
    from scipy.ndimage import map_coordinates

    height, width = first.shape
    y, x = np.mgrid[:height, :width].astype(float)
    rate = 1 + (u[0, -1] - u[0, 0]) / (width - 1)
    back_x = (x - (width - 1) / 2) / rate + (width - 1) / 2
    back_y = (y - (height - 1) / 2) / rate + (height - 1) / 2
    assert v[-1, 0] > 0
    return map_coordinates(first, [back_y, back_x], order=5, mode="mirror")
