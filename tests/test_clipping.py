"""Clipped samples: light brighter than white, or white that was white."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from unsmear import synthetic
from unsmear.restoration.clipping import brighter_than_white
from unsmear.restoration.looks import TWIN, WALK, Look, look, walk

SHAPE = (96, 112)
SPEED = (6.0, 2.5)
WHITE = 255.0


def scene(brightness: float) -> NDArray[np.float64]:
    """Return a texture with lights of ``brightness`` times white."""
    picture = 0.15 + 0.6 * synthetic.texture((220, 240), seed=8, exponent=1.2)
    for y in range(12, 210, 24):
        for x in range(10 + y % 48, 230, 48):
            picture[y : y + 7, x : x + 15] = brightness
    return picture


def clip(brightness: float, speed: tuple[float, float] = SPEED) -> synthetic.Sequence:
    """Return blurred frames, clipped after the blur, with a truth clipped likewise."""
    return synthetic.translation(
        scene(brightness),
        speed,
        shape=SHAPE,
        exposure=1.0,
        n_frames=3,
        noise=1.0,
        bits=8,
        seed=1,
    )


def restored(
    frame: NDArray[Any], speed: tuple[float, float], ceiling: float | None
) -> tuple[Look, NDArray[np.float32], int]:
    velocity = np.full((*SHAPE, 2), speed, np.float32)
    own = look(
        frame[np.newaxis].astype(np.float32),
        velocity,
        np.zeros_like(velocity),
        1.0,
        np.ones(SHAPE, np.float32),
        ceiling=ceiling,
    )
    pictures, pad = walk([own], WALK[: TWIN + 1], 1.0)
    return own, pictures[TWIN], pad


@pytest.mark.parametrize(
    ("brightness", "expected"), [(1.0, False), (1.25, True), (2.0, True)]
)
def test_lights_are_told_from_white(brightness: float, expected: bool) -> None:
    found = restored(clip(brightness).blurred[1], SPEED, WHITE - 0.5)
    assert brighter_than_white(*found) is expected


def test_means_of_clipped_frames_are_white() -> None:
    """Clipped before the blur: no sample of the mean was brighter than it says."""
    step = (SPEED[0] / 9, SPEED[1] / 9)
    made = synthetic.translation(scene(1.25), step, shape=SHAPE, n_frames=9, bits=8)
    mean = np.rint(made.sharp.mean(axis=0))
    assert (mean == WHITE).sum() > 100
    assert not brighter_than_white(*restored(mean, SPEED, WHITE - 0.5))


def test_what_cannot_be_told_stays_possible() -> None:
    short = (0.8, 0.4)
    white = clip(1.0, short).blurred[1]
    assert brighter_than_white(*restored(white, short, WHITE - 0.5))
    dark = np.minimum(clip(1.0).blurred[1], 200)
    assert brighter_than_white(*restored(dark, SPEED, WHITE - 0.5))
    assert not brighter_than_white(*restored(dark, SPEED, None))


@pytest.mark.parametrize("brightness", [1.0, 1.25])
def test_clips_gain_with_both(brightness: float) -> None:
    made = clip(brightness)
    result = unsmear.deblur_sequence(made.blurred, indices=[1], exposure=1.0)
    inner = (slice(16, -16),) * 2
    before, after = (
        np.mean((x[inner].astype(np.float64) - made.sharp[1][inner]) ** 2)
        for x in (made.blurred[1], result.frames[0])
    )
    assert 10 * np.log10(before / after) > 5
