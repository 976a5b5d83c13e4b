"""Errors of flow and similarity of pictures: known pairs, then scikit-image."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from unsmear import metrics as m

Array = NDArray[Any]


def field(u: float, v: float, shape: tuple[int, int] = (2, 3)) -> Array:
    return np.broadcast_to(np.array([u, v], dtype=np.float32), (*shape, 2)).copy()


# Maps


def test_errors_of_known_pairs() -> None:
    cases = [
        # flow, truth: angular, direction, endpoint, magnitude
        ((3, 4), (0, 0), math.degrees(math.atan(5)), np.nan, 5.0, 5.0),
        ((1, 0), (0, 1), 60.0, 90.0, math.sqrt(2), 0.0),
        ((-2, 0), (2, 0), 2 * math.degrees(math.atan(2)), 180.0, 4.0, 0.0),
        ((0.5, -0.25), (0.5, -0.25), 0.0, 0.0, 0.0, 0.0),
        ((2, 2), (1, 1), None, 0.0, math.sqrt(2), math.sqrt(2)),
    ]
    maps = (m.angular_error, m.direction_error, m.endpoint_error, m.magnitude_error)
    for flow, truth, *expected in cases:
        for error, value in zip(maps, expected, strict=True):
            if value is not None:
                got = error(field(*flow), field(*truth))
                assert got.shape == (2, 3)
                np.testing.assert_allclose(got, value, rtol=1e-13, atol=1e-13)


def test_angles_agree_with_the_arc_cosine_and_beat_it_when_small(
    rng: np.random.Generator,
) -> None:
    a, b = rng.normal(size=(2, 9, 11, 2)).astype(np.float32).astype(np.float64)
    lift = [np.concatenate([f, np.ones((9, 11, 1))], -1) for f in (a, b)]
    lift = [f / np.linalg.norm(f, axis=-1, keepdims=True) for f in lift]
    expected = np.degrees(np.arccos((lift[0] * lift[1]).sum(-1)))
    # The arc cosine keeps half the digits near 0: 1e-8 rad.
    np.testing.assert_allclose(m.angular_error(a, b), expected, rtol=0, atol=1e-6)
    small = m.angular_error(field(0, 0), field(0, 1e-9))
    np.testing.assert_allclose(small, math.degrees(1e-9), rtol=1e-6)
    assert (m.angular_error(a, a) == 0).all()


def test_unknown_pixels_are_unknown_errors() -> None:
    flow, truth = field(1, 2), field(1, 1)
    flow[0, 1, 1] = np.nan
    truth[1, 2] = np.nan
    for error in (m.angular_error, m.endpoint_error, m.magnitude_error):
        unknown = np.isnan(error(flow, truth))
        assert unknown.sum() == 2
        assert unknown[0, 1]
        assert unknown[1, 2]


def test_summary_counts_masks_densities_and_outliers() -> None:
    truth = field(10, 0, (2, 5))
    flow = truth.copy()
    flow[0, 0] = (10, 4)  # off by 4 px and 40 %: an outlier
    flow[0, 1] = (10, 3)  # exactly 3 px: not more than 3
    flow[0, 2] = np.nan  # not known
    truth[0, 3] = np.nan  # does not count
    mask = np.ones((2, 5), dtype=np.uint8)
    mask[1, 4] = 0
    errors = m.flow_errors(flow, truth, mask)
    assert errors["pixels"] == 8
    assert errors["density"] == 7 / 8
    assert errors["epe"] == pytest.approx((4 + 3) / 7)
    assert errors["outliers"] == pytest.approx(1 / 7)
    assert errors["magnitude"] == pytest.approx(
        (math.hypot(10, 4) + math.hypot(10, 3) - 20) / 7
    )
    assert errors["percentiles"]["99"] <= 4
    fast = m.flow_errors(field(104, 0), field(100, 0))
    assert fast["outliers"] == 0, "4 px of 100 are within 5 %"


def test_nothing_known_is_not_a_number_and_no_density() -> None:
    errors = m.flow_errors(field(np.nan, np.nan), field(1, 1))
    assert errors["density"] == 0
    assert all(math.isnan(errors[k]) for k in ("aae", "epe", "direction", "outliers"))
    none = m.flow_errors(field(1, 1), field(np.nan, 0))
    assert none["pixels"] == 0
    assert none["density"] == 0


def test_flow_of_any_type_is_pixels() -> None:
    truth = field(0, 0)
    for dtype in (np.int8, np.uint8, np.int64, np.float16, np.float64, ">f4", ">i2"):
        flow = field(3, 4).astype(dtype)
        np.testing.assert_array_equal(m.endpoint_error(flow, truth), 5.0)
    masked = np.ma.masked_array(field(3, 4).astype(np.int16), mask=False)
    np.testing.assert_array_equal(m.endpoint_error(masked, truth), 5.0)
    masked[0, 1] = np.ma.masked
    error = m.endpoint_error(masked, truth)
    # Integers of a flow are pixels also where some of them are masked.
    assert np.isnan(error[0, 1])
    assert np.nanmax(np.abs(error - 5.0)) == 0
    with pytest.raises(TypeError, match="flow must be an array of integers or real"):
        m.endpoint_error(truth.astype(complex), truth)


def test_sparsification_keeps_the_surest_first() -> None:
    error = np.array([4.0, 3.0, 2.0, 1.0])
    flow = np.zeros((1, 4, 2))
    flow[0, :, 0] = error
    curve = m.sparsification(
        flow, [[0.1, 0.2, 0.3, 0.4]], np.zeros((1, 4, 2)), densities=(1.0, 0.5, 0.25)
    )
    assert curve["density"] == [1.0, 0.5, 0.25]
    assert curve["epe"] == [2.5, 1.5, 1.0]
    assert curve["aae"][2] == pytest.approx(45.0)
    flow[0, 3] = np.nan
    curve = m.sparsification(
        flow,
        [[0.1, 0.2, 0.3, 0.4]],
        np.zeros((1, 4, 2)),
        mask=[[0, 1, 1, 1]],
        densities=[1.0],
    )
    assert curve["density"] == [pytest.approx(2 / 3)], "unknown flow cannot be kept"
    assert curve["epe"] == [2.5]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: m.endpoint_error(np.zeros((2, 3)), field(0, 0)),
            "flow must have",
        ),
        (lambda: m.endpoint_error(field(0, 0), field(0, 0, (3, 2))), "truth must have"),
        (
            lambda: m.flow_errors(field(0, 0), field(0, 0), np.ones((3, 2))),
            r"mask must have shape \(2, 3\), got \(3, 2\)",
        ),
        (
            lambda: m.sparsification(field(0, 0), np.ones((1, 3)), field(0, 0)),
            r"confidence must have shape \(2, 3\), got \(1, 3\)",
        ),
        (
            lambda: m.sparsification(
                field(0, 0), np.ones((2, 3)), field(0, 0), densities=[1.5]
            ),
            r"densities must be in \(0, 1\], got 1.5",
        ),
        (
            lambda: m.psnr(np.zeros((2, 3)), np.zeros((3, 2))),
            "image and ref",
        ),
        (
            lambda: m.psnr(np.zeros((0, 3)), np.zeros((0, 3))),
            "image and ref",
        ),
        (
            lambda: m.psnr(np.zeros((2, 3)), np.zeros((2, 3)), data_range=0),
            "data_range must be > 0, got 0",
        ),
        (
            lambda: m.psnr(np.zeros((2, 3), np.uint8), np.zeros((2, 3))),
            "of one integer type or both floats",
        ),
        (
            lambda: m.ssim(np.zeros((10, 30)), np.zeros((10, 30))),
            r"image must have shape \(H >= 11, W >= 11\)",
        ),
    ],
)
def test_bad_calls_are_named(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


# Pictures


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("shape", [(11, 11), (23, 31), (19, 17, 3)])
def test_psnr_and_ssim_match_scikit_image(
    dtype: type[np.generic], shape: tuple[int, ...], rng: np.random.Generator
) -> None:
    clean = rng.uniform(0.2, 0.8, shape)
    noisy = clean + rng.normal(0, 0.05, shape)
    white = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
    a, b = (np.asarray(p * white).astype(dtype) for p in (clean, noisy))
    expected = peak_signal_noise_ratio(
        b.astype(np.float64), a.astype(np.float64), data_range=white
    )
    assert m.psnr(a, b) == pytest.approx(expected, rel=1e-12)
    expected = structural_similarity(
        a.astype(np.float64),
        b.astype(np.float64),
        data_range=white,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        channel_axis=2 if len(shape) == 3 else None,
    )
    # Both average over the pixels whose whole 11 x 11 window lies inside. Variances are
    # differences of means of squares: 1e-15 of (sqrt(variance) / mean)^-2 = 1e2.
    assert m.ssim(a, b) == pytest.approx(expected, rel=1e-10)


def test_similarity_of_a_picture_to_itself_and_to_unknown(
    rng: np.random.Generator,
) -> None:
    picture = rng.uniform(size=(16, 18))
    assert m.psnr(picture, picture) == math.inf
    assert m.ssim(picture, picture) == pytest.approx(1.0, abs=1e-12)
    # A uniform error of a tenth of the range is 20 dB.
    assert m.psnr(picture, picture + 0.1) == pytest.approx(20.0, abs=1e-9)
    assert m.psnr(picture, picture + 0.7, data_range=7) == pytest.approx(20.0, abs=1e-9)
    unknown = picture.copy()
    unknown[4, 5] = np.nan
    assert math.isnan(m.psnr(picture, unknown))
    assert math.isnan(m.ssim(picture, unknown))


def test_masked_pictures_keep_their_scale(rng: np.random.Generator) -> None:
    a, b = rng.integers(0, 255, (2, 14, 15), dtype=np.uint8)
    whole = np.ma.masked_array(a, mask=False)
    assert m.psnr(whole, b) == m.psnr(a, b)
    holed = np.ma.masked_array(a, mask=False)
    holed[3, 3] = np.ma.masked
    # One masked pixel is an unknown one, not another scale.
    assert math.isnan(m.psnr(holed, b))
    assert math.isnan(m.psnr(holed, b, data_range=255))
