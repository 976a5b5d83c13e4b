"""Spline interpolation from Python, against an independent implementation."""

import numpy as np
import pytest
from scipy import ndimage
from unsmear import _unsmear


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("border", ["replicate", "reflect"])
def test_equals_scipy(degree: int, border: str) -> None:
    rng = np.random.default_rng(4)
    picture = rng.normal(size=(23, 31))
    y, x = rng.uniform(-8, 35, (2, 40, 9))
    got = _unsmear.sample(picture, y, x, degree, border)
    if border == "replicate":
        y, x = np.clip(y, 0, 22), np.clip(x, 0, 30)
    expected = ndimage.map_coordinates(picture, [y, x], order=degree, mode="mirror")
    # scipy starts its recursion to 1e-15 of a sample as well; gains reach 56.
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_bad_input_is_named() -> None:
    picture, at = np.zeros((4, 5)), np.zeros((2, 2))
    with pytest.raises(ValueError, match="degree must be 1, 3 or 5, got 2"):
        _unsmear.sample(picture, at, at, 2, "reflect")
    with pytest.raises(ValueError, match="border must be"):
        _unsmear.sample(picture, at, at, 3, "zero")
    with pytest.raises(ValueError, match=r"x must have shape \(2, 2\)"):
        _unsmear.sample(picture, at, np.zeros((2, 3)), 3, "reflect")
    with pytest.raises(ValueError, match="image"):
        _unsmear.sample(np.zeros((0, 5)), at, at, 3, "reflect")
