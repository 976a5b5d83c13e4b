"""Component velocities: projections of a known motion, then their NumPy twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from reference import component_velocity as twin
from reference import fleet_jepson, gabor, phase_gradient
from textures import moving_texture
from unsmear import _unsmear
from unsmear._parameters import COMPONENT_PARAMETERS

Array = NDArray[Any]

TEMPORAL = ("steps", "gaussian", "velocity-tuned")


def planes_of(frames: Array, index: int, **given: Any) -> tuple[Array, Array]:
    """phi_x, phi_y, phi_t, v_x, v_y and amplitude (6, N, H, W); wavevectors (N, 2)."""
    planes, wavevectors = _unsmear.component_velocities(
        frames, index, COMPONENT_PARAMETERS | given
    )
    return planes, np.asarray(wavevectors)


# Laws


@pytest.mark.parametrize(
    ("temporal", "velocity"),
    # Without a carrier the window in time sees slow motion only, |k.v| < sigma_k.
    [
        ("steps", (1.1, -0.7)),
        ("steps", (-2.3, 0.4)),
        ("gaussian", (0.13, -0.1)),
        ("velocity-tuned", (0.5, -0.4)),
        ("velocity-tuned", (-1.2, 1.3)),
    ],
)
def test_components_are_projections_of_the_motion(
    temporal: str, velocity: tuple[float, float]
) -> None:
    frames = moving_texture(velocity, (17, 64, 68), waves=120, band=(0.6, 1.3))
    c = unsmear.component_velocities(frames, index=8, temporal=temporal)
    inside = (slice(None), slice(14, -14), slice(14, -14))
    phi, found = c.phase_gradient[inside], c.velocity[inside]
    space = phi[..., :2]
    along = (space @ np.array(velocity)) / (space**2).sum(-1)
    expected = along[..., None] * space
    known = np.isfinite(found).all(-1)
    assert known.mean() > 0.1
    error = np.hypot(*np.moveaxis(found - expected, -1, 0))[known]
    # A texture is no plane wave: the response's envelope moves with the pattern but
    # the linearised phase does not follow a whole step of motion (or a window of 17
    # frames) exactly. A wrong sign or a lost 2 pi is off by the speed and more.
    assert np.median(error) < 0.02 * (1 + np.hypot(*velocity))
    np.testing.assert_allclose(
        found[known][:, 0] * space[known][:, 1],
        found[known][:, 1] * space[known][:, 0],
        atol=1e-5,
    )


@pytest.mark.parametrize("temporal", TEMPORAL)
def test_still_frames_are_exactly_at_rest_and_blank_ones_unknown(temporal: str) -> None:
    still = moving_texture((0.0, 0.0), (7, 30, 33))
    c = unsmear.component_velocities(still, temporal=temporal)
    known = np.isfinite(c.velocity)
    if temporal == "velocity-tuned":
        # Filters tuned to motion see a still pattern as off their frequency.
        moving = unsmear.component_velocities(still, temporal=temporal).velocity[6:]
        assert np.isnan(moving).mean() > 0.5
        known, velocity = known[:6], c.velocity[:6]
    else:
        velocity = c.velocity
    assert known.mean() > 0.2
    np.testing.assert_array_equal(velocity[known], 0.0)
    blank = unsmear.component_velocities(np.full((7, 30, 33), 0.2), temporal=temporal)
    assert np.isnan(blank.velocity).all()
    assert (blank.amplitude == 0).all()


@pytest.mark.parametrize("temporal", TEMPORAL)
def test_reversed_time_reverses_the_components(temporal: str) -> None:
    frames = moving_texture((0.3, -0.2), (9, 32, 30))
    forward = unsmear.component_velocities(frames, index=4, temporal=temporal)
    backward = unsmear.component_velocities(frames[::-1], index=4, temporal=temporal)
    if temporal == "velocity-tuned":
        # The filter for motion along k becomes the one for motion against it: its
        # response is the conjugate, at -k, the same constraint.
        order = [
            *range(6),
            *range(11, 16),
            *range(6, 11),
            *range(19, 22),
            *range(16, 19),
        ]
        backward = type(backward)(
            *(np.asarray(part)[order] for part in vars(backward).values())
        )
    for a, b in ((forward.velocity, -backward.velocity),):
        same = np.isnan(a) == np.isnan(b)
        # Only pixels within rounding (1e-6) of a threshold may differ.
        assert (~same).mean() < 1e-3
        both = np.isfinite(a) & np.isfinite(b)
        # Single precision: 1e-7 of |R| max / |R| <= 20 (the amplitude test), times the
        # speed scale of rad/frame over rad/px.
        np.testing.assert_allclose(a[both], b[both], atol=1e-4)


def test_what_the_face_says_of_shapes_and_orientations() -> None:
    frames = moving_texture((0.3, -0.2), (5, 21, 26))
    c = unsmear.component_velocities(frames, orientations=4)
    assert c.velocity.shape == (4, 21, 26, 2)
    assert c.phase_gradient.shape == (4, 21, 26, 3)
    assert c.amplitude.shape == (4, 21, 26)
    np.testing.assert_allclose(c.orientation, np.arange(4) * np.pi / 4, atol=1e-12)
    assert {c.velocity.dtype, c.phase_gradient.dtype, c.amplitude.dtype} == {
        np.dtype(np.float32)
    }
    tuned = unsmear.component_velocities(frames, temporal="velocity-tuned")
    bank = gabor.velocity_tuned_wavevectors(COMPONENT_PARAMETERS["tuning_frequency"])
    turn = tuned.orientation - np.arctan2(bank[:, 1], bank[:, 0])
    np.testing.assert_allclose(np.cos(turn), 1.0, atol=1e-12)


def test_several_scales_follow_one_another() -> None:
    frames = moving_texture((0.3, -0.2), (3, 24, 26))
    shares: list[float] = []
    both = unsmear.component_velocities(
        frames, tuning_frequency=(0.2, 0.1), orientations=4, progress=shares.append
    )
    np.testing.assert_allclose(both.frequency, [0.2] * 4 + [0.1] * 4, rtol=1e-12)
    for place, f0 in ((slice(0, 4), 0.2), (slice(4, 8), 0.1)):
        alone = unsmear.component_velocities(
            frames, tuning_frequency=f0, orientations=4
        )
        for name, part in vars(alone).items():
            np.testing.assert_array_equal(vars(both)[name][place], part)
    assert shares == sorted(shares) and all(0 <= share <= 1 for share in shares)


def test_amplitudes_that_beat_are_sorted_out() -> None:
    # Two waves in one filter, drifting apart: |1 + exp(1.6 i t)|.
    t, y, x = np.ogrid[-1:2, :40, :40]
    frames = np.cos(0.9 * x + 0 * y) + np.cos(0.9 * x + 1.6 * t)
    near, far = (np.abs(1 + np.exp(1.6j * s)) for s in (0, 1))
    steadiness = 2 * near * far / (near**2 + far**2)
    middle = (0, slice(15, 25), slice(15, 25))
    # q = 0.938; the negative frequency adds 1e-3 of the response at the most.
    for least, kept in ((steadiness - 5e-3, True), (steadiness + 5e-3, False)):
        c = unsmear.component_velocities(
            frames, tuning_frequency=0.9 / (2 * np.pi), least_steadiness=float(least)
        )
        assert (np.isfinite(c.velocity[middle]) == kept).all()


@pytest.mark.parametrize(
    ("frames", "given", "message"),
    [
        ((1, 8, 8), {}, r"frames must have shape \(T >= 2"),
        ((2, 0, 8), {}, r"frames must have shape \(T >= 2, H >= 1, W >= 1\)"),
        ((2, 8, 8), {"temporal": "gaussian"}, r"frames must have shape \(T >= 3"),
        ((3, 8, 8), {"temporal": "gaussian", "index": 0}, "index must be in 1..=1"),
        ((3, 8, 8), {"index": 3}, r"index must be in -3\.\.2, got 3"),
        ((3, 8, 8), {"temporal": "fourier"}, 'temporal must be .*, got "fourier"'),
        ((3, 8, 8), {"tau": 0.0}, "tau must be > 0 deviations, got 0"),
        (
            (3, 8, 8),
            {"amplitude_fraction": 2.0},
            r"amplitude_fraction must be in \[0",
        ),
        ((3, 8, 8), {"sigma": 2.0}, "component_velocities has no parameter 'sigma'"),
        ((3, 8, 8), {"tuning_frequency": ()}, "at least one frequency, got none"),
        (
            (3, 8, 8),
            {"tuning_frequency": (0.1, 0.7)},
            "tuning_frequency must be .*, got 0.7",
        ),
        ((3, 8, 8), {"least_steadiness": 1.5}, r"least_steadiness must be in \[0, 1\]"),
    ],
)
def test_bad_calls_are_named(
    frames: tuple[int, int, int], given: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        unsmear.component_velocities(np.zeros(frames), **given)


# The twin


def expected_components(
    frames: Array, index: int, temporal: str, given: dict[str, Any]
) -> tuple[Array, Array, Array, Array]:
    """Gradients (N, H, W, 3), velocities, amplitudes and wavevectors of the twin."""
    f0, support, border = (
        given[key] for key in ("tuning_frequency", "support", "border")
    )
    sigma = gabor.window_sigma(f0, given["bandwidth_octaves"])
    centres = gabor.wavevectors(f0, given["orientations"])
    if temporal == "velocity-tuned":
        gradient, amplitude, centres, _ = fleet_jepson.components(
            frames, index, f0, given["bandwidth_octaves"], support, border
        )
        tested = centres
    else:
        gradients, amplitudes, steady = [], [], []
        for k in centres:
            phi = np.empty((*frames.shape[1:], 3))
            if temporal == "steps":
                responses = gabor.respond(frames, k, sigma, support, border)
                response = responses[index]
                phi[..., 2] = phase_gradient.mean_phase_step(responses, index)
                steady.append(twin.steadiness(responses, index))
            else:
                in_time = gabor.respond_in_time(frames, index, 0.0, sigma, support)
                response, slope = (
                    gabor.respond(part, k, sigma, support, border) for part in in_time
                )
                phi[..., 2] = phase_gradient.time_slope(response, slope, 0.0)
            phi[..., :2] = phase_gradient.spatial_gradient(response, k)
            gradients.append(phi)
            amplitudes.append(np.abs(response))
        gradient, amplitude = np.array(gradients), np.array(amplitudes)
        tested = centres
    least = twin.amplitude_floor(frames, amplitude, given["amplitude_fraction"])
    deviation = np.array(
        [
            twin.frequency_deviation(phi, k, sigma)
            for phi, k in zip(gradient, tested, strict=True)
        ]
    )
    valid = (amplitude >= least) & (deviation <= given["tau"])
    if temporal == "steps":
        valid &= np.array(steady) >= given["least_steadiness"]
    velocity = twin.component_velocity(gradient, valid)
    return gradient, velocity, amplitude, centres[:, :2]


@pytest.mark.parametrize(
    ("shape", "index", "given"),
    [
        ((9, 24, 27), 4, {}),
        ((13, 15, 19), 6, {"tuning_frequency": 0.23, "orientations": 5}),
        ((4, 11, 13), 1, {"border": "reflect", "amplitude_fraction": 0.2}),
        ((5, 17, 2), 3, {"border": "zero", "tau": 2.0}),
        ((3, 2, 9), 1, {"support": 2.0, "bandwidth_octaves": 1.5}),
        ((4, 13, 12), 2, {"least_steadiness": 0.99}),
    ],
)
@pytest.mark.parametrize("temporal", TEMPORAL)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_components_match_the_twin(
    shape: tuple[int, int, int],
    index: int,
    given: dict[str, Any],
    temporal: str,
    dtype: type[np.floating],
) -> None:
    frames = moving_texture((0.4, -0.3), shape, seed=3).astype(dtype)
    bank = COMPONENT_PARAMETERS | given | {"temporal": temporal}
    planes, wavevectors = planes_of(frames, index, **bank)
    assert planes.dtype == dtype
    gradient, velocity, amplitude, centres = expected_components(
        frames.astype(np.float64), index, temporal, bank
    )
    np.testing.assert_allclose(wavevectors, centres, rtol=0, atol=1e-14)
    # Sums of order 1 over 25 x 25 x 15 products.
    unit = {np.float64: 1e-14, np.float32: 4e-6}[dtype]
    np.testing.assert_allclose(planes[5], amplitude, rtol=0, atol=unit)
    # The gradient divides by |R|: its rounding grows as 1/|R|.
    strong = amplitude > 0.02 * amplitude.max()
    assert strong.mean() > 0.5
    if temporal == "steps":
        # At the line of symmetry of a mirrored border, and all over a picture of two
        # rows, which its border continues symmetrically, responses are real and their
        # phase jumps by half a turn, of which rounding chooses the sign.
        jumps = np.abs(np.abs(planes[2] - gradient[..., 2]) - np.pi) < 1e-5
        assert jumps.sum() <= 10
        gradient[..., 2][jumps] = planes[2][jumps]
        velocity[jumps] = np.moveaxis(planes[3:5], 0, -1)[jumps]
    # rad; unit / |R|, a few derivatives' weights on top.
    bound = 10 * unit / amplitude[strong]
    for part in range(3):
        error = np.abs(planes[part] - gradient[..., part])[strong]
        assert (error <= bound).all(), (part, (error / bound).max())
    found = np.moveaxis(planes[3:5], 0, -1)
    differ = (np.isnan(found) != np.isnan(velocity)).any(-1)
    # A test's outcome may differ only within rounding of its threshold: none seen in
    # double precision, a handful of pixels in single.
    assert differ.sum() <= (0 if dtype is np.float64 else 2)
    both = ~np.isnan(velocity).any(-1) & ~np.isnan(found).any(-1)
    assert both.any()
    # v = phi_t / |phi|, |phi| >= k0 - tau sigma_k > 0.4 rad/px where it passed.
    error = np.abs(found - velocity).max(-1)[both]
    assert (error <= 40 * unit / amplitude[both]).all()
