"""Lines of interlaced frames that lie closer in pairs than they should."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray
from scipy import ndimage
from unsmear import synthetic
from unsmear.restoration.line_pairing import (
    LinePairing,
    as_recorded,
    line_offsets,
    measured,
)
from unsmear.restoration.looks import cropped
from unsmear.restoration.memo import Memo
from unsmear.restoration.source import Source

Plane = NDArray[np.float64]
SIZE = 160
FREQUENCY = np.fft.fftfreq(SIZE)


def scene(seed: int, offset: float = 0.0) -> Plane:
    """Return a periodic scene of power 1/f^2, odd lines read ``offset`` px lower.

    Read by its Fourier series: exactly.
    """
    rng = np.random.default_rng(seed)
    radius = np.hypot(*np.meshgrid(FREQUENCY, FREQUENCY))
    spectrum = np.fft.fft2(rng.normal(size=(SIZE, SIZE))) / np.maximum(radius, 0.01)
    spectrum[0, 0] = spectrum[SIZE // 2] = 0

    def lower(way: float) -> Plane:
        turned = spectrum * np.exp(2j * np.pi * FREQUENCY * way)[:, np.newaxis]
        return np.asarray(np.fft.ifft2(turned).real, np.float64)

    picture = lower(-offset / 2)
    picture[1::2] = lower(offset / 2)[1::2]
    return np.asarray(100 + 40 * picture / picture.std(), np.float64)


@pytest.mark.parametrize("offset", [-0.35, -0.2, 0.15, 0.3])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_the_offset_of_odd_lines_is_found(offset: float, noise: float) -> None:
    paired = scene(1, offset) + noise * np.random.default_rng(2).normal(
        size=(SIZE, SIZE)
    )
    found = measured(paired)
    # A frame of 160 x 160 tells it to .01 to .02.
    assert abs(found.offset - offset) < 0.04
    assert found.deviation < 0.03
    assert found.explained > 0.85
    assert abs(measured(paired.T).offset) < 0.05


@pytest.mark.parametrize("blur", [(1, 1), (7, 1), (1, 7), (7, 7)])
def test_even_lines_are_found_even_whatever_blurred_them(blur: tuple[int, int]) -> None:
    picture = ndimage.uniform_filter(scene(3), blur, mode="wrap")
    assert abs(measured(picture).offset) < 0.03


def test_the_first_line_may_be_an_odd_one_or_unknown() -> None:
    paired = scene(4, 0.25)
    assert abs(measured(paired[1:]).offset + 0.25) < 0.04
    paired[:3] = np.nan
    assert abs(measured(paired).offset - 0.25) < 0.04
    paired[20, 50:80] = np.nan
    assert abs(measured(paired).offset - 0.25) < 0.05


@pytest.mark.parametrize(
    "plane",
    [
        pytest.param(np.full((64, 64), np.nan), id="unknown throughout"),
        pytest.param(np.full((64, 64), 7.0), id="flat"),
        pytest.param(scene(1)[:30], id="few lines"),
        pytest.param(scene(1)[:, :30], id="few columns"),
    ],
)
def test_nothing_to_measure_says_nothing(plane: Plane) -> None:
    assert measured(plane).offset == 0


def offsets(frames: list[Plane]) -> list[float]:
    """Return what a clip of these frames is believed to have."""
    lines = LinePairing(Source(np.clip(frames, 0, 255).astype(np.uint8), None), Memo())
    return [lines.offset(index) for index in range(len(frames))]


def test_a_clip_is_believed_when_most_of_its_frames_agree() -> None:
    even, down, up = (
        [scene(seed, offset) for seed in (5, 6)] for offset in (0.0, 0.25, -0.25)
    )
    assert all(abs(found - 0.25) < 0.04 for found in offsets([*down, even[0]]))
    assert offsets([down[0], *even]) == [0.0] * 3
    assert offsets([*down, up[0]]) == [0.0] * 3
    assert offsets([scene(seed, 0.06) for seed in (5, 6)]) == [0.0] * 2


def test_columns_that_pair_as_lines_do_are_no_fields() -> None:
    """Something has resampled the frame: an enlargement, a codec."""
    both = []
    for seed in (7, 8):
        picture = scene(seed, 0.25)
        waves = np.fft.fft(picture, axis=1)
        for start, way in ((0, -0.125), (1, 0.125)):
            moved = np.fft.ifft(waves * np.exp(2j * np.pi * FREQUENCY * way)).real
            picture[:, start::2] = moved[:, start::2]
        both.append(picture)
    assert abs(measured(both[0]).offset - 0.25) < 0.04
    assert abs(measured(both[0].T).offset - 0.25) < 0.04
    assert offsets(both) == [0.0, 0.0]


@pytest.mark.parametrize("order", [0, 1, 3])
def test_enlarged_frames_are_not_interlaced(order: int) -> None:
    enlarged = [
        ndimage.zoom(
            scene(seed)[:80, :80], (2, 1), order=order, grid_mode=True, mode="nearest"
        )
        for seed in (7, 8)
    ]
    assert offsets(enlarged) == [0.0, 0.0]


def test_restorations_are_shown_where_lines_lie() -> None:
    pad = 3
    y = np.arange(30.0)[:, np.newaxis] + np.zeros(40)
    ramp = np.ascontiguousarray((2 * y)[np.newaxis], np.float32)
    inner = cropped(ramp, pad)
    np.testing.assert_array_equal(as_recorded(ramp, pad, 0.0), inner)
    shown = as_recorded(ramp, pad, 0.2)
    # Not next to the edges, from which splines ring.
    np.testing.assert_allclose((shown - inner)[0, 4:-4:2], -0.2, atol=1e-3)
    np.testing.assert_allclose((shown - inner)[0, 5:-4:2], 0.2, atol=1e-3)
    lines = line_offsets((4, 2), 0.2)
    assert lines is not None
    np.testing.assert_allclose(lines[:, 0], [[0, -0.1], [0, 0.1]] * 2)


def paired_clip(offset: float) -> tuple[Any, Any]:
    """Return a clip and its truth, odd lines ``offset`` px lower."""
    texture = synthetic.texture((260, 260), seed=4, exponent=1.3)
    clip = synthetic.translation(
        texture, (4.0, 6.0), shape=(140, 140), n_frames=3, exposure=0.9
    )
    y, x = np.mgrid[:140, :140].astype(float)
    y += np.where(y % 2 == 1, offset / 2, -offset / 2)

    def read(frames: NDArray[Any]) -> Plane:
        planes = [
            ndimage.map_coordinates(frame.astype(float), (y, x), order=5, mode="mirror")
            for frame in frames
        ]
        return np.asarray(planes, np.float64)

    noise = np.random.default_rng(1).normal(0, 1, clip.blurred.shape)
    blurred = np.rint(255 * read(clip.blurred) + noise)
    return np.clip(blurred, 0, 255).astype(np.uint8), 255 * read(clip.sharp)


def test_a_clip_of_paired_lines_is_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    """Taken for even, its lines cost most of the gain."""
    blurred, sharp = paired_clip(-0.25)
    inner = (slice(16, -16),) * 2

    def gain(result: Any) -> float:
        before, after = (
            np.mean((picture[inner] - sharp[1][inner]) ** 2)
            for picture in (blurred[1].astype(float), result.frames[0].astype(float))
        )
        return float(10 * np.log10(before / after))

    known = unsmear.deblur_sequence(blurred, indices=[1])
    assert abs(known.reports[0]["line_pairing"] + 0.25) < 0.04
    monkeypatch.setattr(LinePairing, "offset", lambda *_: 0.0)
    assert gain(known) > 5
    assert gain(known) > gain(unsmear.deblur_sequence(blurred, indices=[1])) + 2


def test_a_recorded_clip_of_paired_lines(test_data: Callable[[str], Path]) -> None:
    folder = test_data("slowmotion/blur_video/nasa")
    blurred, sharp = (
        unsmear.read_frames(sorted(folder.glob(f"{name}_*.png")))[..., 0]
        for name in ("blur", "sharp")
    )
    result = unsmear.deblur_sequence(blurred)
    assert all(-0.25 < one["line_pairing"] < -0.12 for one in result.reports)
    inner = (slice(24, -24),) * 2
    gains = [
        unsmear.metrics.psnr(after[inner], truth[inner])
        - unsmear.metrics.psnr(before[inner], truth[inner])
        for before, after, truth in zip(blurred, result.frames, sharp, strict=True)
    ]
    assert np.mean(gains) > 1.5
    assert min(gains) > 0.9
