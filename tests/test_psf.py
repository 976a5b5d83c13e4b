"""Kernels of motion: their laws, then the slow twin, then the recorded cases."""

from __future__ import annotations

import numpy as np
import pytest
import unsmear
from numpy.testing import assert_allclose
from reference.golden import golden
from reference.psf import motion_psf as slow_motion_psf

MOTIONS = [(0.0, 0.0), (7.0, 0.0), (0.0, 3.4), (5.3, -2.1), (-11.3, 8.7), (1e-4, 0.3)]


def centroid(psf: np.ndarray) -> tuple[float, float]:
    y, x = np.indices(psf.shape)
    y, x = y - psf.shape[0] // 2, x - psf.shape[1] // 2
    return float((psf * x).sum()), float((psf * y).sum())


@pytest.mark.parametrize(("u", "v"), MOTIONS)
def test_is_a_centred_symmetric_distribution(u: float, v: float) -> None:
    psf = unsmear.motion_psf(u, v)
    assert psf.shape[0] % 2 == psf.shape[1] % 2 == 1
    assert (psf >= 0).all()
    # Rounding of some hundred additions.
    assert_allclose(psf.sum(), 1.0, atol=1e-13)
    assert_allclose(centroid(psf), 0.0, atol=1e-12)
    assert_allclose(psf, psf[::-1, ::-1], atol=1e-14)


@pytest.mark.parametrize(("u", "v"), MOTIONS)
def test_turns_and_flips_with_the_motion(u: float, v: float) -> None:
    psf = unsmear.motion_psf(u, v)
    # The same pieces in another order: rounding only.
    assert_allclose(unsmear.motion_psf(-u, v), psf[:, ::-1], atol=1e-14)
    assert_allclose(unsmear.motion_psf(v, u), psf.T, atol=1e-14)


@pytest.mark.parametrize(("u", "v"), MOTIONS)
def test_equals_the_slow_twin(u: float, v: float) -> None:
    # Simpson's rule and Gauss's two points are both exact for the pieces.
    assert_allclose(unsmear.motion_psf(u, v), slow_motion_psf(u, v), atol=1e-14)


def test_no_motion_is_a_delta_and_whole_motion_a_box() -> None:
    assert_allclose(unsmear.motion_psf(0, 0), [[1.0]])
    box = [[0.1, 0.2, 0.2, 0.2, 0.2, 0.1]]
    expected = np.convolve(np.full(5, 0.2), [0.5, 0.5])[np.newaxis]
    assert_allclose(expected, box, atol=1e-15)
    # Five pixels centred on a pixel: the box from -2.5 to 2.5, spread by the tent.
    psf = unsmear.motion_psf(5, 0)
    assert_allclose(psf, [[0.025, 0.175, 0.2, 0.2, 0.2, 0.175, 0.025]], atol=1e-15)


def test_acceleration_moves_the_centroid_by_a_24th() -> None:
    psf = unsmear.motion_psf(9, 1, acceleration=(-3, 6))
    # Chords within 1e-4 px of the path.
    assert_allclose(centroid(psf), (-3 / 24, 6 / 24), atol=1e-4)
    backwards = unsmear.motion_psf(-9, -1, acceleration=(-3, 6))
    # The same path run in the other sense.
    assert_allclose(psf, backwards, atol=1e-13)


def test_acceleration_equals_a_dense_sum_of_instants() -> None:
    velocity, acceleration = np.array([6.0, -2.0]), np.array([4.0, 5.0])
    psf = unsmear.motion_psf(*velocity, acceleration=tuple(acceleration))
    count = 20_000
    t = (np.arange(count) + 0.5)[:, None] / count - 0.5
    path = t * velocity + t**2 / 2 * acceleration
    y, x = np.indices(psf.shape)
    y, x = y - psf.shape[0] // 2, x - psf.shape[1] // 2
    dense = sum(
        np.maximum(0, 1 - abs(x - px)) * np.maximum(0, 1 - abs(y - py))
        for px, py in path
    )
    # Tents have slope 1: 1e-4 px of chord error moves a weight by less than 1e-4.
    assert_allclose(psf, dense / count, atol=1e-4)


def test_fspecial_equals_the_recorded_cases() -> None:
    stored = golden("psf")
    for k, (length, angle) in enumerate(stored["len_theta"]):
        # Different mathematics libraries: a few units in the last place of 1.
        assert_allclose(
            unsmear.fspecial_motion(length, angle),
            stored[f"psf_{k:03d}"],
            atol=1e-15,
            err_msg=f"case {k}: length {length}, angle {angle}",
        )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: unsmear.motion_psf(np.nan, 0), "u must be finite"),
        (lambda: unsmear.motion_psf(0, 1e9), "v must be .*got 1000000000"),
        (lambda: unsmear.motion_psf(1, 0, acceleration=(np.inf, 0)), "acceleration"),
        (lambda: unsmear.fspecial_motion(-1, 0), "length must be .*got -1"),
        (lambda: unsmear.fspecial_motion(5, np.nan), "angle must be finite"),
    ],
)
def test_bad_motion_is_refused_by_name(call, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()
