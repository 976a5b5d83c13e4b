"""The exposure found in the blur: from known blurs, and what it says when it cannot."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from unsmear import synthetic


@pytest.fixture(scope="module")
def clip() -> synthetic.Sequence:
    texture = synthetic.texture((300, 300), seed=4)
    return synthetic.translation(
        texture,
        (9.0, -4.0),
        shape=(192, 192),
        exposure=0.8,
        n_frames=2,
        noise=1.0,
        bits=8,
    )


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.5])
def test_finds_blur_whatever_the_length_of_the_flow(
    clip: synthetic.Sequence, scale: float
) -> None:
    found = unsmear.estimate_exposure(clip.blurred[0], scale * clip.velocity[0])
    assert found.status == "ok"
    # The truth is 0.8 of 9.8 px; 2 % of it is 0.16 px.
    assert found.value * scale == pytest.approx(0.8, rel=0.02)
    assert found.vote >= 0.6
    assert found.tiles > 10


def test_several_frames_share_one_exposure(clip: synthetic.Sequence) -> None:
    found = unsmear.estimate_exposure(clip.blurred, clip.velocity)
    assert found.value == pytest.approx(0.8, rel=0.02)


def test_type_scale_and_repetition_do_not_matter(clip: synthetic.Sequence) -> None:
    found = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    again = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    assert again == found
    floats = 0.01 * clip.blurred[0].astype(np.float64) - 1
    other = unsmear.estimate_exposure(floats, clip.velocity[0])
    # The picture is rounded to single precision.
    assert other.value == pytest.approx(found.value, rel=1e-4)
    assert other.noise == pytest.approx(0.01 * found.noise, rel=1e-3)


def test_colour_is_seen_by_its_luma(clip: synthetic.Sequence) -> None:
    colour = np.stack([clip.blurred[0]] * 3, axis=0)
    found = unsmear.estimate_exposure(colour, clip.velocity[0], channel_axis=0)
    grey = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    assert found.value == pytest.approx(grey.value, rel=1e-4)


def test_threads_do_not_change_a_bit(clip: synthetic.Sequence) -> None:
    before = unsmear.get_num_threads()
    try:
        found = []
        for threads in (1, 3):
            unsmear.set_num_threads(threads)
            found.append(unsmear.estimate_exposure(clip.blurred, clip.velocity))
    finally:
        unsmear.set_num_threads(before)
    assert found[0] == found[1]


def test_small_motion_is_said_to_be_small(clip: synthetic.Sequence) -> None:
    found = unsmear.estimate_exposure(clip.blurred[0], 0.02 * clip.velocity[0])
    assert (found.status, found.tiles) == ("small", 0)
    assert found.report()["vote"] is None


@pytest.mark.parametrize(("length", "side"), [(22.0, 240), (30.0, 290), (60.0, 340)])
def test_long_blur_is_read_to_a_hundredth(length: float, side: int) -> None:
    """In small tiles, in those of large motion, and nearly half of one of those."""
    texture = synthetic.texture((side + 90, side + 90), seed=5)
    velocity = (0.8 * length, 0.6 * length)
    clip = synthetic.translation(
        texture, velocity, shape=(side, side), exposure=1.0, n_frames=1, noise=1.0
    )
    found = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    assert found.status == "ok"
    # The window leaks between zeros 240/22 or 340/60 px apart: a leakage wrong by a
    # tenth moves the optimum by 2 %.
    assert found.value == pytest.approx(1.0, rel=0.01)


def test_blur_too_long_for_the_picture_is_not_said_to_be_found() -> None:
    texture = synthetic.texture((300, 300), seed=5)
    clip = synthetic.translation(
        texture, (36.0, 27.0), shape=(200, 200), exposure=1.0, n_frames=1, noise=1.0
    )
    found = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    assert found.status == "unsure"


def test_a_strong_turn_is_not_said_to_be_found() -> None:
    """A wave turned by 25 degrees while it is recorded fills the zeros."""
    picture = synthetic.texture((400, 400), seed=5)
    case = synthetic.blur_case("R25", picture, shape=(200, 200), noise=1.0)
    bend = case.acceleration
    found = unsmear.estimate_exposure(case.blurred, case.velocity, acceleration=bend)
    assert found.status == "unsure"


def test_a_small_fast_thing_before_a_still_scene_is_read() -> None:
    """It covers a twentieth of the picture: four tiles see it alone."""
    moving = synthetic.translation(
        synthetic.texture((500, 500), seed=5),
        (9.0, 3.0),
        shape=(240, 240),
        exposure=1.0,
        n_frames=1,
        noise=1.0,
    )
    picture = synthetic.texture((240, 240), seed=3)
    velocity = np.zeros((240, 240, 2), np.float32)
    thing = (slice(80, 130), slice(96, 150))
    picture[thing] = moving.blurred[0][thing]
    velocity[thing] = (9.0, 3.0)
    found = unsmear.estimate_exposure(
        picture, velocity, limits=(0.06, 1.25), turn=False, noise=1.0 / 255
    )
    assert found.status == "ok"
    assert found.value == pytest.approx(1.0, rel=0.02)


def test_deblur_takes_the_blur_from_the_picture(clip: synthetic.Sequence) -> None:
    given = unsmear.deblur(clip.blurred[0], clip.velocity[0], exposure=0.8)
    found = unsmear.deblur(clip.blurred[0], 1.4 * clip.velocity[0], exposure="auto")
    inner = (slice(24, -24),) * 2
    truth = clip.sharp[0][inner]
    psnr = [unsmear.metrics.psnr(d.image[inner], truth) for d in (given, found)]
    # Half a decibel for a blur that nobody measured.
    assert psnr[1] > psnr[0] - 0.5
    assert found.report["exposure_found"]["status"] == "ok"


def turned(flow: NDArray[np.float32], degrees: float) -> NDArray[np.float32]:
    """Return the flow turned from right to down."""
    angle = np.deg2rad(degrees)
    matrix = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    return np.asarray(flow @ np.asarray(matrix), np.float32)


@pytest.mark.parametrize("degrees", [-12.0, 7.0, 10.0])
@pytest.mark.parametrize("exposure", [0.8, "auto"])
def test_a_flow_beside_the_blur_is_turned(
    clip: synthetic.Sequence, degrees: float, exposure: float | str
) -> None:
    image, flow = clip.blurred[0], turned(clip.velocity[0], degrees)
    right = unsmear.deblur(image, clip.velocity[0], exposure=0.8)
    found = unsmear.deblur(image, flow, exposure=exposure)
    assert found.report["turn"] == pytest.approx(-degrees, abs=1)
    assert "beside the flow" in " ".join(found.report["warnings"])
    inner = (slice(24, -24),) * 2
    truth = clip.sharp[0][inner]
    psnr = [unsmear.metrics.psnr(d.image[inner], truth) for d in (right, found)]
    assert psnr[1] > psnr[0] - 0.5
    # The report is enough to repeat it.
    told = {name: found.report[name] for name in ("exposure", "turn")}
    again = unsmear.deblur(image, flow, **told)
    assert np.array_equal(again.image, found.image)
    assert "beside the flow" not in " ".join(again.report["warnings"])


def test_a_right_flow_is_left_as_it_came(clip: synthetic.Sequence) -> None:
    image = clip.blurred[0]
    for degrees in (0.0, 1.0, -2.0):
        flow = turned(clip.velocity[0], degrees)
        found = unsmear.deblur(image, flow, exposure=0.8)
        told = unsmear.deblur(image, flow, exposure=0.8, turn=0)
        assert found.report["turn"] == 0
        assert np.array_equal(found.image, told.image)


def test_turning_takes_velocity_and_acceleration_along() -> None:
    picture = synthetic.texture((64, 80), seed=1)
    right = np.full((64, 80, 2), (5.0, 0.0), np.float32)
    faster = np.full((64, 80, 2), (1.0, 0.5), np.float32)
    down, bent = turned(right, 90), turned(faster, 90)
    straight = unsmear.deblur(picture, down, acceleration=bent, turn=0).image
    by_turn = unsmear.deblur(picture, right, acceleration=faster, turn=90).image
    # Sine and cosine of 90 degrees are right to the rounding of single precision.
    np.testing.assert_allclose(by_turn, straight, atol=1e-4)


def test_the_direction_is_sought_without_touching_what_came(
    clip: synthetic.Sequence,
) -> None:
    flow = clip.velocity[0].copy()
    flow[:9] = np.nan
    flow[9:20] = 1e6
    before = flow.copy()
    unsmear.deblur(clip.blurred[0], flow, exposure=0.8, method="wiener")
    np.testing.assert_array_equal(flow, before)


def test_several_frames_are_not_turned_unless_asked(clip: synthetic.Sequence) -> None:
    flow = np.stack([turned(field, 10) for field in clip.velocity])
    assert unsmear.estimate_exposure(clip.blurred, flow).turn == 0
    found = unsmear.estimate_exposure(clip.blurred, flow, turn=True)
    assert found.turn == pytest.approx(-10, abs=1)
    assert found.value == pytest.approx(0.8, rel=0.02)


def test_the_founding_method_takes_the_flow_as_it_is(clip: synthetic.Sequence) -> None:
    flow = turned(clip.velocity[0], 10)
    made = [
        unsmear.deblur(clip.blurred[0], flow, method="thesis", **more)
        for more in ({}, {"turn": 0})
    ]
    assert np.array_equal(made[0].image, made[1].image)
    assert made[0].report["turn"] == 0


def test_bad_input_is_named(clip: synthetic.Sequence) -> None:
    image, flow = clip.blurred[0], clip.velocity[0]
    with pytest.raises(ValueError, match="frames must have shape"):
        unsmear.estimate_exposure(image[:-1], flow)
    with pytest.raises(ValueError, match="flow must have shape"):
        unsmear.estimate_exposure(image, flow[..., :1])
    with pytest.raises(ValueError, match="limits must be"):
        unsmear.estimate_exposure(image, flow, limits=(1.0, 0.5))
    with pytest.raises(ValueError, match="noise must be"):
        unsmear.estimate_exposure(image, flow, noise=-1.0)
    with pytest.raises(TypeError, match="seed must be"):
        unsmear.estimate_exposure(image, flow, seed=0.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="exposure must be 'auto'"):
        unsmear.deblur(image, flow, exposure="long")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="turn must be 'auto'"):
        unsmear.deblur(image, flow, turn="left")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="turn must be finite"):
        unsmear.deblur(image, flow, turn=np.nan)
