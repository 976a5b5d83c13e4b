"""Separable correlation: impulses and sums, then its NumPy twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.convolve import separable_3d
from unsmear import _unsmear

ONE = [1.0]
correlate = _unsmear.correlate_separable


def test_an_impulse_answers_with_the_mirrored_taps_on_its_axis() -> None:
    impulse = np.zeros((5, 7, 9))
    impulse[2, 3, 4] = 1.0
    taps = [1.0, -2.0, 5.0]
    for axis, along in enumerate(np.eye(3, dtype=bool)):
        each = [taps if here else ONE for here in along]
        response = correlate(impulse, each, "zero")
        line = np.moveaxis(response, axis, -1)[*(np.array([2, 3, 4])[~along])]
        centre = (2, 3, 4)[axis]
        np.testing.assert_array_equal(line[centre - 1 : centre + 2], taps[::-1])
        assert np.count_nonzero(response) == 3


@pytest.mark.parametrize("border", ["replicate", "reflect"])
def test_a_constant_stays_constant(border: str) -> None:
    taps = [0.25, 0.5, 0.25]
    volume = np.full((2, 3, 70), 3.0)
    # Powers of two: exact.
    result = correlate(volume, [taps, taps, taps], border)
    np.testing.assert_array_equal(result, volume)


def test_unknown_samples_reach_their_window_and_no_further() -> None:
    volume = np.random.default_rng(1).normal(size=(1, 9, 80))
    clean = correlate(volume, [ONE, ONE, [1.0, 2.0, 3.0]], "reflect")
    volume[0, 4, 40] = np.nan
    result = correlate(volume, [ONE, ONE, [1.0, 2.0, 3.0]], "reflect")
    touched = np.zeros(volume.shape, dtype=bool)
    touched[0, 4, 39:42] = True
    np.testing.assert_array_equal(np.isnan(result), touched)
    np.testing.assert_array_equal(result[~touched], clean[~touched])


@settings(deadline=None, max_examples=60)
@given(
    shape=st.tuples(st.integers(1, 4), st.integers(1, 9), st.integers(1, 70)),
    sizes=st.tuples(*[st.sampled_from([1, 3, 7, 13])] * 3),
    border=st.sampled_from(["replicate", "reflect", "zero"]),
    seed=st.integers(0, 99),
)
def test_any_volume_matches_the_twin(
    shape: tuple[int, int, int],
    sizes: tuple[int, int, int],
    border: str,
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    volume = rng.normal(size=shape)
    taps = [rng.normal(size=size) for size in sizes]
    result = correlate(volume, [t.tolist() for t in taps], border)
    expected = separable_3d(volume, *taps, border)
    # At most 13^3 products of values of order 1, in the same order along each axis.
    scale = np.prod([np.abs(t).sum() for t in taps]) * np.abs(volume).max()
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-14 * scale)


def test_strided_volumes_are_read_as_they_are() -> None:
    volume = np.random.default_rng(2).normal(size=(6, 8, 10))
    taps = [[1.0, 2.0, 4.0]] * 3
    for view in (volume[::-1, ::2, ::-3], np.asfortranarray(volume), volume.T):
        before = view.copy()
        result = correlate(view, taps, "reflect")
        packed = correlate(np.ascontiguousarray(view), taps, "reflect")
        np.testing.assert_array_equal(result, packed)
        np.testing.assert_array_equal(view, before)


def test_bad_arguments_are_named() -> None:
    volume = np.zeros((1, 2, 3))
    with pytest.raises(ValueError, match=r"border must be .*, got \"mirror\""):
        correlate(volume, [ONE, ONE, ONE], "mirror")
    with pytest.raises(ValueError, match="taps must be an odd number of values, got 2"):
        correlate(volume, [ONE, [1.0, 1.0], ONE], "zero")
    with pytest.raises(ValueError, match="taps must be an odd number of values, got 0"):
        correlate(volume, [ONE, [], ONE], "zero")
