"""Least squares over phase constraints: known motions, symmetries, its NumPy twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference.least_squares import least_squares as twin
from textures import moving_texture, standardized
from unsmear import _unsmear
from unsmear._parameters import PARAMETERS

Array = NDArray[Any]

INSIDE = (slice(16, -16), slice(16, -16))


def estimate(
    frames: Array, index: int, *, double: bool = True, **given: Any
) -> tuple[Array, Array]:
    values = PARAMETERS["least-squares"] | given
    return _unsmear.least_squares(frames, index, values, double=double)


# Mathematics


@pytest.mark.parametrize(
    "velocity", [(0.0, 1.0), (1.3, -0.6), (0.05, 0.0), (-2.4, 1.1), (3.0, 0.5)]
)
@pytest.mark.parametrize("frames", [2, 7])
def test_a_translation_is_measured(velocity: tuple[float, float], frames: int) -> None:
    index = (frames - 1) // 2
    sequence = moving_texture(velocity, (frames, 72, 76), waves=120, band=(0.3, 1.4))
    flow, confidence = estimate(sequence, index)
    error = np.hypot(*np.moveaxis(flow - velocity, -1, 0))[INSIDE]
    assert np.isfinite(error).all()
    # What is left is the change of the responses' envelopes over a step and, where a
    # response is weak, phases that wrap: a small share of the speed.
    assert np.median(error) < 0.01 + 0.01 * np.hypot(*velocity)
    assert (confidence[INSIDE] > 0.1).mean() > 0.95


def test_a_point_in_time_is_half_way_between_the_two_frames() -> None:
    """Two frames, motion at the first: symmetric under exchange, with the sign."""
    frames = moving_texture((0.7, -0.4), (2, 48, 52))
    there, _ = estimate(frames, 0)
    back, _ = estimate(frames[::-1], 0)
    # The same sums with D negated: exact but for the order of a rounded product.
    np.testing.assert_allclose(-back, there, rtol=0, atol=1e-12)


def test_mirrored_and_transposed_scenes_move_accordingly() -> None:
    frames = moving_texture((1.1, -0.6), (3, 40, 47))
    flow, confidence = estimate(frames, 1)
    cases = {
        "x": (frames[:, :, ::-1], lambda f: f[:, ::-1] * (-1, 1)),
        "y": (frames[:, ::-1], lambda f: f[::-1] * (1, -1)),
        "xy": (frames.transpose(0, 2, 1), lambda f: f.transpose(1, 0, 2)[..., ::-1]),
    }
    for name, (turned, back) in cases.items():
        again, sure = estimate(np.ascontiguousarray(turned), 1)
        # Six orientations are a set that mirrors map to itself; 30 and 60 degrees trade
        # places under transposition, and the factor that is made free of the mean with
        # them. Only the order of sums changes.
        np.testing.assert_allclose(back(again), flow, rtol=0, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(sure.sum(), confidence.sum(), rtol=1e-9)


def test_no_motion_is_exactly_no_motion() -> None:
    flow, confidence = estimate(
        moving_texture((0.0, 0.0), (4, 33, 41)), 1, double=False
    )
    np.testing.assert_array_equal(flow, 0.0)
    assert (confidence > 0).all()


def test_stripes_and_blank_frames_are_unknown() -> None:
    x = np.arange(48.0)
    stripes = np.stack([np.tile(np.cos(0.8 * (x - t)), (44, 1)) for t in range(3)])
    for frames in (stripes, stripes.transpose(0, 2, 1), np.full((3, 44, 48), 0.7)):
        flow, confidence = estimate(np.ascontiguousarray(frames), 1)
        inside = (slice(16, 28), slice(16, 32))
        assert np.isnan(flow[inside]).all(), "the aperture problem has no answer"
        assert (confidence[np.isnan(flow[..., 0])] == 0).all()


def test_shifted_scenes_have_shifted_flow() -> None:
    """Beyond the reach of the borders nothing tells where a pixel is."""
    given: dict[str, Any] = {"neighbourhood": 2.0, "passes": 1}
    shape = (2, 80, 84)
    a, _ = estimate(moving_texture((1.2, 0.3), shape), 0, **given)
    b, _ = estimate(moving_texture((1.2, 0.3), shape, offset=(5.0, 3.0)), 0, **given)
    # Reach: 16 px of filter, 2 of derivative, twice 5 of neighbourhood.
    inside = slice(28, -28)
    difference = (a[3:, 5:] - b[:-3, :-5])[inside, inside]
    # Largest amplitude and brightness, by which all is scaled, differ between the two
    # crops; they enter through the weights' soft knee, 2 % of the largest amplitude.
    assert np.abs(difference).max() < 2e-3
    assert np.abs((a[3:, 5:] - b[3:, 5:])[inside, inside]).max() > 2e-3


# The twin


@pytest.mark.parametrize(
    ("shape", "index", "given"),
    [
        ((2, 23, 29), 0, {}),
        ((7, 31, 20), 3, {}),
        ((4, 17, 13), 3, {"orientations": 5, "passes": 0}),
        ((5, 20, 21), 0, {"tuning_frequency": 0.2, "border": "reflect"}),
        ((3, 19, 22), 1, {"neighbourhood": 0.0, "passes": 1}),
        ((3, 19, 22), 1, {"time_sigma": 0.2, "robust": 0.1, "passes": 4}),
        ((3, 24, 18), 2, {"border": "zero", "tau": 0.6, "least_eigenvalue": 0.02}),
        ((6, 2, 30), 2, {"amplitude_fraction": 0.3}),
        ((2, 2, 2), 1, {}),
    ],
)
def test_flow_matches_the_twin(
    shape: tuple[int, int, int], index: int, given: dict[str, Any]
) -> None:
    frames = 100 + 40 * moving_texture((0.8, -0.5), shape, seed=5, band=(0.3, 1.6))
    values = PARAMETERS["least-squares"] | given
    expected, sure = twin(standardized(frames), index, **values)
    flow, confidence = estimate(frames, index, **given)
    np.testing.assert_array_equal(np.isnan(flow), np.isnan(expected))
    # Rounding of sums, 1e-15, over the least eigenvalue that counts, 1e-3 (and 1e-6 of
    # the scale where the pixel stands alone), through the reweighted passes.
    # On the line of symmetry of a mirrored border a response is real, its phase jumps
    # by half a turn and rounding chooses the sign; C^8 leaves such pixels 0.4 % of a
    # say.
    bound = 1e-4 if given.get("border") == "reflect" else 1e-9
    np.testing.assert_allclose(flow, expected, rtol=0, atol=bound)
    np.testing.assert_allclose(confidence, sure, rtol=0, atol=bound)
    single, single_sure = estimate(frames, index, double=False, **given)
    assert single.dtype == single_sure.dtype == np.float32
    known = np.isfinite(expected[..., 0]) & np.isfinite(single[..., 0])
    # Single precision: only pixels within rounding of ``least_eigenvalue`` may differ.
    assert (known != np.isfinite(expected[..., 0])).sum() <= 1
    held = known & (sure > 0.05)
    error = np.abs(single - expected)[held]
    # 1e-7 per sample over eigenvalues of 0.01 and more: 1e-5; a few 1e-4 where a
    # wrapped phase gives the reweighting a near tie.
    assert error.size == 0 or error.max() < 5e-4
    if min(shape[1:]) > 15:
        assert held.mean() > 0.3


def test_confidence_is_bounded_and_zero_exactly_where_flow_is_unknown(
    rng: np.random.Generator,
) -> None:
    frames = rng.normal(size=(3, 30, 32))
    frames[:, :, 16:] = 0.0
    flow, confidence = estimate(frames, 1, least_eigenvalue=0.05)
    unknown = np.isnan(flow).any(-1)
    assert 0 < unknown.sum() < unknown.size
    np.testing.assert_array_equal(confidence == 0, unknown)
    assert confidence.max() <= 1
    # Both components or none.
    np.testing.assert_array_equal(unknown, np.isnan(flow).all(-1))


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("neighbourhood", -1.0, r"in \[0, 100\] px, got -1"),
        ("time_sigma", 0.0, r"in \(0, 100\] frames, got 0"),
        ("robust", 0.0, "> 0 rad, got 0"),
        ("passes", 1000, "at most 100, got 1000"),
        ("least_eigenvalue", np.inf, ">= 0, got inf"),
        ("tau", -1.0, "> 0 deviations, got -1"),
    ],
)
def test_bad_parameters_are_named(name: str, value: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be {expected}"):
        estimate(np.zeros((2, 4, 4)), 0, **{name: value})
