"""Phase gradient of the bank's responses: plane waves, then its NumPy twin.

The gradient divides by |R|^2, so rounding of R grows as max|R| / |R| near the zeros of
a response; comparisons scale their bound by just that.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference import gabor, phase_gradient
from unsmear import _unsmear

Array = NDArray[Any]

BANK: dict[str, Any] = {
    "tuning_frequency": 0.15,
    "bandwidth_octaves": 0.8,
    "orientations": 6,
    "support": 3.0,
    "border": "replicate",
}
K0 = 2 * np.pi * 0.15


def gradient(picture: Array, **given: Any) -> tuple[Array, Array, Array]:
    return _unsmear.gabor_phase_gradient(picture, BANK | given)


@pytest.mark.parametrize("detuning", [(0.0, 0.0), (0.25, 0.0), (-0.2, 0.15)])
@pytest.mark.parametrize("filter_", range(6))
def test_a_wave_has_its_own_wavevector(
    filter_: int, detuning: tuple[float, float]
) -> None:
    k = gabor.wavevectors(0.15, 6)[filter_] + detuning
    y, x = np.mgrid[:48, :50]
    _, phi_x, phi_y = gradient(np.cos(k[0] * x + k[1] * y + 0.3))
    inside = (filter_, slice(16, 32), slice(16, 34))
    # The five-point rule errs by d^5/30 (3e-5); the conjugate wave, 2 k0 away, leaks
    # exp(-2 (k0 - |d|)^2 sigma^2 ...) of the amplitude through the window cut at 3
    # deviations: 0.6 % at worst, which turns the gradient by up to 2 k0 times that.
    np.testing.assert_allclose(phi_x[inside], k[0], rtol=0, atol=0.012)
    np.testing.assert_allclose(phi_y[inside], k[1], rtol=0, atol=0.012)


def test_contrast_and_brightness_do_not_matter(rng: np.random.Generator) -> None:
    picture = rng.normal(size=(24, 25))
    response, *plain = gradient(picture)
    # Powers of two: the same ratios, bit for bit.
    for a, b in zip(plain, gradient(picture * 8.0)[1:], strict=True):
        np.testing.assert_array_equal(a, b)
    lifted = gradient(picture + 100.0)[1:]
    # The bank sees no mean: what is left is rounding of 100, divided by |R|.
    bound = 1e-11 / np.abs(response)
    for a, b in zip(plain, lifted, strict=True):
        assert (np.abs(a - b) <= bound).all()


def test_no_response_has_no_phase() -> None:
    response, phi_x, phi_y = gradient(np.zeros((6, 7)))
    assert (response == 0).all()
    assert np.isnan(phi_x).all()
    assert np.isnan(phi_y).all()


@pytest.mark.parametrize("border", ["replicate", "reflect", "zero"])
@pytest.mark.parametrize(
    ("shape", "given"),
    [
        ((2, 2), {}),
        ((3, 2), {"orientations": 4}),
        ((19, 23), {"orientations": 5, "tuning_frequency": 0.24}),
        ((40, 37), {}),
    ],
)
def test_gradients_match_the_twin(
    shape: tuple[int, int], given: dict[str, Any], border: str, rng: np.random.Generator
) -> None:
    picture = rng.normal(size=shape)
    bank = BANK | given | {"border": border}
    response, phi_x, phi_y = gradient(picture, **bank)
    centres = gabor.wavevectors(bank["tuning_frequency"], bank["orientations"])
    largest = np.abs(response).max()
    for filter_, k in enumerate(centres):
        expected = phase_gradient.spatial_gradient(response[filter_], k)
        bound = 1e-14 * largest / np.abs(response[filter_])
        for part, phi in enumerate((phi_x, phi_y)):
            error = np.abs(phi[filter_] - expected[..., part])
            # About 20 products of order |R| max: a few tens of eps (2.2e-16).
            assert (error <= bound).all(), (error / bound).max()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_pictures_of_one_line_have_the_tuned_gradient_across(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    _, phi_x, phi_y = gradient(rng.normal(size=shape))
    centres = gabor.wavevectors(0.15, 6)
    # One sample says nothing of the change along its axis: the carrier's own remains.
    sides = ((shape[1], phi_x, centres[:, 0]), (shape[0], phi_y, centres[:, 1]))
    for size, phi, k in sides:
        assert phi.shape == (6, *shape)
        assert not np.isnan(phi).any()
        if size == 1:
            expected = np.broadcast_to(k[:, None, None], phi.shape)
            np.testing.assert_allclose(phi, expected, rtol=0, atol=1e-12)


def test_frequency_is_in_cycles_outside_and_radians_inside() -> None:
    x = np.arange(64)
    picture = np.cos(2 * np.pi * 0.15 * x)[None].repeat(40, axis=0)
    _, phi_x, _ = gradient(picture)
    assert phi_x[0, 20, 32] == pytest.approx(K0, abs=5e-3)
