"""The default restoration and its kin: laws first, then what they gain."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
import unsmear
from numpy.testing import assert_allclose, assert_array_equal
from reference import motions
from test_blur import picture, swirl
from test_deblur import photographs, textured

METHODS = ("tv", "fast", "tikhonov", "richardson-lucy")
SIZE = 160


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_no_motion_is_the_identity_bit_for_bit(method: str, dtype: type) -> None:
    image = (picture((40, 37)) * 200).astype(dtype)
    for still in (0.0, 0.4, np.nan):
        flow = np.full((40, 37, 2), (still, 0.0))
        result = unsmear.deblur(image, flow, method=method)
        assert result.image.dtype == dtype
        assert_array_equal(result.image, image)
    assert result.report["noise"] is None
    assert json.loads(json.dumps(result.report)) == result.report


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_stays_constant(method: str) -> None:
    flat = np.full((48, 40), 0.7)
    restored = unsmear.deblur(flat, swirl((48, 40)), method=method).image
    # Single precision, which the solver works in, over some hundred sums.
    assert_allclose(restored, flat, rtol=1e-5)


def test_scale_and_offset_of_a_float_picture_go_through() -> None:
    image, flow = textured((50, 60)), swirl((50, 60))
    for method in ("tv", "tikhonov"):
        restored = unsmear.deblur(image, flow, method=method).image
        scaled = unsmear.deblur(100 * image + 20, flow, method=method).image
        # Rounding to single precision, through a prior that is not convex.
        assert_allclose(scaled, 100 * restored + 20, atol=0.1)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_one_picture_whatever_its_type(dtype: type) -> None:
    image = np.rint(textured((64, 70)) * 255).astype(np.uint8)
    flow = swirl((64, 70), 0.1)
    grey = unsmear.deblur(image, flow).image.astype(float)
    white = {np.uint16: 65535.0}.get(dtype, 1.0)
    same = (image / 255.0 * white).astype(dtype)
    restored = np.clip(unsmear.deblur(same, flow).image / white * 255, 0, 255)
    assert abs(restored - grey).max() <= 1.0  # one grey level


def test_layouts_give_the_same_answer_and_leave_the_input_alone() -> None:
    image, flow = textured((40, 44)), swirl((40, 44))
    expected = unsmear.deblur(image, flow).image
    readonly = image.copy()
    readonly.setflags(write=False)
    for same in (
        np.asfortranarray(image),
        np.ascontiguousarray(image[::-1, ::-1])[::-1, ::-1],
        readonly,
        image.astype(image.dtype.newbyteorder()),
        np.ma.masked_array(image),
    ):
        before = np.array(same)
        assert_array_equal(unsmear.deblur(same, flow).image, expected)
        assert_array_equal(np.array(same), before)


@pytest.mark.parametrize("method", METHODS)
def test_bytes_do_not_depend_on_the_number_of_threads(
    method: str, threads: Callable[[int], None]
) -> None:
    image, flow = textured((90, 140)), swirl((90, 140))
    results = []
    for n in (1, 2, 5):
        threads(n)
        results.append(unsmear.deblur(image, flow, method=method).image.tobytes())
    assert len(set(results)) == 1


def test_an_unknown_pixel_matters_only_near() -> None:
    image = (255 * textured((150, 150))).astype(np.float32)
    flow = np.full((150, 150, 2), (6.0, 2.0))
    fixed = {"noise": 1.0, "regularization": 0.1}
    clean = unsmear.deblur(image, flow, **fixed).image
    image[70:72, 70] = np.nan
    holed = unsmear.deblur(image, flow, **fixed).image
    # The light of the two pixels fell on others too: they are restored.
    assert np.isfinite(holed).all()
    y, x = np.indices(image.shape)
    far = np.hypot(y - 70, x - 70) > 40
    # Conjugate gradients couple all pixels by two scalars a step, and a prior that is
    # not convex amplifies rounding where texture is as fine as this: the far change
    # is a fraction of what restoring it changes, and not zero as for "wiener".
    change = abs(holed - clean)
    assert np.sqrt(np.mean(change[far] ** 2)) < 0.05 * np.std(clean - 255 * 0.5)
    assert np.median(change[far]) < 0.1  # grey levels


def test_what_nothing_shows_is_unknown() -> None:
    image, flow = textured((80, 90)), np.full((80, 90, 2), (5.0, 0.0))
    image[20:40, 30:60] = np.nan
    restored = unsmear.deblur(image, flow).image
    # Light spreads 2.5 px to either side; a quarter of it is enough.
    assert np.isnan(restored[20:40, 33:57]).all()
    assert np.isfinite(restored[:, :28]).all() and np.isfinite(restored[:20]).all()
    whole = (255 * picture((80, 90))).astype(np.uint8)
    holed = np.ma.masked_array(whole, np.isnan(image))
    assert np.isnan(unsmear.deblur(holed, flow).image).any()


def test_unknown_motion_is_copied_and_counted() -> None:
    image, flow = textured((50, 50)), np.full((50, 50, 2), (6.0, 0.0))
    flow[10:20, 10:30] = np.nan
    flow[30:33, :5] = 1e6
    flow[40:, :] = 0.2
    result = unsmear.deblur(image, flow)
    copied = np.isnan(flow[..., 0]) | (flow[..., 0] > 100) | (flow[..., 0] < 0.5)
    assert_array_equal(result.image[copied], image[copied])
    assert (result.image[~copied] != image[~copied]).mean() > 0.99
    assert result.report["unknown_pixels"] == 200
    assert result.report["too_long_pixels"] == 15
    assert result.report["still_pixels"] == 500


def test_colour_shares_weights() -> None:
    image, flow = textured((40, 41)), swirl((40, 41))
    colour = np.stack([image] * 3, axis=-1)
    restored = unsmear.deblur(colour, flow, noise=0.01, channel_axis=-1).image
    grey = unsmear.deblur(image, flow, noise=0.01).image
    # Means over equal channels round differently.
    for channel in range(3):
        assert_allclose(restored[..., channel], grey, atol=0.01)


def test_weights_of_zero_are_as_good_as_nothing() -> None:
    image, flow = textured((60, 64)), np.full((60, 64, 2), (5.0, 3.0))
    weights = np.ones((60, 64))
    weights[30:33, 20:24] = 0
    spoiled = image.copy()
    spoiled[30:33, 20:24] = 1e3
    fixed = {"noise": 0.004, "regularization": 1e-3}
    first = unsmear.deblur(image, flow, weights=weights, **fixed).image
    assert np.isfinite(first).all()
    near = abs(first - unsmear.deblur(image, flow, **fixed).image)[28:35, 18:26]
    assert near.max() < 0.3
    wild = unsmear.deblur(spoiled, flow, **fixed).image
    assert abs(wild - first).max() > 10 * near.max()


def test_noise_is_reported_in_the_units_of_the_picture() -> None:
    rng = np.random.default_rng(3)
    flow = np.full((160, 160, 2), (8.0, 3.0))
    blurred = 90 + unsmear.blur(40 * textured((160, 160)), flow)
    noisy = np.rint(blurred + 2 * rng.standard_normal(blurred.shape)).astype(np.uint8)
    report = unsmear.deblur(noisy, flow).report
    # The low quantile of tiles; a right model leaves a little less than the noise.
    assert 1.7 < report["noise"] < 2.3
    assert 0.6 * report["noise"] < report["residual"] < 1.1 * report["noise"]
    assert unsmear.noise.estimate_noise(noisy, flow) == pytest.approx(
        report["noise"], rel=1e-3
    )
    assert not report["model_mismatch"]


CASES = {
    "translation": motions.affine("translation", 11.3, 17.0, SIZE),
    "rotation": motions.affine("rotation", 12.0, 0.0, SIZE),
}


def gains(matrix: np.ndarray, flow_error: float = 1.0, **parameters) -> list[float]:
    gains = []
    for photograph in photographs():
        sharp, dirty = motions.blurred(photograph, matrix, SIZE, sigma=1.0)
        flow = flow_error * motions.velocity(matrix, SIZE)
        restored = unsmear.deblur(dirty, flow, **parameters).image
        gains.append(motions.psnr(restored, sharp) - motions.psnr(dirty, sharp))
    return gains


@pytest.mark.parametrize("kind", CASES)
def test_true_motion_gains_what_is_promised(kind: str) -> None:
    # Measured 9 to 10 dB at this noise; a path off by half a pixel costs 2.
    for method, least in (("tv", 8.3), ("fast", 7.0), ("tikhonov", 5.0)):
        found = gains(CASES[kind], method=method)
        assert np.mean(found) >= least, (method, found)
        assert min(found) >= 0.5 * least


@pytest.mark.parametrize("flow_error", [0.85, 1.15])
def test_wrong_motion_does_no_harm(flow_error: float) -> None:
    assert min(gains(CASES["translation"], flow_error)) >= -0.2


def test_wrong_motion_is_noticed() -> None:
    matrix = CASES["translation"]
    _, dirty = motions.blurred(photographs()[0], matrix, SIZE, sigma=1.0)
    flow = motions.velocity(matrix, SIZE)
    assert not unsmear.deblur(dirty, flow).report["model_mismatch"]
    report = unsmear.deblur(dirty, 1.3 * flow).report
    assert report["model_mismatch"]
    assert any("unexplained" in text for text in report["warnings"])


def test_acceleration_bends_time() -> None:
    # Constant acceleration along x: D = -t v + t^2/2 (-a), longer after than before.
    v, a = 10.0, 6.0
    wide = np.pad(textured((60, 120)), ((0, 0), (30, 30)), mode="reflect")
    x = np.arange(120) + 30.0
    times = (np.arange(256) + 0.5) / 256 - 0.5
    blurred = np.zeros((60, 120))
    for t in times:
        where = x - t * v - t * t / 2 * a
        for row in range(60):
            blurred[row] += np.interp(where, np.arange(180), wide[row]) / times.size
    flow = np.full((60, 120, 2), (v, 0.0))
    bend = np.full((60, 120, 2), (a, 0.0))
    sharp = wide[:, 30:150]
    inside = (slice(8, -8), slice(16, -16))

    def error(**parameters) -> float:
        restored = unsmear.deblur(blurred, flow, noise=1e-3, **parameters).image
        return float(np.std((restored - sharp)[inside]))

    assert error(acceleration=bend) < 0.7 * error()


def test_clipped_highlights_do_not_ring() -> None:
    sharp = np.full((80, 120), 60.0)
    sharp[30:50, 40:44] = 900.0  # far brighter than white
    flow = np.full((80, 120, 2), (12.0, 0.0))
    blurred = unsmear.blur(sharp, flow)
    clipped = np.clip(np.rint(blurred), 0, 255).astype(np.uint8)
    restored = unsmear.deblur(clipped, flow, noise=0.3).image.astype(float)
    as_floats = unsmear.deblur(clipped.astype(float), flow, noise=0.3).image
    truth = np.clip(sharp, 0, 255)
    known, fooled = (
        np.mean((np.clip(r, 0, 255) - truth) ** 2) for r in (restored, as_floats)
    )
    # Floats have no white: there the flat top is taken for the truth.
    assert known < 0.5 * fooled


@pytest.mark.parametrize("gamma", [2.2, "srgb"])
def test_coded_light_is_restored_as_light(gamma: float | str) -> None:
    light = np.where((np.indices((60, 90)) // 15).sum(axis=0) % 2, 0.9, 0.02)
    flow = np.full((60, 90, 2), (9.0, 2.0))
    power = 2.2 if gamma == "srgb" else gamma
    code = np.clip(unsmear.blur(light, flow), 0.02, 0.9) ** (1 / power)
    sharp = light ** (1 / power)
    inside = (slice(10, -10), slice(14, -14))

    def error(**parameters) -> float:
        restored = unsmear.deblur(code, flow, noise=2e-3, **parameters).image
        return float(np.std((restored - sharp)[inside]))

    assert error(gamma=gamma) < 0.7 * error()
    still = unsmear.deblur(code, 0 * flow, gamma=gamma).image
    assert_array_equal(still, code)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (2, 2), (13, 17), (31, 32)])
def test_any_size_is_restored(method: str, shape: tuple[int, int]) -> None:
    flow = np.full((*shape, 2), 3.0)
    result = unsmear.deblur(picture(shape), flow, method=method)
    assert result.image.shape == shape
    assert np.isfinite(result.image).all()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"exposure": -1.0}, "exposure must be finite and positive, got -1"),
        ({"noise": -1.0}, "noise must be .*got -1"),
        ({"regularization": 0.0}, "regularization must be .*got 0"),
        ({"weights": np.ones((3, 3))}, r"weights must have shape \(12, 14\)"),
        ({"weights": np.full((12, 14), 2.0)}, r"weights must be in \[0, 1\]"),
        ({"acceleration": np.ones((12, 14))}, "acceleration must have shape"),
        ({"gamma": -1.0}, "gamma must be finite and positive, got -1"),
        ({"gamma": "film"}, "gamma must be a number > 0 or 'srgb', got 'film'"),
        ({"flow": np.zeros((4, 6, 2))}, r"flow must have shape \(12, 14, 2\)"),
    ],
)
def test_bad_input_is_refused_by_name(parameters, words: str) -> None:
    arguments = {"image": picture((12, 14)), "flow": np.ones((12, 14, 2))} | parameters
    with pytest.raises(ValueError, match=words):
        unsmear.deblur(arguments.pop("image"), arguments.pop("flow"), **arguments)


def test_progress_ends_at_the_whole_and_an_exception_ends_the_work() -> None:
    shares: list[float] = []
    image, flow = textured((90, 90)), swirl((90, 90))
    unsmear.deblur(image, flow, progress=shares.append)
    assert shares[-1] == 1.0

    def stop(share: float) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        unsmear.deblur(image, flow, progress=stop)
