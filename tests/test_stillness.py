"""Ground at rest beside what moves: found, and returned as it came."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.restoration.stillness import still

TEXTURE = (255 * synthetic.texture((96, 96), seed=5, exponent=1.3)).astype(np.float32)
WAY = np.zeros((96, 96, 2), np.float32)
WAY[..., 0] = 6.0
INNER = (slice(12, -12),) * 2


def noisy(picture: np.ndarray, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, 1, picture.shape)
    return (picture + noise).astype(np.float32)


def test_texture_at_rest_is_still_whatever_its_motion_says() -> None:
    own, other = noisy(TEXTURE, 1), noisy(TEXTURE, 2)
    assert still(own, [(other, WAY)])[INNER].all()


def test_one_neighbour_is_enough() -> None:
    own, other = noisy(TEXTURE, 1), noisy(TEXTURE, 2)
    hidden = noisy(TEXTURE[::-1], 3)
    assert still(own, [(hidden, WAY), (other, -WAY)])[INNER].all()


def test_what_moves_as_its_motion_says_is_not_still() -> None:
    moved = np.roll(TEXTURE, 6, axis=1)
    assert not still(noisy(TEXTURE, 1), [(noisy(moved, 2), WAY)])[INNER].any()


@pytest.mark.parametrize("way", [WAY, 0.05 * WAY, np.full_like(WAY, np.nan)])
def test_without_evidence_motion_stays(way: np.ndarray) -> None:
    flat = np.full((96, 96), 90.0, np.float32)
    picture = flat if np.array_equal(way, WAY) else TEXTURE
    assert not still(noisy(picture, 1), [(noisy(picture, 2), way)]).any()


def test_unknown_samples_are_not_compared() -> None:
    own = noisy(TEXTURE, 1)
    own[30:60, 30:60] = np.nan
    found = still(own, [(noisy(TEXTURE, 2), WAY)])
    assert not found[30:60, 30:60].any()
    assert found[70:80, 70:80].all()


def test_ground_beside_a_mover_comes_back_as_it_came() -> None:
    y, x = np.mgrid[:200, :200]
    radius = 32
    clip = synthetic.layers(
        synthetic.texture((200, 200), seed=8, exponent=1.3),
        synthetic.texture((200, 200), seed=9, exponent=1.4),
        (y - 100) ** 2 + (x - 100) ** 2 < radius**2,
        background_motion=synthetic.translating((0.0, 0.0)),
        foreground_motion=synthetic.translating((9.0, -4.0)),
        shape=(144, 144),
        n_frames=3,
        exposure=1.0,
        noise=1.0,
        bits=8,
    )
    result = unsmear.deblur_sequence(clip.blurred, indices=[1], exposure=1.0, joint=1)
    away = np.hypot(*(np.mgrid[:144, :144] - 71.5))
    ground = away > radius + 0.5 * np.hypot(9, 4) + 2
    same = result.frames[0] == clip.blurred[1]
    # Two samples change, 49 where flow alone says what moves.
    assert (~same[ground]).sum() < 10
    patch = away < radius - 6
    blurred, restored = (
        np.sqrt(((one[patch].astype(float) - clip.sharp[1][patch]) ** 2).mean())
        for one in (clip.blurred[1], result.frames[0])
    )
    assert restored < 0.75 * blurred
