"""What a restoration leaves unexplained, and the noise it has to come down to."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from test_blur import picture, swirl
from test_deblur import textured


def test_the_truth_leaves_the_noise() -> None:
    rng = np.random.default_rng(5)
    sharp, flow = 200 * textured((120, 130)), swirl((120, 130), 0.1)
    blurred = unsmear.blur(sharp, flow)
    noisy = blurred + 2 * rng.standard_normal(blurred.shape)
    error = unsmear.metrics.reblur_error(noisy, sharp, flow)
    # 15600 samples: the root mean square is known to 0.6 %.
    assert error == pytest.approx(2.0, rel=0.03)
    assert unsmear.metrics.reblur_error(noisy, noisy, flow) > 1.5 * error


def test_units_types_and_colour() -> None:
    sharp = (200 * picture((40, 50))).astype(np.uint8)
    flow = np.full((40, 50, 2), (4.0, 0.0))
    blurred = unsmear.blur(sharp, flow)
    # Both are rounded to whole levels: 1/12 from the recorded one only.
    error = unsmear.metrics.reblur_error(blurred, sharp, flow)
    assert error == pytest.approx(12**-0.5, rel=0.1)
    colour = np.stack([blurred] * 3), np.stack([sharp] * 3)
    again = unsmear.metrics.reblur_error(*colour, flow, channel_axis=0)
    assert again == pytest.approx(error)


def test_only_known_pixels_count() -> None:
    sharp, flow = picture((40, 50)), np.full((40, 50, 2), (4.0, 0.0))
    blurred = unsmear.blur(sharp, flow)
    blurred[:, :2] = 7.0  # light from beyond the picture
    blurred[5, 20] = np.nan
    assert unsmear.metrics.reblur_error(blurred, sharp, flow) < 1e-6
    assert np.isnan(unsmear.metrics.reblur_error(blurred, sharp, flow * np.nan))
    with pytest.raises(ValueError, match="restored must have shape"):
        unsmear.metrics.reblur_error(blurred, sharp[1:], flow)


def test_noise_of_any_type_is_in_its_units() -> None:
    rng = np.random.default_rng(1)
    noisy = np.clip(100 + 5 * rng.standard_normal((128, 128, 3)), 0, 255)
    flow = np.full((128, 128, 2), (8.0, 3.0))
    eight = unsmear.noise.estimate_noise(
        np.rint(noisy).astype(np.uint8), flow, channel_axis=2
    )
    assert eight == pytest.approx(5.0, rel=0.1)
    floats = unsmear.noise.estimate_noise(noisy / 255, flow, channel_axis=2)
    assert floats * 255 == pytest.approx(eight, rel=0.02)
    with pytest.raises(ValueError, match="exposure must be"):
        unsmear.noise.estimate_noise(noisy, flow, exposure=0.0, channel_axis=2)
