"""The strength of the prior that noise alone asks for."""

from __future__ import annotations

import pytest
from unsmear.restoration.looks import WALK
from unsmear.restoration.twin_frames import of_noise


def test_it_goes_with_the_power_three_halves_from_the_least_tried() -> None:
    assert of_noise(4.0, WALK) == pytest.approx(8 * of_noise(1.0, WALK))
    assert of_noise(1.0, WALK) == pytest.approx(0.065)
    assert of_noise(0.0, WALK) == WALK[0]
