"""Laws of the coarse-to-fine methods: symmetries, types, confidence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from textures import moving_texture

Array = NDArray[Any]

METHODS = ("fast", "balanced", "accurate", "steady", "steady-accurate")
DENSE = (0.15, 1.9)


def texture(velocity: tuple[float, float], shape: tuple[int, int, int]) -> Array:
    """A texture in [0.1, 0.9] that moves at ``velocity``."""
    frames = moving_texture(velocity, shape, waves=120, band=DENSE)
    low, high = frames.min(), frames.max()
    return 0.1 + 0.8 * (frames - low) / (high - low)


@pytest.fixture(scope="module")
def frames() -> Array:
    return texture((1.3, -0.7), (5, 64, 72))


@pytest.fixture(scope="module")
def occlusion() -> tuple[Array, Array]:
    """A square that moves by (3, 1) over a background that moves by (-1, 0)."""
    behind = moving_texture((-1, 0), (2, 128, 128), seed=1, waves=120, band=DENSE)
    before = moving_texture((3, 1), (2, 128, 128), seed=2, waves=120, band=DENSE)
    truth = np.full((128, 128, 2), (-1, 0), np.float32)
    truth[40:88, 40:88] = (3, 1)
    for t in range(2):
        rows, columns = slice(40 + t, 88 + t), slice(40 + 3 * t, 88 + 3 * t)
        behind[t, rows, columns] = before[t, rows, columns]
    return np.rint(127 + 40 * behind).clip(0, 255).astype(np.uint8), truth


def flow(frames: Any, method: str = "balanced", **given: Any) -> Array:
    return unsmear.optical_flow(frames, method=method, **given).flow


def inner(field: Array, margin: int = 8) -> Array:
    return field[margin:-margin, margin:-margin]


def distance(one: Array, other: Any) -> Array:
    return np.hypot(*(one - np.asarray(other)).transpose(2, 0, 1))


# Symmetries


@pytest.mark.parametrize("method", METHODS)
def test_a_shift_of_the_picture_is_its_flow(method: str) -> None:
    rng = np.random.default_rng(4)
    wide = rng.integers(0, 256, (84, 92)).astype(np.float64)
    wide = wide + np.roll(wide, 1, 0) + np.roll(wide, 1, 1) + np.roll(wide, 2, 1)
    # What was at x is at x + 2 a frame later; what was at y, at y - 3.
    moved = np.stack([wide[t * 3 :, 8 - 2 * t :][:64, :72] for t in range(5)])
    found = flow(moved, method)
    # Its frequencies reach up to the highest: half resolution sees few of them.
    bound = 0.1 if method == "fast" else 0.01
    assert np.median(distance(found, (2, -3))) < bound


@pytest.mark.parametrize("method", METHODS)
def test_mirrored_and_transposed_frames_mirror_the_flow(
    frames: Array, method: str
) -> None:
    plain = flow(frames, method)
    in_y = flow(frames[:, ::-1], method)[::-1] * np.float32([1, -1])
    in_x = flow(frames[:, :, ::-1], method)[:, ::-1] * np.float32([-1, 1])
    turned = flow(frames.transpose(0, 2, 1), method).transpose(1, 0, 2)[..., ::-1]
    # The order of relaxation and which filters are freed of the mean along x change:
    # the solutions differ as an unfinished relaxation does.
    for other in (in_y, in_x, turned):
        assert np.abs(inner(other - plain)).mean() < (
            1e-2 if method == "fast" else 3e-3
        )


@pytest.mark.parametrize("method", METHODS)
def test_reversed_time_negates(frames: Array, method: str) -> None:
    forward = flow(frames, method, index=1)
    backward = flow(frames[::-1], method, index=2)  # frame 2 back to frame 1
    # The motion is constant: the two differ by their errors alone.
    bound = 0.06 if method == "fast" else 0.02
    assert np.abs(inner(forward + backward)).mean() < bound


def test_there_and_back_leads_home() -> None:
    zoom = unsmear.synthetic.zoom(
        unsmear.synthetic.texture((130, 130), seed=2), 0.03, shape=(96, 96)
    )
    pair = zoom.sharp[:2]
    there, back = flow(pair, index=0), flow(pair[::-1], index=0)
    rows, columns = np.mgrid[:96, :96]
    to_y = np.clip(np.rint(rows + there[..., 1]), 0, 95).astype(int)
    to_x = np.clip(np.rint(columns + there[..., 0]), 0, 95).astype(int)
    # Read at the nearest pixel, the field's slope of 0.03 errs by up to 0.02 px.
    assert inner(distance(there, -back[to_y, to_x])).mean() < 0.05


@pytest.mark.parametrize("method", METHODS)
def test_flow_does_not_depend_on_gain_offset_or_sign(
    frames: Array, method: str
) -> None:
    plain = flow(frames, method)
    for gain, offset in ((255.0, -3.0), (-1.0, 1.0)):
        difference = np.abs(flow(gain * frames + offset, method) - plain)
        # 1e-7 of single precision, raised by the medians where two candidates tie.
        assert difference.mean() < 1e-5
        assert np.quantile(difference, 0.99) < 1e-4


# Types, layouts, unknown pixels


@pytest.mark.parametrize("method", METHODS)
def test_types_and_layouts_of_one_picture_have_one_flow(
    frames: Array, method: str
) -> None:
    grey = np.rint(255 * frames[:, :40, :44]).astype(np.uint8)
    expected = flow(grey, method)
    same = (grey.astype(np.uint16) * 257, (grey / 255).astype(np.float32))
    for other in (*same, grey.astype(np.float16), grey.astype(">i2")):
        assert np.abs(flow(other, method) - expected).max() < 1e-3
    read_only = grey[:, ::-1].copy()[:, ::-1]
    read_only.flags.writeable = False
    for layout in (np.asfortranarray(grey), read_only, np.ma.masked_array(grey)):
        np.testing.assert_array_equal(flow(layout, method), expected)


def test_layouts_of_one_colour_picture_have_one_flow(frames: Array) -> None:
    """Colour is read where it lies: packed, by channel, backwards, off the grid."""
    grey = np.rint(255 * frames[:2, :40, :44])
    colour = np.stack([grey, 255 - grey, grey[:, ::-1]], -1).astype(np.uint8)
    expected = flow(colour, "fast", channel_axis=-1)
    backwards = colour[..., ::-1].copy()[..., ::-1]
    np.testing.assert_array_equal(flow(backwards, "fast", channel_axis=-1), expected)
    for axis in (0, 1, 2):
        apart = np.ascontiguousarray(np.moveaxis(colour, -1, axis))
        np.testing.assert_array_equal(flow(apart, "fast", channel_axis=axis), expected)
    record = np.zeros(colour.shape, np.dtype([("odd", "u1"), ("sample", "f8")]))
    record["sample"] = colour
    assert not record["sample"].flags.aligned
    np.testing.assert_array_equal(
        flow(record["sample"], "fast", channel_axis=-1), expected
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_one_bad_pixel_stays_local(frames: Array, method: str, bad: float) -> None:
    plain = flow(frames, method)
    broken = frames.copy()
    broken[2, 30, 30] = bad
    found = flow(broken, method)
    assert np.isfinite(found).all()
    rows, columns = np.mgrid[:64, :72]
    far = np.maximum(abs(rows - 30), abs(columns - 30)) > 16
    # The solver ties all pixels together, ever more weakly.
    assert np.abs(found - plain)[far].mean() < 2e-3
    assert distance(found, plain).max() < 0.3


@pytest.mark.parametrize("method", METHODS)
def test_flat_static_sky_is_unknown_and_the_rest_is_not(method: str) -> None:
    sky = texture((1.3, -0.7), (5, 160, 128))
    sky[:, :96] = 0.8
    r = unsmear.optical_flow(sky, method=method)
    # The horizon is still seen from some 7 px of an eighth of the size.
    assert np.isnan(r.flow[:24]).all()
    assert (r.confidence[:24] == 0).all()
    assert not r.valid[:24].any()
    assert r.valid[104:].all()
    assert r.confidence[40:80].mean() < 0.1 * r.confidence[108:].mean()


# Confidence


@pytest.mark.parametrize("method", ["fast", "balanced", "accurate"])
def test_error_falls_as_confidence_rises(
    occlusion: tuple[Array, Array], method: str
) -> None:
    pair, truth = occlusion
    r = unsmear.optical_flow(pair, method=method)
    densities = np.array([1.0, 0.9, 0.7, 0.5, 0.3])
    curve = unsmear.metrics.sparsification(
        r.flow, r.confidence, truth, densities=densities
    )
    # Below 0.02 px errors are those of the interpolation, which nothing foretells.
    assert (np.diff(curve["epe"]) < 1e-3).all(), curve
    assert curve["epe"][2] < 0.5 * curve["epe"][0], curve


def test_confidence_drops_at_motion_boundaries(
    occlusion: tuple[Array, Array],
) -> None:
    pair, _ = occlusion
    confidence = unsmear.optical_flow(pair).confidence
    boundary = confidence[44:84, [38, 39, 40, 41, 86, 87, 88, 89]].mean()
    assert boundary < 0.3 * confidence[52:76, 52:76].mean()
    assert boundary < 0.3 * confidence[8:24, 8:120].mean()


def test_confidence_drops_where_only_a_straight_edge_is_seen() -> None:
    """Half of the picture is stripes, which show no motion along themselves."""
    pair = texture((0.6, 0.8), (2, 96, 160))
    columns = np.arange(80)
    for t in range(2):
        pair[t, :, :80] = 0.5 + 0.3 * np.sin(2 * np.pi * (columns - 0.6 * t) / 9)
    r = unsmear.optical_flow(pair)
    # Slanted filters misread their own slope on stripes by 0.2 rad/px: not quite 0.
    assert r.confidence[24:72, 16:56].mean() < 0.5 * r.confidence[24:72, 104:144].mean()


def test_the_way_back_only_takes_confidence(occlusion: tuple[Array, Array]) -> None:
    pair, truth = occlusion
    one, both = (
        unsmear.optical_flow(pair, forward_backward=there_and_back)
        for there_and_back in (False, True)
    )
    np.testing.assert_array_equal(both.flow, one.flow)
    assert (both.confidence <= one.confidence).all()
    # The background hidden next: beside the square, on the side it moves to.
    hidden = np.zeros((128, 128), bool)
    hidden[44:84, 89:91] = True
    wrong = distance(one.flow, truth) > 1
    lost = both.confidence / np.maximum(one.confidence, 1e-6)
    assert lost[hidden & wrong].mean() < 0.5 < lost[56:72, 56:72].mean()


# What precision is for


def test_a_smooth_pattern_is_followed_as_phase_allows() -> None:
    """Waves of 10 to 20 px turn about the middle over a background at rest."""
    angle = np.deg2rad(2)
    rows, columns = np.mgrid[:128, :128] - 63.5
    inside = np.hypot(rows, columns) < 40
    rng = np.random.default_rng(0)
    waves = rng.normal(size=(12, 2))
    waves *= (2 * np.pi / rng.uniform(10, 20, 12) / np.hypot(*waves.T))[:, None]
    phases = rng.uniform(0, 2 * np.pi, 12)
    ground = 60 * np.sin(0.9 * columns + 0.4 * rows) + 40 * np.sin(1.1 * rows)

    def frame(turn: float) -> Array:
        x = np.cos(turn) * columns + np.sin(turn) * rows
        y = np.cos(turn) * rows - np.sin(turn) * columns
        disc = sum(
            np.cos(kx * x + ky * y + phase)
            for (kx, ky), phase in zip(waves, phases, strict=True)
        )
        return np.where(inside, 12 * np.asarray(disc), ground)

    pair = np.rint(127 + np.stack([frame(0), frame(angle)])).clip(0, 255)
    truth = np.stack([-np.sin(angle) * rows, np.sin(angle) * columns], axis=-1)
    truth -= (1 - np.cos(angle)) * np.stack([columns, rows], axis=-1)
    known = np.hypot(rows, columns) < 36
    error = [
        distance(flow(pair.astype(np.uint8), precision_scale=scale), truth)[
            known
        ].mean()
        for scale in (0.25, 0.0)
    ]
    # Motion is 0.8 px on average; a third of it was lost to smoothness.
    assert error[0] < 0.5 * error[1]
    assert error[0] < 0.2
