"""Responses of the corrected Gabor bank: its laws, then its NumPy twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference import gabor as twin
from unsmear import _unsmear

Array = NDArray[Any]

BANK: dict[str, Any] = {
    "tuning_frequency": 0.15,
    "bandwidth_octaves": 0.8,
    "orientations": 6,
    "support": 3.0,
    "border": "replicate",
}


def respond(picture: Array, **given: Any) -> Array:
    return _unsmear.gabor_phase_gradient(picture, BANK | given)[0]


def test_the_window_has_its_two_pi() -> None:
    """An impulse shows the kernel: its second moment is sigma, not 2 pi sigma."""
    impulse = np.zeros((61, 61))
    impulse[30, 30] = 1.0
    envelope = np.abs(respond(impulse)[3])
    x = np.arange(61) - 30.0
    measured = np.sqrt((envelope * x[None] ** 2).sum() / envelope.sum())
    k0 = 2 * np.pi * 0.15
    ratio = 2**0.8
    sigma = (ratio + 1) / ((ratio - 1) * k0)
    # Cutting at 3 deviations takes 1.5 % off the second moment's root.
    assert measured == pytest.approx(sigma, rel=0.02)


def test_a_wave_answers_its_own_filter_and_its_phase_advances_along_k() -> None:
    y, x = np.mgrid[:48, :50].astype(float)
    inside = (slice(14, 34), slice(14, 36))
    for filter_, k in enumerate(twin.wavevectors(0.15, 6)):
        phase = k[0] * x + k[1] * y
        response = respond(np.cos(phase))[filter_]
        # Half the amplitude, but for what lies beyond 3 deviations (0.3 %), the leak of
        # the conjugate wave and the freedom from the mean (both below 0.2 %).
        wave = np.exp(1j * phase)
        np.testing.assert_allclose(response[inside], wave[inside] / 2, atol=2.5e-3)
        others = np.delete(np.abs(respond(np.cos(phase)))[:, 24, 25], filter_)
        # The neighbours' centres are 2 sin(15 deg) k0 = 0.518 k0 away, k0 sigma = 3.70:
        # exp(-(0.518 * 3.70)^2 / 2) = 0.16 of the half amplitude.
        assert others.max() < 0.5 * 0.18


def test_constant_brightness_has_no_answer() -> None:
    for orientations in (2, 3, 4, 5, 6, 7):
        response = respond(np.full((17, 19), 255.0), orientations=orientations)
        # Two passes of 25 taps of order 0.1 on 255 round at 1e-13.
        assert np.abs(response).max() < 1e-11


@pytest.mark.parametrize("orientations", [2, 3, 5, 6, 8])
@pytest.mark.parametrize("border", ["replicate", "reflect", "zero"])
def test_mirrored_pictures_answer_mirrored_filters(
    border: str, orientations: int, rng: np.random.Generator
) -> None:
    picture = rng.normal(size=(21, 26))
    given = {"border": border, "orientations": orientations}
    plain = respond(picture, **given)
    in_x = respond(picture[:, ::-1], **given)[:, :, ::-1]
    in_y = respond(picture[::-1], **given)[:, ::-1]
    for filter_ in range(orientations):
        mirror = -filter_ % orientations
        # (-kx, ky) is the filter at pi - theta, or on the x axis its own conjugate, and
        # (kx, -ky) the conjugate of that. Rounding of 25 x 25 products of order 1.
        expected = plain[mirror] if filter_ else plain[0].conj()
        np.testing.assert_allclose(in_x[filter_], expected, atol=1e-13)
        expected = plain[mirror].conj() if filter_ else plain[0]
        np.testing.assert_allclose(in_y[filter_], expected, atol=1e-13)


def test_shifted_pictures_have_shifted_responses(rng: np.random.Generator) -> None:
    wide = rng.normal(size=(60, 70))
    radius = 13  # ceil(3 sigma), sigma = 4.07
    a = respond(wide[:50, :60])[:, radius:-radius, radius:-radius]
    b = respond(wide[3:53, 5:65])[:, radius:-radius, radius:-radius]
    # The same samples meet the same taps, so even the rounding agrees.
    np.testing.assert_array_equal(a[:, 3:, 5:], b[:, :-3, :-5])


@pytest.mark.parametrize("border", ["replicate", "reflect", "zero"])
@pytest.mark.parametrize(
    ("shape", "given"),
    [
        ((1, 1), {}),
        ((1, 7), {}),
        ((5, 1), {"orientations": 4}),
        ((2, 2), {"orientations": 2}),
        ((13, 17), {"orientations": 5, "tuning_frequency": 0.31}),
        ((31, 40), {"bandwidth_octaves": 1.6, "support": 2.3}),
        ((23, 97), {"orientations": 7, "tuning_frequency": 0.06}),
    ],
)
def test_responses_match_the_twin(
    shape: tuple[int, int], given: dict[str, Any], border: str, rng: np.random.Generator
) -> None:
    picture = rng.normal(size=shape)
    bank = BANK | given | {"border": border}
    sigma = twin.window_sigma(bank["tuning_frequency"], bank["bandwidth_octaves"])
    response = respond(picture, **bank)
    centres = twin.wavevectors(bank["tuning_frequency"], bank["orientations"])
    assert response.shape == (len(centres), *shape)
    for filter_, k in enumerate(centres):
        expected = twin.respond(picture, k, sigma, bank["support"], border)
        # Sums of up to 63 products per axis of order 1, in another order.
        np.testing.assert_allclose(response[filter_], expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("tuning_frequency", 0.5, r"in \(0, 0.5\) cycles/px, got 0.5"),
        ("tuning_frequency", 0.0, r"in \(0, 0.5\) cycles/px, got 0"),
        ("tuning_frequency", np.nan, r"in \(0, 0.5\) cycles/px, got NaN"),
        ("bandwidth_octaves", -1.0, r"in \(0, 3\], got -1"),
        ("orientations", 1, r"in 2..=64, got 1"),
        ("support", 0.5, r"in \[1, 6\] deviations, got 0.5"),
        ("border", "wrap", r'"replicate", "reflect" or "zero", got "wrap"'),
    ],
)
def test_bad_parameters_are_named(name: str, value: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be {expected}"):
        respond(np.zeros((4, 4)), **{name: value})
