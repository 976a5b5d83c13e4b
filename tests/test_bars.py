"""Black bars around the picture are no part of the scene."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.restoration.bars import SOFT_EDGE, Bars, bars

SIZE = (64, 80)


def noisy(level: float, deviation: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(3)
    return (level + rng.normal(0, deviation, (3, *SIZE))).astype(np.float32)


def test_rows_and_columns_of_black_are_bars() -> None:
    planes = noisy(90.0, 20.0)
    for line in np.s_[:, :5], np.s_[:, -3:], np.s_[:, :, :1], np.s_[:, :, -7:]:
        planes[line] = 16
    expected = [count + SOFT_EDGE for count in (5, 3, 1, 7)]
    assert list(bars(planes)) == expected
    bars(planes).hide(planes)
    inner = np.isfinite(planes)
    top, bottom, left, right = expected
    assert inner[:, top:-bottom, left:-right].all()
    assert inner.sum() == 3 * (64 - top - bottom) * (80 - left - right)


@pytest.mark.parametrize(
    "planes",
    [
        pytest.param(noisy(90.0), id="picture"),
        pytest.param(noisy(6.0), id="a dark picture with noise"),
        pytest.param(np.zeros((3, *SIZE), np.float32), id="black throughout"),
        pytest.param(np.full((3, *SIZE), 255, np.float32), id="white throughout"),
        pytest.param(np.full((3, *SIZE), np.nan, np.float32), id="unknown throughout"),
        pytest.param(noisy(90.0)[:, :20, :20], id="small"),
    ],
)
def test_a_picture_without_bars_has_none(planes: np.ndarray) -> None:
    assert bars(planes) == Bars()
    before = planes.copy()
    bars(planes).hide(planes)
    np.testing.assert_array_equal(planes, before)


def test_the_ground_around_a_bright_thing_is_no_bar() -> None:
    planes = np.zeros((1, *SIZE), np.float32)
    planes[:, 25:40, 30:50] = 200
    assert bars(planes) == Bars()


def test_a_bright_sky_is_no_bar() -> None:
    planes = noisy(90.0)
    planes[:, :20] = 255
    assert bars(planes) == Bars()


def test_what_is_hidden_in_one_channel_only_is_picture() -> None:
    planes = noisy(90.0)
    planes[0, :10] = 0
    assert bars(planes) == Bars()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_clip_between_bars_is_restored_as_the_picture_alone(dtype: type) -> None:
    """The bars stay bit for bit; without them in the way the rest gains as much."""
    height, edge = 96, 24
    texture = synthetic.texture((240, 240), seed=4)
    clip = synthetic.translation(
        texture,
        (7.0, 4.0),
        shape=(height + 2 * edge, 120),
        n_frames=3,
        bits=8,
        exposure=0.9,
    )
    scale = {np.uint8: 1, np.uint16: 257, np.float32: 1 / 255}[dtype]
    frames = (clip.blurred.astype(np.float64) * scale).astype(dtype)
    framed = frames.copy()
    framed[:, :edge] = 0
    framed[:, -edge:] = 0
    inside = slice(edge, -edge)
    middle = (slice(edge + 12, -edge - 12), slice(12, -12))
    truth = clip.sharp[1].astype(np.float64)[middle]

    def gain(result: np.ndarray) -> float:
        before, after = (
            np.mean((np.asarray(x, np.float64)[middle] / scale - truth) ** 2)
            for x in (frames[1], result)
        )
        return float(10 * np.log10(before / after))

    alone = unsmear.deblur_sequence(frames[:, inside], indices=[1])
    whole = unsmear.deblur_sequence(framed, indices=[1])
    width = dict.fromkeys(("top", "bottom"), edge + SOFT_EDGE)
    assert whole.reports[0]["bars"] == width | {"left": 0, "right": 0}
    assert alone.reports[0]["bars"] == Bars()._asdict()
    for rows in (slice(edge + SOFT_EDGE), slice(-edge - SOFT_EDGE, None)):
        np.testing.assert_array_equal(whole.frames[0][rows], framed[1][rows])
        assert np.isnan(whole.flows[0][rows]).all()
    padded = framed[1].copy()
    padded[inside] = alone.frames[0]
    assert gain(padded) > 4
    # Two rows of picture on each side are taken for bar, and half a blur beyond them
    # was seen by fewer samples.
    assert gain(whole.frames[0]) > gain(padded) - 0.7


def test_joint_restoration_leaves_bars_alone() -> None:
    texture = synthetic.texture((240, 240), seed=5)
    clip = synthetic.translation(
        texture,
        (6.0, -4.0),
        shape=(120, 120),
        n_frames=3,
        bits=8,
        exposure=0.9,
    )
    framed = clip.blurred.copy()
    framed[:, :, :20] = 0
    result = unsmear.deblur_sequence(framed, indices=[1], joint=3, second_pass=True)
    np.testing.assert_array_equal(result.frames[0][:, :22], framed[1][:, :22])
    inner = (slice(16, -16), slice(40, -16))
    before, after = (
        np.mean((x[inner].astype(np.float64) - clip.sharp[1][inner]) ** 2)
        for x in (framed[1], result.frames[0])
    )
    assert 10 * np.log10(before / after) > 4
