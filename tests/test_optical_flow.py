"""`unsmear.optical_flow`: the laws that every method keeps, whatever is fed to it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import unsmear
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from textures import moving_texture

Array = NDArray[Any]

METHODS = ("least-squares", "fleet-jepson", "thesis")
LEAST_FRAMES = {"least-squares": 2, "fleet-jepson": 3, "thesis": 2}


@pytest.fixture(scope="module")
def frames() -> Array:
    """A texture that moves by (0.8, -0.5) px/frame and fills [0.1, 0.9]."""
    texture = moving_texture((0.8, -0.5), (5, 40, 43), waves=90, band=(0.5, 1.9))
    low, high = texture.min(), texture.max()
    return 0.1 + 0.8 * (texture - low) / (high - low)


def flow(frames: Any, method: str, **given: Any) -> Array:
    return unsmear.optical_flow(frames, method=method, **given).flow


def assert_same_flow(actual: Array, expected: Array, bound: float) -> None:
    """Within ``bound`` px wherever both are known; all but a few pixels known alike.

    A test passed within the difference of its threshold may turn: below 1 % of pixels.
    """
    assert np.isfinite(expected).any()
    assert (np.isnan(actual) != np.isnan(expected)).mean() < 0.01
    both = np.isfinite(actual) & np.isfinite(expected)
    assert np.abs(actual - expected)[both].max() < bound


# Brightness and types


@pytest.mark.parametrize(
    ("gain", "offset"),
    [(255.0, 0.0), (-3.0, 7.0), (1e-6, 1e3), (1e-9, 0.0), (1e9, 1e9)],
)
@pytest.mark.parametrize("method", ["least-squares", "fleet-jepson"])
def test_gain_and_offset_do_not_matter(
    frames: Array, method: str, gain: float, offset: float
) -> None:
    plain = flow(frames, method)
    assert_same_flow(flow(gain * frames + offset, method), plain, 1e-4)


@pytest.mark.parametrize("gain", [255.0, -3.0, 1e-9])
def test_gain_does_not_matter_to_the_thesis(frames: Array, gain: float) -> None:
    """The founding filters let the mean through: an offset does matter to them."""
    assert_same_flow(flow(gain * frames, "thesis"), flow(frames, "thesis"), 1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_types_of_one_picture_have_one_flow(frames: Array, method: str) -> None:
    grey = np.rint(frames * 255).astype(np.uint8)
    expected = flow(grey, method)
    for same in (
        grey.astype(np.uint16) * 257,
        grey / 255,
        (grey / 255).astype(np.float32),
        grey.astype(np.float16),  # 0..255 are exact; the scale does not matter
        grey.astype(np.float64),
        grey.astype(np.int16),
        grey.astype(">u2"),
        grey.astype(">f8"),
    ):
        assert_same_flow(flow(same, method), expected, 1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_layout_of_memory_does_not_matter_and_the_input_stays(
    frames: Array, method: str
) -> None:
    expected = flow(frames, method)
    wide = np.zeros((10, 80, 86))
    wide[::2, ::2, ::2] = frames
    read_only = frames.copy()
    read_only.flags.writeable = False
    cases: list[Any] = [
        np.asfortranarray(frames),
        frames[:, ::-1, ::-1].copy()[:, ::-1, ::-1],
        wide[::2, ::2, ::2],
        read_only,
        np.ma.masked_array(frames, mask=False),
        frames.tolist(),
        frames[..., None].repeat(3, -1),
        np.moveaxis(frames[..., None], -1, 1),
    ]
    axes = [None] * 6 + [-1, 1]
    for case, axis in zip(cases, axes, strict=True):
        before = np.array(case)
        result = flow(case, method, channel_axis=axis)
        if axis == -1:  # three equal channels: weights that sum to 1 but for rounding
            assert_same_flow(result, expected, 1e-5)
        else:
            np.testing.assert_array_equal(result, expected)
        np.testing.assert_array_equal(np.array(case), before)


def test_colour_is_never_guessed() -> None:
    colour = np.random.default_rng(0).random((5, 20, 21, 3))
    with pytest.raises(ValueError, match=r"say which channel_axis holds colour\), got"):
        unsmear.optical_flow(colour)
    # A volume of three columns is a volume.
    assert unsmear.optical_flow(colour[..., 0][:, :, :3]).flow.shape == (20, 3, 2)
    grey = colour @ (0.299, 0.587, 0.114)
    by_axis = unsmear.optical_flow(colour, channel_axis=3).flow
    assert_same_flow(by_axis, unsmear.optical_flow(grey).flow, 1e-5)
    with pytest.raises(ValueError, match="channel_axis must name an axis of frames"):
        unsmear.optical_flow(colour, channel_axis=4)
    with pytest.raises(ValueError, match="have 1 or 3 channels along channel_axis=1"):
        unsmear.optical_flow(colour, channel_axis=1)


# Motion


@pytest.mark.parametrize("method", METHODS)
def test_still_frames_rest_and_blank_frames_are_unknown(method: str) -> None:
    still = np.repeat(moving_texture((0, 0), (1, 33, 37)), 7, axis=0)
    options = {"zero_static": "velocity"} if method == "thesis" else {}
    result = unsmear.optical_flow(still, method=method, **options)
    assert result.valid.mean() > 0.5
    assert (result.flow[result.valid] == 0).all()
    assert not np.signbit(result.flow[result.valid]).any() or method == "thesis"
    for level in (0.0, 0.1, 1e6):
        if method == "thesis" and level:
            continue  # the mean leaks in and its border moves with the filters
        blank = unsmear.optical_flow(np.full((5, 33, 37), level), method=method)
        assert np.isnan(blank.flow).all()
        assert not blank.valid.any()
        assert (blank.confidence == 0).all()
        assert blank.report["warnings"] == ["nothing to measure motion on"]


@pytest.mark.parametrize("method", METHODS)
def test_reversed_time_negates(frames: Array, method: str) -> None:
    # The frames between which the motion is taken are the same two (least squares: one
    # pair) or lie symmetrically about the reference frame.
    count, index = {"least-squares": (2, 0), "fleet-jepson": (5, 2), "thesis": (3, 0)}[
        method
    ]
    forward = flow(frames[:count], method, index=index)
    backward = flow(frames[:count][::-1], method, index=index)
    assert_same_flow(-backward, forward, 1e-5)


@pytest.mark.parametrize("method", ["least-squares", "fleet-jepson"])
def test_flipped_frames_flip_the_flow(frames: Array, method: str) -> None:
    plain = flow(frames, method)
    in_x = flow(frames[:, :, ::-1], method)[:, ::-1] * np.float32([-1, 1])
    in_y = flow(frames[:, ::-1], method)[::-1] * np.float32([1, -1])
    # Single precision: sums in another order, 1e-7 over eigenvalues of 1e-2.
    assert_same_flow(in_x, plain, 5e-4)
    assert_same_flow(in_y, plain, 5e-4)


def test_transposed_frames_transpose_the_flow(frames: Array) -> None:
    """Least squares only: transposition does not map the 22 centres to themselves."""
    plain = flow(frames, "least-squares")
    turned = flow(frames.transpose(0, 2, 1), "least-squares")
    assert_same_flow(turned.transpose(1, 0, 2)[..., ::-1], plain, 5e-4)


@pytest.mark.parametrize("method", ["least-squares", "fleet-jepson"])
def test_right_and_down_are_positive_and_speeds_are_right(
    frames: Array, method: str
) -> None:
    result = flow(frames, method, index=2)[12:-12, 12:-12]
    found = np.nanmedian(result, axis=(0, 1))
    np.testing.assert_allclose(found, (0.8, -0.5), atol=0.02)


def test_index_counts_from_either_end_and_defaults_to_the_middle(frames: Array) -> None:
    middle = unsmear.optical_flow(frames)
    assert middle.report["index"] == 2
    assert unsmear.optical_flow(frames[:4]).report["index"] == 1
    np.testing.assert_array_equal(flow(frames, "least-squares", index=-3), middle.flow)
    for index in (-6, 5):
        with pytest.raises(ValueError, match=rf"index must be in -5\.\.4, got {index}"):
            unsmear.optical_flow(frames, index=index)
    with pytest.raises(TypeError, match=r"index must be an integer, got float 1\.5"):
        unsmear.optical_flow(frames, index=1.5)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", METHODS)
def test_the_result_is_what_it_says(frames: Array, method: str) -> None:
    given = {"tuning_frequency": 0.2}
    r = unsmear.optical_flow(frames, method=method, **given)
    assert r.flow.shape == (40, 43, 2)
    assert r.flow.dtype == r.confidence.dtype == np.float32
    assert r.valid.dtype == bool
    np.testing.assert_array_equal(r.valid, np.isfinite(r.flow).all(-1))
    np.testing.assert_array_equal(r.confidence > 0, r.valid)
    assert r.confidence.max() <= 1
    told = json.loads(json.dumps(r.report))
    assert told["parameters"]["tuning_frequency"] == 0.2
    again = unsmear.optical_flow(
        frames, method=told["method"], index=told["index"], **told["parameters"]
    )
    np.testing.assert_array_equal(again.flow, r.flow)


# Bad input


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_frames_are_refused_or_answered(method: str, count: int) -> None:
    frames = np.random.default_rng(1).random((count, 9, 11))
    least = LEAST_FRAMES[method]
    if count < least:
        with pytest.raises(
            ValueError,
            match=rf"frames must have shape \(T >= {least}, .*got \({count}, 9",
        ):
            unsmear.optical_flow(frames, method=method)
    else:
        assert unsmear.optical_flow(frames, method=method).flow.shape == (9, 11, 2)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "size", [(0, 0), (0, 5), (5, 0), (1, 1), (1, 17), (17, 1), (2, 2), (3, 2), (7, 13)]
)
def test_small_pictures_are_refused_or_answered(
    method: str, size: tuple[int, int]
) -> None:
    frames = np.random.default_rng(1).random((5, *size))
    if 0 in size:
        with pytest.raises(ValueError, match=r"H >= 1, W >= 1\) for method"):
            unsmear.optical_flow(frames, method=method)
        return
    r = unsmear.optical_flow(frames, method=method)
    assert r.flow.shape == (*size, 2)
    assert not np.isinf(r.flow).any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_no_numbers_are_refused(method: str, bad: float) -> None:
    frames = np.random.default_rng(1).random((5, 9, 11))
    frames[1, 2, 3] = bad
    with pytest.raises(ValueError, match="frames must be finite everywhere"):
        unsmear.optical_flow(frames, method=method)
    masked = np.ma.masked_less(np.random.default_rng(1).random((5, 9, 11)), 0.1)
    with pytest.raises(ValueError, match="frames must be finite everywhere"):
        unsmear.optical_flow(masked, method=method)


@pytest.mark.parametrize(
    ("error", "given", "message"),
    [
        (ValueError, {"method": "magic"}, "method must be one of .*, got 'magic'"),
        (ValueError, {"sigma": 1}, "'least-squares' has no parameter 'sigma'; it has"),
        (TypeError, {"passes": 1.5}, "passes must be int, got float 1.5"),
        (TypeError, {"passes": "2"}, "passes must be int, got str '2'"),
        (TypeError, {"border": 3}, "border must be str, got int 3"),
        (ValueError, {"passes": -1}, "passes must be an integer >= 0, got -1"),
        (TypeError, {"tau": None}, "tau must be float, got NoneType None"),
        (ValueError, {"tau": np.nan}, "tau must be > 0 deviations, got NaN"),
        (ValueError, {"tuning_frequency": 0.7}, "tuning_frequency must be in"),
        (ValueError, {"border": "wrap"}, 'border must be .*, got "wrap"'),
        (
            ValueError,
            {"method": "thesis", "zero_static": "all"},
            'zero_static must be .*, got "all"',
        ),
        (
            ValueError,
            {"method": "thesis", "least_fraction": 2.0},
            r"least_fraction must be in \[0, 1\], got 2",
        ),
    ],
)
def test_bad_parameters_are_named(
    error: type[Exception], given: dict[str, Any], message: str
) -> None:
    with pytest.raises(error, match=message):
        unsmear.optical_flow(np.zeros((5, 9, 11)), **given)


@pytest.mark.parametrize(
    "frames",
    [
        np.zeros((3, 5, 5), dtype=complex),
        np.zeros((3, 5, 5), dtype=object),
        np.zeros((3, 5, 5), dtype=bool),
        np.zeros((3, 5, 5), dtype="S3"),
        "frames",
        None,
    ],
)
def test_frames_that_are_no_numbers_are_a_type_error(frames: Any) -> None:
    with pytest.raises(TypeError, match="frames must be an array of integers or real"):
        unsmear.optical_flow(frames)


@settings(deadline=None, max_examples=80)
@given(
    shape=st.tuples(st.integers(0, 5), st.integers(0, 8), st.integers(0, 11)),
    dtype=st.sampled_from(["u1", "u2", ">u2", "i2", "u8", "f2", "f4", ">f4", "f8"]),
    method=st.sampled_from(METHODS),
    steps=st.tuples(*[st.sampled_from([1, 2, -1, -2])] * 3),
    index=st.one_of(st.none(), st.integers(-4, 4)),
    order=st.sampled_from(["C", "F"]),
    seed=st.integers(0, 2**16),
)
def test_any_array_is_answered_or_refused_with_reason(
    shape: tuple[int, int, int],
    dtype: str,
    method: str,
    steps: tuple[int, int, int],
    index: int | None,
    order: Any,
    seed: int,
) -> None:
    base = (np.random.default_rng(seed).random(shape) * 200).astype(dtype, order=order)
    view = base[tuple(slice(None, None, step) for step in steps)]
    before = view.copy()
    try:
        # Anything else, a PanicException above all, fails the test.
        r = unsmear.optical_flow(view, method=method, index=index)
    except ValueError as error:
        assert str(error).startswith(("frames must", "index must"))  # noqa: PT017
    else:
        assert r.flow.shape == (*view.shape[1:], 2)
        packed = unsmear.optical_flow(before, method=method, index=index)
        np.testing.assert_array_equal(r.flow, packed.flow)
    np.testing.assert_array_equal(view, before)
