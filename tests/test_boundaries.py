"""Where two motions meet: a change that explains nothing is not shown."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import _unsmear, synthetic
from unsmear.restoration.boundaries import believed
from unsmear.restoration.looks import Look, look

SIZE, PAD = 64, 12
SCENE = 255 * synthetic.texture((SIZE + 2 * PAD,) * 2, seed=3, exponent=1.3)
SCENE = np.ascontiguousarray(SCENE[np.newaxis], np.float32)
MEETS = np.zeros((SIZE, SIZE), bool)
MEETS[20:40, 20:40] = True


def seen(length: float, weights: np.ndarray | None = None) -> Look:
    """Return a look at the scene, blurred along x by ``length`` px."""
    velocity = np.zeros((SIZE, SIZE, 2), np.float32)
    velocity[..., 0] = length
    ones = np.where(MEETS, 0, 1) if weights is None else weights
    nothing = np.zeros((1, SIZE, SIZE), np.float32)
    at = look(nothing, velocity, np.zeros_like(velocity), 1.0, ones)
    return at | {"planes": _unsmear.record_look(at, SCENE, PAD)}


@pytest.mark.parametrize("length", [1.5, 9.0])
def test_what_explains_the_frame_is_believed(length: float) -> None:
    assert believed(seen(length), SCENE, PAD).min() == 1


@pytest.mark.parametrize("length", [1.5, 9.0])
def test_what_is_made_up_is_not_and_only_where_motions_meet(length: float) -> None:
    share = believed(seen(length), np.ascontiguousarray(SCENE[:, ::-1]), PAD)
    assert share[MEETS].mean() < 0.5  # blurred, the wrong scene is less wrong
    assert (share[~MEETS] == 1).all()


def test_where_nothing_meets_all_is_believed() -> None:
    at = seen(9.0, np.ones((SIZE, SIZE)))
    assert (believed(at, np.zeros_like(SCENE), PAD) == 1).all()


def test_short_blur_asks_for_more() -> None:
    # Half of the change is unexplained: too much where the frame is nearly sharp.
    half = {}
    for length in (1.5, 9.0):
        at = seen(length)
        # Errors as large as half of what the blur changed, too smooth to be blurred.
        planes, inner = at["planes"], slice(PAD, -PAD)
        change = float(np.abs(planes - SCENE[:, inner, inner])[:, MEETS].mean())
        wrong = SCENE + np.float32(0.5 * change)
        half[length] = believed(at, np.ascontiguousarray(wrong), PAD)[MEETS].mean()
    assert half[9.0] > half[1.5] + 0.3


def test_unknown_samples_do_not_spoil_their_surroundings() -> None:
    at = seen(9.0)
    at["planes"][:, 30, 30] = np.nan
    share = believed(at, SCENE, PAD)
    assert np.isfinite(share).all()
    assert share[24:28, 24:28].min() == 1


def test_two_bodies_hardly_blurred_gain() -> None:
    """The rim alone cost nearly what all the rest gained: +.35 dB were left."""
    clip = clip_of_two_bodies()
    inner = (slice(16, -16),) * 2
    restored = unsmear.deblur_sequence(clip.blurred, indices=[2]).frames[0]
    gain = unsmear.metrics.psnr(
        restored[inner], clip.sharp[2][inner]
    ) - unsmear.metrics.psnr(clip.blurred[2][inner], clip.sharp[2][inner])
    assert gain > 1.2


def clip_of_two_bodies() -> Any:
    """Return five frames of a disc before a ground that moves otherwise."""
    y, x = np.mgrid[:200, :200]
    return synthetic.layers(
        synthetic.texture((200, 200), seed=11, exponent=1.3),
        synthetic.texture((200, 200), seed=12, exponent=1.4),
        (y - 100) ** 2 + (x - 100) ** 2 < 45**2,
        background_motion=synthetic.translating((-7.0, 3.0)),
        foreground_motion=synthetic.translating((8.0, 4.0)),
        shape=(160, 160),
        n_frames=5,
        exposure=0.3,
        noise=1.0,
        bits=8,
        seed=1,
    )
