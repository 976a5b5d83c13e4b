"""The forward operator: its laws, then the slow twin, then bad input."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from numpy.testing import assert_allclose, assert_array_equal
from reference import blur as slow


def picture(shape: tuple[int, int], seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).random(shape)


def swirl(shape: tuple[int, int], speed: float = 0.25) -> np.ndarray:
    """A rotation with some spread, px/frame, float32."""
    y, x = np.indices(shape, dtype=float)
    y, x = y - shape[0] / 2, x - shape[1] / 2
    flow = np.stack([-speed * y + 0.1 * x + 3, speed * x + 0.1 * y - 1], axis=-1)
    return flow.astype(np.float32)


def test_a_wave_is_damped_by_the_transform_of_the_box() -> None:
    y, x = np.indices((60, 70))
    wave = np.cos(0.4 * x + 0.3 * y)
    flow = np.broadcast_to((5.0, -3.0), (60, 70, 2))
    half = 0.5 * 0.8 * (0.4 * 5 - 0.3 * 3)
    inside = (slice(20, 40), slice(20, 50))
    # Cubic splines err by about |w|^4 / 1000 at |w| = 0.5 rad/px.
    assert_allclose(
        unsmear.blur(wave, flow, exposure=0.8)[inside],
        (np.sin(half) / half * wave)[inside],
        atol=2e-4,
    )


def test_a_radial_picture_does_not_change_under_rotation() -> None:
    y, x = np.indices((61, 61)) - 30.0
    rings = np.cos(0.5 * np.hypot(x, y))
    flow = np.stack([-0.3 * y, 0.3 * x], axis=-1)
    inside = (slice(15, 46), slice(15, 46))
    # Streamlines off by 0.02 px across slopes of 0.5, and the spline at the cusp.
    blurred = unsmear.blur(rings, flow)
    assert_allclose(blurred[inside], rings[inside], atol=0.015)


def test_constants_stay_and_stillness_is_the_identity_bit_for_bit() -> None:
    image = picture((20, 23))
    still = np.zeros((20, 23, 2))
    assert_array_equal(unsmear.blur(image, still), image)
    assert_array_equal(unsmear.blur(image, still + np.nan), image)
    # Rounding of a hundred weights that sum to 1.
    flat = np.full((20, 23), 0.7)
    assert_allclose(unsmear.blur(flat, swirl((20, 23))), flat, rtol=1e-13)


def test_is_linear() -> None:
    a, b, flow = picture((18, 21), 1), picture((18, 21), 2), swirl((18, 21))
    together = unsmear.blur(2 * a - b, flow)
    assert_allclose(
        together, 2 * unsmear.blur(a, flow) - unsmear.blur(b, flow), atol=1e-13
    )


def test_equals_the_slow_twin() -> None:
    image, flow = picture((17, 20)), swirl((17, 20))
    flow[3:6, 4:9] = np.nan
    flow[:, 15:] += 9
    # The same formulas in float64, summed in another order.
    assert_allclose(
        unsmear.blur(image, flow, exposure=0.9),
        slow.blur(image, flow.astype(float), 0.9),
        atol=1e-11,
    )


def test_colour_blurs_each_channel() -> None:
    image, flow = picture((3, 15, 16 * 1)).reshape(3, 15, 16), swirl((15, 16))
    blurred = unsmear.blur(image, flow, channel_axis=0)
    assert blurred.shape == image.shape
    for before, after in zip(image, blurred, strict=True):
        assert_array_equal(after, unsmear.blur(before, flow))


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 1), (2, 2), (13, 17)])
def test_any_size_is_blurred(shape: tuple[int, int]) -> None:
    flow = np.full((*shape, 2), 3.0)
    assert np.isfinite(unsmear.blur(picture(shape), flow)).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"image": np.ones((4, 5)), "flow": np.ones((5, 4, 2))}, r"flow .*\(4, 5, 2\)"),
        ({"image": np.ones((4, 5)), "flow": np.ones((4, 5))}, r"flow .*\(H, W, 2\)"),
        ({"image": np.ones((4, 5, 3)), "flow": np.ones((4, 5, 2))}, "channel_axis"),
        ({"image": np.ones((0, 5)), "flow": np.ones((0, 5, 2))}, "image must have"),
        (
            {"image": np.ones((4, 5)), "flow": np.ones((4, 5, 2)), "exposure": 0},
            "exposure must be .*got 0",
        ),
        ({"image": np.ones((4, 5)), "flow": np.full((4, 5, 2), 1e9)}, "flow must be"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        unsmear.blur(**arguments)
