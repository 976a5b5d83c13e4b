"""Per-pixel inverses: their laws, then the slow twins, then the recorded cases."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest
import unsmear
from numpy.testing import assert_allclose, assert_array_equal
from reference import motions, wiener
from reference.golden import golden
from test_blur import picture, swirl

SIZE = 200

restore = partial(unsmear.deblur, method="wiener")


def textured(shape: tuple[int, int]) -> np.ndarray:
    """Smoothed noise around 0.5: detail at every scale above 2 px."""
    image = unsmear.blur(picture(shape), np.full((*shape, 2), (2.0, 0.0)))
    return unsmear.blur(image, np.full((*shape, 2), (0.0, 2.0)))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_no_motion_is_the_identity_bit_for_bit(dtype: type) -> None:
    image = (picture((40, 37)) * 200).astype(dtype)
    for still in (0.0, np.nan):
        result = restore(image, np.full((40, 37, 2), still))
        assert result.image.dtype == dtype
        assert_array_equal(result.image, image)
    assert result.report["unknown_pixels"] == image.size


def test_a_constant_stays_constant() -> None:
    for noise in (None, 0.0, 0.01):
        flat = np.full((48, 40), 0.7)
        restored = restore(flat, swirl((48, 40)), noise=noise).image
        # Kernels sum to 1 to rounding; their taps add up to 30 in magnitude at most.
        assert_allclose(restored, flat, rtol=1e-12)


def test_a_wave_comes_back() -> None:
    y, x = np.indices((90, 90))
    wave = 0.5 + 0.4 * np.cos(0.25 * x + 0.1 * y)
    flow = np.full((90, 90, 2), (7.0, 2.0))
    blurred = unsmear.blur(wave, flow)
    restored = restore(blurred, flow, noise=0.001).image
    inside = (slice(35, 55), slice(35, 55))
    # Inside the main lobe, at noise 0.001 and detail of order 0.01 c: bias below 2 %.
    assert abs(blurred - wave)[inside].max() > 0.05
    assert_allclose(restored[inside], wave[inside], atol=0.01)


def test_flips_and_transposition_go_through() -> None:
    image, flow = textured((45, 52)), swirl((45, 52))
    restored = restore(image, flow, noise=0.01).image
    mirrored = flow[:, ::-1] * np.float32([-1, 1])
    across = restore(image[:, ::-1], mirrored, noise=0.01).image
    turned = restore(image.T, flow.transpose(1, 0, 2)[..., ::-1], noise=0.01).image
    # Rounding alone, through positions and kernels: far below any quantisation step.
    assert_allclose(across[:, ::-1], restored, atol=1e-9)
    assert_allclose(turned.T, restored, atol=1e-9)


def test_scale_and_offset_of_a_float_picture_go_through() -> None:
    image, flow = textured((50, 60)), swirl((50, 60))
    restored = restore(image, flow).image
    scaled = restore(100 * image + 20, flow).image
    # Measured noise and detail scale with the picture; only rounding differs, except
    # that a ratio on the border of two levels may fall to the other.
    assert_allclose(np.median(abs(scaled - 100 * restored - 20)), 0, atol=1e-9)
    assert_allclose(scaled, 100 * restored + 20, atol=1.0)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_one_picture_whatever_its_type(dtype: type) -> None:
    image = np.rint(textured((64, 70)) * 255).astype(np.uint8)
    flow = swirl((64, 70), 0.1)
    grey = restore(image, flow).image.astype(float)
    white = {np.uint16: 65535.0}.get(dtype, 1.0)
    same = (image / 255.0 * white).astype(dtype)
    restored = np.clip(restore(same, flow).image / white * 255, 0, 255)
    # One grey level: the rounding of the 8-bit result, and of the picture.
    assert abs(restored - grey).max() <= 1.0


def test_layouts_give_the_same_answer_and_leave_the_input_alone() -> None:
    image, flow = textured((40, 44)), swirl((40, 44))
    expected = restore(image, flow, noise=0.01).image
    wide = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)
    readonly = image.copy()
    readonly.setflags(write=False)
    backwards = np.ascontiguousarray(image[::-1, ::-1])[::-1, ::-1]
    for same in (
        np.asfortranarray(image),
        wide[::2, ::2],
        backwards,
        readonly,
        image.astype(image.dtype.newbyteorder()),
        np.ma.masked_array(image),
    ):
        before = np.array(same)
        restored = restore(same, flow, noise=0.01).image
        assert_array_equal(restored, expected)
        assert_array_equal(np.array(same), before)


def test_bytes_do_not_depend_on_the_number_of_threads() -> None:
    image, flow = textured((70, 64)), swirl((70, 64))
    before = unsmear.get_num_threads()
    try:
        results = []
        for n in (1, 2, 5):
            unsmear.set_num_threads(n)
            results.append(restore(image, flow).image.tobytes())
    finally:
        unsmear.set_num_threads(before)
    assert len(set(results)) == 1


def test_an_unknown_pixel_stays_within_reach() -> None:
    image = textured((120, 120)).astype(np.float32)
    flow = np.full((120, 120, 2), (4.0, 1.0))
    clean = restore(image, flow, noise=0.01)
    image[60, 60] = np.nan
    holed = restore(image, flow, noise=0.01)
    y, x = np.indices(image.shape)
    far = np.maximum(abs(y - 60), abs(x - 60)) > holed.report["reach"]
    assert far.any()
    assert np.isnan(holed.image[60, 60])
    assert not np.isnan(holed.image[far]).any()
    same = holed.image == clean.image
    assert (same | np.isnan(holed.image)).all()


def test_unknown_motion_is_copied_and_counted() -> None:
    image, flow = textured((50, 50)), np.full((50, 50, 2), (6.0, 0.0))
    flow[10:20, 10:30] = np.nan
    flow[30:33, :5] = 1e6
    flow[40:, :] = 0.2
    result = restore(image, flow, noise=0.01)
    copied = np.isnan(flow[..., 0]) | (flow[..., 0] > 100) | (flow[..., 0] < 0.5)
    assert_array_equal(result.image[copied], image[copied])
    assert (result.image[~copied] != image[~copied]).mean() > 0.99
    assert result.report["unknown_pixels"] == 200
    assert result.report["too_long_pixels"] == 15
    assert result.report["still_pixels"] == 500
    assert json.loads(json.dumps(result.report)) == result.report
    assert len(result.report["warnings"]) == 1


def test_noise_is_measured_in_the_units_of_the_picture() -> None:
    rng = np.random.default_rng(3)
    shape = (160, 160)
    flow = np.full((*shape, 2), (8.0, 3.0))
    blurred = 90 + unsmear.blur(40 * textured(shape), flow)
    for sigma in (1.0, 4.0):
        noisy = np.rint(blurred + sigma * rng.standard_normal(shape)).astype(np.uint8)
        # The low quantile of tiles, and 0.3 grey levels from rounding, in squares. (At
        # five times this contrast white texture would pass for noise: 1.36 for 1.)
        measured = restore(noisy, flow).report["noise"]
        assert 0.85 * sigma < measured < 1.15 * sigma


def test_colour_shares_the_walk() -> None:
    image, flow = textured((40, 41)), swirl((40, 41))
    colour = np.stack([image] * 3, axis=-1)
    restored = restore(colour, flow, noise=0.01, channel_axis=-1).image
    grey = restore(image, flow, noise=0.01).image
    # Three times the detail over three times the noise: rounding of the ratio only.
    for channel in range(3):
        assert_allclose(restored[..., channel], grey, atol=1e-9)


@pytest.mark.parametrize(
    "parameters", [{"noise": 0.02}, {"regularization": 0.01, "exposure": 0.7}]
)
def test_wiener_equals_its_slow_twin(parameters: dict[str, float]) -> None:
    image, flow = textured((24, 26)), swirl((24, 26), 0.2)
    flow[4:7, 5:9] = np.nan
    flow[:, 20:] += 8
    fast = restore(image, flow, **parameters).image
    slow = wiener.deblur(image, flow.astype(float), **parameters)
    # Correlations against least squares over frequencies: conditions of 1e5 or less.
    assert_allclose(fast, slow, atol=1e-7)


def photographs() -> list[np.ndarray]:
    data = pytest.importorskip("skimage.data", reason="its pictures are the truth")
    luma = np.array([0.299, 0.587, 0.114])
    grey = data.camera().astype(float)
    colour = [data.astronaut(), data.coffee(), data.chelsea()]
    return [grey, *(np.rint(c @ luma) for c in colour)]


@pytest.mark.parametrize(("length", "angle"), [(7.0, 30.0), (11.3, 17.0)])
def test_translation_gains_at_noise_of_one_level(length: float, angle: float) -> None:
    matrix = motions.affine("translation", length, angle, SIZE)
    gains = []
    for photograph in photographs():
        sharp, dirty = motions.blurred(photograph, matrix, SIZE, sigma=1.0)
        restored = restore(dirty, motions.velocity(matrix, SIZE)).image
        gains.append(motions.psnr(restored, sharp) - motions.psnr(dirty, sharp))
    # What the project promises in the mean; a kernel off by half a pixel or a length
    # off by 10 % costs more than 1 dB. Each picture must gain two thirds of it.
    assert np.mean(gains) >= 4.5
    assert min(gains) >= 3.0


@pytest.mark.parametrize(("kind", "amount"), [("zoom", 17.0), ("rotation", 12.0)])
def test_curved_motion_gains_too(kind: str, amount: float) -> None:
    matrix = motions.affine(kind, amount, 0.0, SIZE)
    for photograph in photographs()[:2]:
        sharp, dirty = motions.blurred(photograph, matrix, SIZE, sigma=1.0)
        restored = restore(dirty, motions.velocity(matrix, SIZE)).image
        # Straight kernels gain 1 dB or lose; 3 dB needs the streamline.
        assert motions.psnr(restored, sharp) >= motions.psnr(dirty, sharp) + 3.0


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("case", ["const", "vary"])
def test_thesis_equals_the_recorded_cases(case: str, degree: int) -> None:
    stored = golden("deblur")
    image = stored["I"].astype(float)
    if case == "const":
        flow = np.broadcast_to(stored["const_v"].ravel(), (*image.shape, 2))
    else:
        flow = np.stack([stored["vary_Vx"], stored["vary_Vy"]], axis=-1)
    result = restore(image, flow, method="thesis", degree=degree)
    # Transforms and sums of up to 1e3 terms on a 0..255 scale; a shift by a sample
    # changes results by whole grey levels.
    assert_allclose(result.image, stored[f"{case}_n{degree}"], atol=1e-10)
    assert "worse" in result.report["warnings"][0]


@pytest.mark.parametrize("method", ["wiener", "thesis"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (2, 2), (13, 17), (31, 32)])
def test_any_size_is_restored(method: str, shape: tuple[int, int]) -> None:
    flow = np.full((*shape, 2), 3.0)
    result = restore(picture(shape), flow, method=method, degree=1)
    assert result.image.shape == shape
    assert np.isfinite(result.image).all()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"method": "magic"}, "method must be one of 'tv', .*'thesis', got 'magic'"),
        ({"exposure": -1.0}, "exposure must be finite and positive, got -1"),
        ({"noise": -1.0}, "noise must be .*got -1"),
        ({"regularization": 0.0}, "regularization must be .*got 0"),
        ({"method": "thesis", "degree": 5}, "degree must be 1, 2, 3 or 4, got 5"),
        ({"channel_axis": 2}, "channel_axis must name an axis"),
        ({"flow": np.zeros((4, 6, 2))}, r"flow must have shape \(12, 14, 2\)"),
        ({"image": np.zeros((0, 3)), "flow": np.zeros((0, 3, 2))}, "image must have"),
    ],
)
def test_bad_input_is_refused_by_name(parameters, words: str) -> None:
    arguments = {"image": picture((12, 14)), "flow": np.ones((12, 14, 2))} | parameters
    with pytest.raises(ValueError, match=words):
        restore(arguments.pop("image"), arguments.pop("flow"), **arguments)


def test_complex_pictures_are_refused() -> None:
    with pytest.raises(TypeError, match=r"image must be .*complex"):
        restore(np.ones((4, 4), complex), np.ones((4, 4, 2)))


def test_a_progress_callback_that_raises_ends_the_work() -> None:
    def stop(share: float) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        restore(picture((90, 90)), swirl((90, 90)), progress=stop)
