"""The founding flow method: symmetries, its NumPy twin, then the recorded listings.

Tolerances are those argued in test_reference.py: both sides compute in float64 and
differ by the rounding of transforms, 1e-13 of the largest value (LINEAR), amplified
where velocities divide by |R|^2 and |grad phi|^2 (RATIO).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from reference import thesis_flow as twin
from reference.golden import assert_close, golden, ours
from textures import moving_texture
from unsmear import _unsmear
from unsmear._parameters import PARAMETERS

Array = NDArray[Any]

LINEAR = 1e-12
RATIO = 1e-11
LIMITS = (5.0, 2.0)
LEAST = 10 / 12
STAGED = ("of_a", "of_b", "of_c", "of_d")
COMPONENTS = ("Vxn", "Vyn")
GATES = ("Vxd4", "Vyd4", "Vxns", "Vyns", "Vxd3", "Vyd3", "Vx", "Vy", "Vx15", "Vy15")


def parameters(**given: Any) -> dict[str, Any]:
    return PARAMETERS["thesis"] | given


def estimate(frames: Array, **given: Any) -> Array:
    return _unsmear.thesis_flow(np.ascontiguousarray(frames), parameters(**given))


def tuning(stored: dict[str, Array]) -> dict[str, float]:
    return {
        "tuning_frequency": stored["f0"].item(),
        "bandwidth_octaves": stored["beta"].item(),
    }


# Symmetries


def test_contrast_does_not_matter_and_time_reversal_negates(
    rng: np.random.Generator,
) -> None:
    frames = rng.normal(size=(3, 15, 18))
    forward = estimate(frames, tuning_frequency=0.15)
    # Powers of two scale without rounding, and every ratio of them is the same.
    np.testing.assert_array_equal(
        estimate(frames * 4.0, tuning_frequency=0.15), forward
    )
    assert_close(-estimate(frames[::-1], tuning_frequency=0.15), forward, RATIO)


def test_blank_frames_are_unknown_and_still_ones_at_rest() -> None:
    assert np.isnan(estimate(np.zeros((3, 8, 10)))).all()
    still = moving_texture((0.0, 0.0), (3, 16, 18))
    np.testing.assert_array_equal(estimate(still, zero_static="velocity"), 0.0)
    # Not masked, what is left is the rounding of Im(conj(R) R) / |R|^2.
    assert np.abs(estimate(still)).max() < 1e-9


def test_speeds_point_the_right_way_and_are_far_too_low() -> None:
    """The published mean of normal velocities: half the speed, times 4/9 of time."""
    for u, v in ((0.9, 0.0), (0.0, 0.8), (-0.6, 0.7)):
        frames = moving_texture((u, v), (3, 40, 44), band=(0.5, 1.2))
        found = np.median(estimate(frames, tuning_frequency=0.15), axis=(0, 1))
        speed, true = np.hypot(*found), np.hypot(u, v)
        assert found @ (u, v) > 0.95 * speed * true
        assert 0.05 * true < speed < 0.5 * true


# The twin


@pytest.mark.parametrize("interpolate", [False, True])
@pytest.mark.parametrize("zero_static", ["none", "velocity", "image+velocity"])
@pytest.mark.parametrize(
    "shape", [(3, 12, 16), (4, 11, 14), (5, 10, 13), (2, 9, 9), (2, 16, 7), (6, 3, 12)]
)
def test_flow_matches_the_twin(
    shape: tuple[int, int, int],
    zero_static: Literal["none", "velocity", "image+velocity"],
    interpolate: bool,
    rng: np.random.Generator,
) -> None:
    frames = rng.normal(size=shape)
    frames[:, : shape[1] // 3, : shape[2] // 3] = frames[0, 0, 0]  # a static block
    given: dict[str, Any] = {
        # High enough for no filter of so small a picture to end up at zero frequency,
        # where the phase is constant and its gradient rounding.
        "tuning_frequency": 0.2,
        "bandwidth_octaves": 0.9,
        "zero_static": zero_static,
        "interpolate": interpolate,
        "std_limit": 0.4,  # low enough for the gates to bind
        "distance_limit": 1.5,
        "least_fraction": 0.8,
    }
    expected = np.stack(twin.flow(frames, **given), axis=-1)
    assert np.isfinite(expected).any()
    assert_close(estimate(frames, **given), expected, RATIO)


# The recordings


def recorded_stages(name: str) -> dict[str, Array]:
    """Everything the core computes for one recording, under the recording's names."""
    stored = golden(name)
    frames = ours(stored["I"])
    given = parameters(zero_static="image+velocity", **tuning(stored))
    stages = _unsmear.thesis_stages(frames, given)
    bank = _unsmear.thesis_bank(frames.shape, *tuning(stored).values())
    taps = bank["temporal_taps"]
    zeroed = frames * stages["moving"]
    made = {
        "I_zeroed": zeroed,
        "static_mask": stages["moving"],
        "sigma": np.array([[bank["sigma"]]]),
        "w0deg": bank["angles"][None],
        "gt": taps[None],
        "gabor_untrimmed": bank["windows"],
        "gmask": bank["kept"] * 1.0,
        "gabor": bank["kernels"],
        "R": stages["responses"],
        "phiX": stages["phi_x"],
        "phiY": stages["phi_y"],
        "phiT": stages["phi_t"],
        "Vxn": stages["un"],
        "Vyn": stages["vn"],
    }
    # The responses of one frame among blank ones, seen through the middle temporal
    # tap, are those before the filter in time.
    alone = parameters(**tuning(stored))
    before = np.zeros_like(stages["responses"])
    for t in range(len(frames)):
        single = np.zeros_like(frames)
        single[t] = zeroed[t]
        response = _unsmear.thesis_stages(single, alone)["responses"][:, t]
        before[:, t] = response / taps[len(taps) // 2]
    return made | {"I2D": before}


@pytest.mark.parametrize("name", STAGED)
def test_stages_match_the_recordings(name: str) -> None:
    stored = golden(name)
    made = recorded_stages(name)
    given = {"I", "f0", "beta", "v_true"}
    # Every recorded array is compared, here or with the gates below.
    assert stored.keys() - given - set(GATES) <= made.keys()
    for key in stored.keys() & made.keys():
        expected = stored[key]
        if key in ("gabor_untrimmed", "gmask", "gabor"):
            expected = np.moveaxis(expected, -1, 0)
        elif expected.ndim > 2:
            expected = ours(expected)
        ratio = key.startswith(("phi", "V"))
        assert_close(made[key], expected, RATIO if ratio else LINEAR)


def gated(values: Array, limits: tuple[float, float]) -> tuple[Array, Array]:
    """Gate and mean over the first axis, by the core."""
    flat = np.ascontiguousarray(values.reshape(len(values), -1))
    rest, means = _unsmear.thesis_gated_mean(flat, *limits, LEAST)
    return rest.reshape(values.shape), means.reshape(values.shape[1:])


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("name", [*STAGED, "valid_vel"])
def test_gates_and_means_match_the_recordings(name: str, axis: str) -> None:
    stored = golden(name)
    over_filters, means = gated(ours(stored[f"V{axis}n"]), LIMITS)
    over_frames, result = gated(means, LIMITS)
    made = {"d4": over_filters, "ns": means, "d3": over_frames, "": result}
    if name == "valid_vel":
        assert np.isnan(over_filters).sum() > np.isnan(stored[f"V{axis}n"]).sum()
        tight_means = gated(ours(stored[f"V{axis}n"]), (1.5, 2.0))[1]
        made["15"] = gated(tight_means, (1.5, 2.0))[1]
    for key, actual in made.items():
        if f"V{axis}{key}" in stored:
            expected = stored[f"V{axis}{key}"]
            expected = expected if expected.ndim == 2 else ours(expected)
            assert_close(actual, expected, LINEAR)
        else:
            assert (name, key) == ("of_d", "d4")


@pytest.mark.parametrize("name", [*STAGED, "of_48x64", "of_interp"])
def test_flow_matches_the_recordings(name: str) -> None:
    stored = golden(name)
    untold = {"of_48x64": 0.06, "of_interp": 0.15}
    tuned = (
        {"tuning_frequency": untold[name], "bandwidth_octaves": 0.8}
        if name in untold
        else tuning(stored)
    )
    found = estimate(
        ours(stored["I"]).astype(np.float64),
        zero_static="image+velocity",
        interpolate=name == "of_interp",
        **tuned,
    )
    assert_close(found[..., 0], stored["Vx"], RATIO)
    assert_close(found[..., 1], stored["Vy"], RATIO)
    if "Vxns" in stored and name in untold:
        frames = np.ascontiguousarray(ours(stored["I"]), dtype=np.float64)
        given = parameters(zero_static="image+velocity", **tuned)
        stages = _unsmear.thesis_stages(frames, given)
        assert_close(gated(stages["un"], LIMITS)[1], ours(stored["Vxns"]), RATIO)
        assert_close(gated(stages["vn"], LIMITS)[1], ours(stored["Vyns"]), RATIO)


def test_the_face_hands_its_options_through() -> None:
    stored = golden("of_interp")
    result = unsmear.optical_flow(
        ours(stored["I"]),
        method="thesis",
        tuning_frequency=0.15,
        zero_static="image+velocity",
        interpolate=True,
    )
    # float32 outside: half a unit of its last place, 6e-8 of the largest value.
    assert_close(result.flow[..., 0], stored["Vx"], 1e-7)
    assert_close(result.flow[..., 1], stored["Vy"], 1e-7)
    np.testing.assert_array_equal(result.confidence, result.valid * 1.0)
