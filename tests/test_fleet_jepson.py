"""Velocity-tuned filters and local affine least squares: laws, then the NumPy twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference.fleet_jepson import fleet_jepson as twin
from textures import moving_texture, standardized
from unsmear import _unsmear
from unsmear._parameters import PARAMETERS

Array = NDArray[Any]

INSIDE = (slice(12, -12), slice(12, -12))


def estimate(
    frames: Array, index: int, *, double: bool = True, **given: Any
) -> tuple[Array, Array]:
    values = PARAMETERS["fleet-jepson"] | given
    return _unsmear.fleet_jepson(frames, index, values, double=double)


# Mathematics


@pytest.mark.parametrize(
    "velocity", [(0.5, -0.4), (-1.0, 1.2), (0.0, 1.7), (0.1, 0.0), (1.9, -0.5)]
)
def test_a_translation_is_measured(velocity: tuple[float, float]) -> None:
    frames = moving_texture(velocity, (15, 56, 60), waves=150, band=(1.0, 2.0))
    flow, confidence = estimate(frames, 7)
    found = flow[INSIDE]
    known = np.isfinite(found).all(-1)
    assert known.mean() > 0.5
    error = np.hypot(*np.moveaxis(found - velocity, -1, 0))[known]
    # A steady translation of a dense texture: the window in time and its five-point
    # slope are exact to 1e-3 rad/frame, over 1.2 rad/px.
    assert np.median(error) < 0.01
    assert confidence[INSIDE][known].min() >= 0


def test_mirrored_scenes_and_reversed_time_move_accordingly() -> None:
    frames = moving_texture((0.7, -0.5), (11, 34, 38), waves=150, band=(1.0, 2.0))
    flow, _ = estimate(frames, 5)
    assert np.isfinite(flow).mean() > 0.2
    cases = {
        "x": (frames[:, :, ::-1], lambda f: f[:, ::-1] * (-1, 1)),
        "y": (frames[:, ::-1], lambda f: f[::-1] * (1, -1)),
        "t": (frames[::-1], lambda f: -f),
    }
    for name, (turned, back) in cases.items():
        again = back(estimate(np.ascontiguousarray(turned), 5)[0])
        # Each ring of directions is mapped to itself; only the order of sums changes. A
        # test passed within rounding of its threshold may turn: none of these does.
        np.testing.assert_array_equal(np.isnan(again), np.isnan(flow), err_msg=name)
        np.testing.assert_allclose(again, flow, rtol=0, atol=1e-9, err_msg=name)


def test_no_motion_is_exactly_no_motion_and_blank_frames_are_unknown() -> None:
    still = moving_texture((0.0, 0.0), (15, 36, 38), waves=150, band=(1.0, 2.0))
    flow, _ = estimate(still, 7, double=False)
    known = np.isfinite(flow)
    assert known.mean() > 0.5
    np.testing.assert_array_equal(flow[known], 0.0)
    flow, confidence = estimate(np.full((15, 20, 22), 17.0), 7)
    assert np.isnan(flow).all()
    assert (confidence == 0).all()


def test_an_expansion_is_followed_by_the_affine_model() -> None:
    """Dilation by 1 % per frame, flow 0.01 (x - x0): not its mean over a window."""
    rng = np.random.default_rng(4)
    angle, phase = rng.uniform(0, 2 * np.pi, (2, 150))
    length = rng.uniform(1.0, 2.0, 150)
    t, y, x = np.mgrid[:15, :60, :64].astype(float)
    scale = np.exp(-0.01 * (t - 7))
    px, py = (x - 20) * scale, (y - 25) * scale
    frames = np.zeros(t.shape)
    for a, k, p in zip(angle, length, phase, strict=True):
        frames += np.cos(k * (np.cos(a) * px + np.sin(a) * py) + p)
    flow, _ = estimate(frames, 7)
    truth = 0.01 * np.stack([x[0] - 20, y[0] - 25], -1)
    found, true = flow[INSIDE], truth[INSIDE]
    known = np.isfinite(found).all(-1)
    assert known.mean() > 0.4
    error = np.hypot(*np.moveaxis(found - true, -1, 0))[known]
    assert np.median(error) < 0.01


# The twin


@pytest.mark.parametrize(
    ("shape", "index", "given"),
    [
        ((15, 26, 29), 7, {}),
        ((3, 20, 23), 1, {}),
        ((8, 17, 19), 2, {"border": "reflect", "window_radius": 3}),
        ((9, 16, 13), 5, {"border": "zero", "residual_limit": 0.3, "tau": 1.8}),
        ((7, 19, 17), 3, {"tuning_frequency": 0.18, "condition_limit": 30.0}),
        ((6, 15, 31), 3, {"least_constraints": 40, "amplitude_fraction": 0.2}),
        ((5, 2, 3), 2, {"least_constraints": 0, "window_radius": 1}),
    ],
)
def test_flow_matches_the_twin(
    shape: tuple[int, int, int], index: int, given: dict[str, Any]
) -> None:
    frames = 30 * moving_texture((0.6, -0.4), shape, seed=9, waves=150, band=(0.8, 2.0))
    values = PARAMETERS["fleet-jepson"] | given
    expected, sure = twin(standardized(frames), index, **values)
    flow, confidence = estimate(frames, index, **given)
    np.testing.assert_array_equal(np.isnan(flow), np.isnan(expected))
    # Rounding of the moments, 1e-15 of the trace, times the condition (8 of means, so
    # up to a few hundred of the extreme eigenvalues), and of phases at weak responses.
    np.testing.assert_allclose(flow, expected, rtol=0, atol=1e-9)
    # The residual is the root of a difference: half the digits of 1e-15 at worst.
    np.testing.assert_allclose(confidence, sure, rtol=0, atol=2e-6)
    single, _ = estimate(frames, index, double=False, **given)
    assert single.dtype == np.float32
    differ = np.isnan(single[..., 0]) != np.isnan(expected[..., 0])
    # Single precision: 1e-6 in a residual or amplitude decides for a pixel or two.
    assert differ.sum() <= 3
    both = np.isfinite(single) & np.isfinite(expected)
    assert both.any() or min(shape[1:]) < 5
    # 1e-6 rad/frame over 1.5 rad/px, times the square root of the condition.
    assert np.abs(single - expected)[both].max(initial=0.0) < 5e-4


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("window_radius", 0, r"in 1\.\.=50 px, got 0"),
        ("condition_limit", 1.0, "> 1, got 1"),
        ("residual_limit", 0.0, "> 0 px/frame, got 0"),
        ("amplitude_fraction", -0.1, r"in \[0, 1\], got -0.1"),
        ("support", 9.0, r"in \[1, 6\] deviations, got 9"),
    ],
)
def test_bad_parameters_are_named(name: str, value: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be {expected}"):
        estimate(np.zeros((3, 4, 4)), 1, **{name: value})


@pytest.mark.parametrize("index", [0, 4, 7])
def test_the_reference_frame_needs_neighbours(index: int) -> None:
    with pytest.raises(ValueError, match=rf"index must be in 1..=3 .*, got {index}"):
        estimate(np.zeros((5, 4, 4)), index)
