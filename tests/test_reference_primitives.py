"""The oracles' building blocks: convolution with borders, and motion PSFs.

Tolerances are a few eps (2.2e-16) per term summed unless a comment says otherwise.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference.convolve import convolve_same, correlate_axis, separable_3d
from reference.golden import assert_close, golden
from reference.psf import fspecial_motion, motion_psf
from reference.thesis_flow import upsample_linear

# Short sums of values up to 450: a hundred eps relative to the largest.
LINEAR = 3e-14


# Convolution


@pytest.mark.parametrize("length", [1, 2, 3, 7])
@pytest.mark.parametrize("border", ["replicate", "reflect", "zero", "constant"])
@pytest.mark.parametrize("size", [1, 2, 5])
def test_correlate_axis_is_its_formula(length: int, border: str, size: int) -> None:
    rng = np.random.default_rng(length)
    line, taps = rng.normal(size=(3, length)), rng.normal(size=size)
    expected = np.zeros_like(line)
    period = max(2 * (length - 1), 1)
    for i in range(length):
        for j, tap in enumerate(taps):
            k = i + j - size // 2
            if border == "replicate":
                k = min(max(k, 0), length - 1)
            elif border == "reflect":
                k = min(k % period, period - k % period) if length > 1 else 0
            if 0 <= k < length:
                expected[:, i] += tap * line[:, k]
    # The same products in the same order.
    np.testing.assert_allclose(
        correlate_axis(line, taps, 1, border), expected, rtol=1e-14, atol=1e-15
    )


def test_separable_3d_factorises_and_keeps_axes_apart() -> None:
    t, y, x = np.array([1.0, 2, 3]), np.array([1.0, -1, 4, 0, 2]), np.array([0.5, 0, 7])
    impulse = np.zeros((7, 9, 8))
    impulse[3, 4, 4] = 1.0
    response = separable_3d(impulse, t, y, x, "zero")
    expected = np.zeros_like(impulse)
    # Correlation answers an impulse with the taps mirrored.
    expected[2:5, 2:7, 3:6] = np.einsum("t,y,x->tyx", t[::-1], y[::-1], x[::-1])
    np.testing.assert_array_equal(response, expected)


def test_unknown_border_is_refused() -> None:
    with pytest.raises(ValueError, match=r"border.*'mirror'"):
        correlate_axis(np.zeros(4), np.ones(3), 0, "mirror")


def test_matlab_primitives() -> None:
    stored = golden("basics")
    taps = np.array([[-1.0, 8.0, 0.0, -8.0, 1.0]]) / 12.0
    first = stored["x"][:, :, 0]
    assert_close(convolve_same(first, taps), stored["c2"], LINEAR)
    assert_close(convolve_same(first, taps.T), stored["c2t"], LINEAR)
    assert_close(upsample_linear(stored["z"], 1), stored["i1"], LINEAR)
    assert_close(upsample_linear(stored["z"], 3), stored["i3"], LINEAR)
    for axis, name in enumerate(("gy", "gx", "gt")):
        assert_close(np.gradient(stored["x"], axis=axis), stored[name], LINEAR)
    assert_close(stored["x"].std(axis=2, ddof=1), stored["sx"], LINEAR)


# Point spread functions


def test_motion_psf_of_short_lines_in_closed_form() -> None:
    # Integrals of the tent over [-1/2, 1/2] and over [-1, 1], divided by the length.
    np.testing.assert_allclose(motion_psf(1, 0), [[1 / 8, 3 / 4, 1 / 8]], rtol=1e-15)
    np.testing.assert_allclose(
        motion_psf(0, 2), [[1 / 4], [1 / 2], [1 / 4]], rtol=1e-15
    )
    np.testing.assert_array_equal(motion_psf(0, 0), [[1.0]])


@pytest.mark.parametrize("motion", [(3.0, 1.0), (7.3, -2.2), (-0.2, 0.9), (-4.0, -4.0)])
def test_motion_psf_is_the_integral_of_tents(motion: tuple[float, float]) -> None:
    u, v = motion
    psf = motion_psf(u, v)
    rows, columns = psf.shape
    y, x = np.mgrid[:rows, :columns] - np.array(psf.shape)[:, None, None] // 2
    steps = 4000
    s = ((np.arange(steps) + 0.5) / steps - 0.5)[:, None, None]
    brute = np.maximum(0, 1 - abs(x - s * u)) * np.maximum(0, 1 - abs(y - s * v))
    # Midpoint rule on a function with kinks: error below (|u| + |v|)^2 / steps^2.
    np.testing.assert_allclose(psf, brute.mean(axis=0), rtol=0, atol=1e-5)
    assert psf.min() >= 0.0
    assert psf.sum() == pytest.approx(1.0, abs=1e-14)
    assert (psf * x).sum() == pytest.approx(0.0, abs=1e-14)
    assert (psf * y).sum() == pytest.approx(0.0, abs=1e-14)
    # y down: a motion to the right and down has positive covariance of x and y.
    assert (psf * x * y).sum() == pytest.approx(u * v / 12.0, abs=1e-13)
    np.testing.assert_allclose(motion_psf(v, u), psf.T, rtol=0, atol=1e-15)


def test_fspecial_motion_matches_the_recordings() -> None:
    stored = golden("psf")
    assert len(stored["len_theta"]) == 69
    for k, (length, angle) in enumerate(stored["len_theta"]):
        # Distances reach 16 px, so weights carry up to 16 eps, and more where another
        # cosine rounds otherwise; 1e-15 is seen.
        assert_close(fspecial_motion(length, angle), stored[f"psf_{k:03d}"], 1e-14)
