"""The coarse-to-fine methods: laws, exact motion, unknown pixels, measured scenes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from textures import moving_texture

Array = NDArray[Any]

METHODS = ("fast", "balanced", "accurate", "steady")


@pytest.fixture(scope="module")
def frames() -> Array:
    """A texture moving by (1.3, -0.7) px/frame, (5, 64, 72), in [0.1, 0.9]."""
    texture = moving_texture((1.3, -0.7), (5, 64, 72), waves=120, band=(0.15, 1.9))
    low, high = texture.min(), texture.max()
    return 0.1 + 0.8 * (texture - low) / (high - low)


def flow(frames: Any, method: str = "balanced", **given: Any) -> Array:
    return unsmear.optical_flow(frames, method=method, **given).flow


def inner(field: Array, margin: int = 8) -> Array:
    return field[margin:-margin, margin:-margin]


@pytest.mark.parametrize("method", METHODS)
def test_a_translation_is_found_everywhere(frames: Array, method: str) -> None:
    found = flow(frames, method)
    assert np.isfinite(found).all()
    error = np.hypot(*(found - (1.3, -0.7)).transpose(2, 0, 1))
    # The warp of a texture up to 1.9 rad/px is exact to 1e-3; what is left is the
    # filters' view beyond the edge. Half resolution loses the finest waves.
    assert inner(error).mean() < (0.05 if method == "fast" else 0.02)
    assert error.mean() < 0.15


@pytest.mark.parametrize("speed", [3.7, 9.4])
def test_motion_beyond_the_wavelength_is_found(speed: float) -> None:
    texture = moving_texture(
        (speed, speed / 2), (2, 96, 128), waves=160, band=(0.05, 1.6)
    )
    error = np.hypot(*(flow(texture) - (speed, speed / 2)).transpose(2, 0, 1))
    assert np.median(error) < 0.03


@pytest.mark.parametrize("method", METHODS)
def test_rest_is_exactly_rest_and_blank_is_unknown(method: str) -> None:
    still = np.repeat(moving_texture((0, 0), (1, 40, 44)), 5, axis=0)
    result = unsmear.optical_flow(still, method=method)
    assert result.valid.all()
    assert (result.flow == 0).all()
    blank = unsmear.optical_flow(np.full((5, 33, 37), 0.1), method=method)
    assert np.isnan(blank.flow).all()
    assert (blank.confidence == 0).all()


@pytest.mark.parametrize("method", ["fast", "balanced", "accurate"])
def test_transposed_and_flipped_frames_turn_the_flow(
    frames: Array, method: str
) -> None:
    plain = flow(frames, method)
    turned = flow(frames.transpose(0, 2, 1), method).transpose(1, 0, 2)[..., ::-1]
    in_x = flow(frames[:, :, ::-1], method)[:, ::-1] * np.float32([-1, 1])
    # Red and black change places when the width is even, and the 45 degree filters are
    # freed of the mean along x: the solutions differ as unfinished relaxation does,
    # more where it was left at half the resolution.
    bound = 8e-3 if method == "fast" else 2e-3
    for other in (turned, in_x):
        assert np.abs(inner(other - plain)).mean() < bound
        assert np.abs(other - plain).max() < 0.15


def test_reversed_time_negates(frames: Array) -> None:
    forward, backward = flow(frames[:2]), flow(frames[1::-1])
    # Pixels are those of the other frame: the field is constant but for its error.
    assert np.abs(inner(forward + backward)).mean() < 0.02


@pytest.mark.parametrize(("gain", "offset"), [(255, 0), (-3, 7), (1e-9, 0), (1e-3, 1)])
def test_gain_and_offset_do_not_matter(
    frames: Array, gain: float, offset: float
) -> None:
    plain, other = flow(frames), flow(gain * frames + offset)
    # Samples in single precision move by 1e-7 of their range; 6e-8 by the offset.
    assert np.abs(other - plain).mean() < 1e-5
    assert np.abs(other - plain).max() < 1e-2


def test_sample_types_agree(frames: Array) -> None:
    eight = np.rint(255 * frames).astype(np.uint8)
    expected = flow(eight)
    for other in (eight.astype(np.uint16) * 257, eight / 255, eight.astype(np.float32)):
        assert np.abs(flow(other) - expected).max() < 1e-3


def test_change_of_light_between_the_frames_hardly_matters(frames: Array) -> None:
    lit = frames[:2].copy()
    lit[1] = 0.7 * lit[1] + 0.2
    assert np.abs(inner(flow(lit) - flow(frames[:2]))).mean() < 0.01


def test_colour_guides_but_does_not_rule(frames: Array) -> None:
    colour = np.stack([frames] * 3, axis=-1)
    grey = flow(frames)
    # Equal channels say what grey says; luma's weights sum to 1 but for rounding.
    assert np.abs(flow(colour, channel_axis=-1) - grey).mean() < 1e-4


def test_unknown_pixels_take_no_part(frames: Array) -> None:
    broken = frames.copy()
    broken[:, 20:26, 30:37] = np.nan
    mask = np.ones(frames.shape[1:], dtype=bool)
    mask[20:26, 30:37] = False
    wild = frames.copy()
    wild[:, ~mask] = np.random.default_rng(0).random((5, 42))
    r = unsmear.optical_flow(broken)
    masked = unsmear.optical_flow(wild, mask=mask)
    assert r.valid.mean() > 0.99
    for result in (r, masked):
        error = np.hypot(*(result.flow - (1.3, -0.7)).transpose(2, 0, 1))
        assert np.nanmax(inner(error)) < 0.2
    # All but the scale of brightness, which the wild pixels share in, is the same.
    assert np.nanmean(np.abs(masked.flow - r.flow)) < 1e-3


def test_a_flat_half_is_unknown() -> None:
    texture = moving_texture((1.3, -0.7), (2, 128, 256), waves=120, band=(0.3, 1.9))
    texture[:, :, 128:] = 0
    r = unsmear.optical_flow(texture)
    assert r.valid[:, :120].all()
    assert not r.valid[:, -24:].any()
    assert np.isnan(r.flow[~r.valid]).all()
    assert (r.confidence[~r.valid] == 0).all()


def test_confidence_falls_where_the_frames_do_not_match(frames: Array) -> None:
    pair = frames[:2].copy()
    other = moving_texture((0, 0), (1, 64, 72), seed=9, waves=120, band=(0.15, 1.9))[0]
    pair[1, 16:48, 16:48] = 0.5 + 0.2 * other[16:48, 16:48]
    confidence = unsmear.optical_flow(pair).confidence
    assert 0 <= confidence.min() <= confidence.max() <= 1
    assert confidence[24:40, 24:40].mean() < 0.5 * confidence[52:, 8:].mean()


def test_several_frames_are_used_only_where_motion_is_constant() -> None:
    constant = moving_texture((1.1, 0.4), (7, 64, 72), waves=120, band=(0.15, 1.9))
    rng = np.random.default_rng(3)
    noisy = constant + rng.normal(0, 0.1 * constant.std(), constant.shape)
    truth = (1.1, 0.4)
    two = np.hypot(*(flow(noisy) - truth).transpose(2, 0, 1)).mean()
    seven = np.hypot(*(flow(noisy, "steady") - truth).transpose(2, 0, 1)).mean()
    assert seven < 0.7 * two
    # Position a t^2/2 + v t: the texture of frame t drawn where it then is.
    moved = [
        moving_texture(
            (0, 0), (1, 64, 72), waves=120, band=(0.15, 1.9),
            offset=(-(1.1 * t + 0.2 * t * t), -0.4 * t),
        )[0]
        for t in range(-3, 4)
    ]  # fmt: skip
    speeding = np.stack(moved)
    truth = (1.3, 0.4)
    two = np.hypot(*(flow(speeding) - truth).transpose(2, 0, 1)).mean()
    seven = np.hypot(*(flow(speeding, "steady") - truth).transpose(2, 0, 1)).mean()
    assert seven <= 1.03 * two


@pytest.mark.parametrize("method", METHODS)
def test_any_number_of_threads_gives_the_same_bytes(frames: Array, method: str) -> None:
    before = unsmear.get_num_threads()
    try:
        results = []
        for count in (1, 2, 3):
            unsmear.set_num_threads(count)
            results.append(unsmear.optical_flow(frames, method=method))
    finally:
        unsmear.set_num_threads(before)
    for other in results[1:]:
        np.testing.assert_array_equal(other.flow, results[0].flow)
        np.testing.assert_array_equal(other.confidence, results[0].confidence)


@pytest.mark.parametrize("size", [(1, 1), (1, 17), (17, 1), (2, 2), (3, 2), (7, 13)])
@pytest.mark.parametrize("method", METHODS)
def test_small_pictures_are_answered(method: str, size: tuple[int, int]) -> None:
    r = unsmear.optical_flow(np.random.default_rng(1).random((5, *size)), method=method)
    assert r.flow.shape == (*size, 2)
    assert not np.isinf(r.flow).any()
    np.testing.assert_array_equal(r.valid, r.confidence > 0)


@pytest.mark.parametrize(
    ("error", "given", "message"),
    [
        (ValueError, {"pyramid_factor": 1.0}, r"pyramid_factor must be in \[0.4, 0.95"),
        (ValueError, {"warps": 0}, "warps must be >= 1, got 0"),
        (ValueError, {"smoothness": 0.0}, "smoothness must be > 0, got 0"),
        (ValueError, {"median_radius": 16}, "median_radius must be in 0..=15, got 16"),
        (ValueError, {"mask": np.ones((3, 3), bool)}, r"mask must have shape \(9, 11"),
        (TypeError, {"mask": np.ones((9, 11))}, "mask must be an array of bool"),
        (ValueError, {"index": -1}, "index must be before the last of 5 frames"),
        (
            ValueError,
            {"method": "thesis", "mask": np.ones((9, 11), bool)},
            "mask must be None for method 'thesis'",
        ),
    ],
)
def test_bad_arguments_are_named(
    error: type[Exception], given: dict[str, Any], message: str
) -> None:
    with pytest.raises(error, match=message):
        unsmear.optical_flow(np.zeros((5, 9, 11)), **given)


def test_what_smoothness_filled_in_is_not_trusted() -> None:
    """Plain faces of boxes: their flow is their outlines', and confidence says so."""
    scene = unsmear.synthetic.thesis_scene("vcbox", shape=(120, 150), n_frames=3)
    frames = np.rint(255 * np.clip(scene.sharp, 0, 1)).astype(np.uint8)
    r = unsmear.optical_flow(frames)
    windows = np.lib.stride_tricks.sliding_window_view(frames[1], (15, 15))
    plain = np.ptp(windows, axis=(2, 3)) == 0
    assert plain.mean() > 0.1
    # The finest filters reach 3 px and the averages behind them 9.
    assert r.confidence[7:-7, 7:-7][plain].max() < 0.1
    assert r.confidence.max() > 0.5
