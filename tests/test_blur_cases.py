"""Blur cases: the truth beside each blurred picture is what blurred it."""

from dataclasses import replace

import numpy as np
import pytest
from unsmear import _unsmear, synthetic
from unsmear.synthetic import BLUR_CASES, blur_case

PICTURE = synthetic.texture((160, 150), seed=3, exponent=1.2)
BEHIND = synthetic.texture((160, 150), seed=4, exponent=1.5)
SHAPE = (80, 72)
MARGIN = 24  # beyond what moves in


def case(name: str, **options) -> synthetic.BlurCase:
    behind = BEHIND if name == "2L" else None
    return blur_case(name, PICTURE, shape=SHAPE, behind=behind, **options)


def along_the_path(made: synthetic.BlurCase, n_times: int = 64) -> np.ndarray:
    """What velocity and acceleration say was exposed: B(p) is the mean of x(p + D(t)).

    D = -t v + t^2 / 2 q with q = (v . grad) v - a: to second order in t the place, at
    mid-exposure, of what the pixel shows at t.
    """
    v, a = made.velocity.astype(float), made.acceleration.astype(float)
    down, across = np.gradient(v, axis=(0, 1))
    q = v[..., :1] * across + v[..., 1:] * down - a
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    total = np.zeros(SHAPE)
    for t in (np.arange(n_times) + 0.5) / n_times - 0.5:
        place = t * t / 2 * q - t * v
        total += _unsmear.sample(
            made.sharp.astype(float),
            y + place[..., 1],
            x + place[..., 0],
            3,
            "replicate",
        )
    return total / n_times


@pytest.mark.parametrize("name", [n for n in BLUR_CASES if n != "2L"])
def test_velocity_and_acceleration_explain_the_blur(name: str) -> None:
    made = case(name, noise=0.0)
    inside = (slice(MARGIN, -MARGIN),) * 2
    error = (along_the_path(made) - made.blurred)[inside]
    change = np.std((made.blurred.astype(float) - made.sharp)[inside])
    # Both pictures are rounded to grey levels, and paths are cut at second order
    # (rotation by 25 degrees: .06 px at t = 1/2 and 44 px from the middle).
    assert np.sqrt((error**2).mean()) < 0.7
    assert change > 2
    assert not made.mixed.any()


def test_acceleration_is_that_of_a_fixed_pixel() -> None:
    # The speeding shake's field is (1 + t) times the steady one: it changes by itself.
    made = case("SHa", noise=0.0)
    np.testing.assert_allclose(made.acceleration, made.velocity, atol=1e-4)
    for name in ("T11", "R12", "Z", "SH"):
        np.testing.assert_allclose(case(name).acceleration, 0, atol=1e-4)
    # Taken for steady, the speeding shake would be misunderstood.
    steady = replace(made, acceleration=np.zeros_like(made.acceleration))
    inside = (slice(MARGIN, -MARGIN),) * 2
    assert np.std((along_the_path(steady) - made.blurred)[inside]) > 2
    speed = np.linalg.norm(case("SH").velocity, axis=-1)
    assert 12 < speed.min() < speed.max() < 16


def test_layers_mix_only_around_the_disc() -> None:
    made = case("2L", noise=0.0)
    speed = np.linalg.norm(made.velocity, axis=-1)
    assert set(np.unique(speed.round(3))) == {np.float32(3.6), np.float32(13.0)}
    # The disc goes another way than the background, 120 degrees from it.
    between = made.velocity[40, 36] @ made.velocity[0, 0] / (3.6 * 13)
    assert between == pytest.approx(-0.5, abs=1e-4)
    # Pure pixels see one layer all the time: its own translation explains them.
    pure = ~made.mixed
    assert made.mixed.any() and pure[40, 36] and pure[0, 0]
    error = (along_the_path(made) - made.blurred)[MARGIN:-MARGIN, MARGIN:-MARGIN]
    inside = pure[MARGIN:-MARGIN, MARGIN:-MARGIN]
    assert np.abs(error[inside]).mean() < 0.7 < 5 < np.abs(error[~inside]).max()


def test_a_clip_goes_on_from_its_case() -> None:
    clip = synthetic.blur_clip("R5", PICTURE, shape=SHAPE, noise=0.0, n_frames=3)
    made = case("R5", noise=0.0)
    np.testing.assert_array_equal(clip.blurred[1], made.blurred)
    np.testing.assert_array_equal(clip.velocity[0], made.velocity)
    half = synthetic.blur_clip(
        "T7", PICTURE, shape=SHAPE, noise=0.0, n_frames=1, exposure=0.5
    )
    assert half.exposure == 0.5
    np.testing.assert_allclose(np.linalg.norm(half.velocity, axis=-1), 7, atol=1e-4)
    whole = case("T7", noise=0.0)
    np.testing.assert_array_equal(whole.sharp, half.sharp[0])
    lost = [
        np.std(b.astype(float) - whole.sharp) for b in (half.blurred[0], whole.blurred)
    ]
    assert 2 < lost[0] < 0.8 * lost[1]


def test_noise_follows_its_seed() -> None:
    one, same, other = (case("T7", noise=5.0, seed=n).blurred for n in (1, 1, 2))
    assert one.tobytes() == same.tobytes()
    again = case("T7", noise=0.0).with_noise(5.0, 1).blurred
    assert again.tobytes() == one.tobytes()
    difference = one.astype(float) - other
    assert difference.std() == pytest.approx(5 * np.sqrt(2), rel=0.05)


def test_the_series_of_a_flow_is_its_path() -> None:
    turning = synthetic.flowing((0.0, 0.0), ((0, -0.3), (0.3, 0)))
    matrix, offset = turning(1.0)
    rotation, _ = synthetic.rotating(np.degrees(0.3))(1.0)
    np.testing.assert_allclose(matrix, rotation, atol=1e-15)
    np.testing.assert_array_equal(offset, 0)
    grown, shift = synthetic.flowing((2.0, 0.0), ((0.1, 0), (0, 0)), quickening=0.5)(2)
    tau = 2 + 0.5 * 2  # t + k t^2 / 2
    assert grown[0, 0] == pytest.approx(np.exp(0.1 * tau))
    assert shift[0] == pytest.approx(2 * (np.exp(0.1 * tau) - 1) / 0.1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: blur_case("T9", PICTURE, shape=SHAPE), "name must be one of 'T3'"),
        (lambda: blur_case("2L", PICTURE, shape=SHAPE), "behind"),
        (lambda: blur_case("T3", PICTURE, shape=SHAPE, behind=BEHIND), "behind"),
        (lambda: blur_case("T3", PICTURE, shape=SHAPE, noise=-1), "noise"),
        (lambda: synthetic.blur_clip("SHa", PICTURE, shape=SHAPE), "SHa"),
        (lambda: synthetic.flowing((1, 0), (1, 2)), "gradient"),
        (lambda: synthetic.flowing((1, 0), quickening=np.inf), "quickening"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
