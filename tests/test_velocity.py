"""Velocity at the middle of an exposure, from flow both ways."""

import numpy as np
import pytest
from unsmear import synthetic
from unsmear.velocity import velocity_of_frame

TEXTURE = synthetic.texture((110, 110), seed=3, exponent=1.5)


@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize("method", ["balanced", "least-squares"])
def test_a_translation_has_one_velocity(index: int, method: str) -> None:
    s = synthetic.translation(TEXTURE, (1.5, -0.8), shape=(70, 72))
    velocity, result = velocity_of_frame(s.sharp, index, method=method)
    inside = velocity[12:-12, 12:-12]
    # Exact but for what either method leaves on a noiseless translation.
    assert np.abs(inside - (1.5, -0.8)).max() < 0.1
    assert result.report["method"] == method


def test_acceleration_cancels_between_the_two_ways() -> None:
    s = synthetic.translation(
        TEXTURE, (2.0, 0.0), acceleration=(1.0, 0.0), shape=(70, 72)
    )
    velocity, result = velocity_of_frame(s.sharp, 1)
    # One way alone is off by half the acceleration.
    assert np.median(velocity[12:-12, 12:-12, 0]) == pytest.approx(2.0, abs=0.05)
    assert np.median(result.flow[12:-12, 12:-12, 0]) == pytest.approx(2.5, abs=0.05)


def test_one_frame_shows_no_motion() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        velocity_of_frame(TEXTURE[None], 0)
