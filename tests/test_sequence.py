"""Whole clips restored without a parameter."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.restoration.memo import Memo

SHAPE = (128, 128)


@pytest.fixture(scope="module")
def pan() -> synthetic.Sequence:
    return synthetic.translation(
        synthetic.texture((220, 220), seed=6),
        (8.0, 3.0),
        shape=SHAPE,
        exposure=1.0,
        n_frames=3,
        noise=1.0,
        bits=8,
    )


@pytest.fixture(scope="module")
def restored(pan: synthetic.Sequence) -> unsmear.SequenceResult:
    return unsmear.deblur_sequence(pan.blurred, indices=[1])


def gain(picture: Any, blurred: Any, sharp: Any) -> float:
    inner = (slice(24, -24),) * 2
    return unsmear.metrics.psnr(picture[inner], sharp[inner]) - unsmear.metrics.psnr(
        blurred[inner], sharp[inner]
    )


def test_restores_without_being_told_anything(
    pan: synthetic.Sequence, restored: unsmear.SequenceResult
) -> None:
    # Measured 4.2, with the true motion 4.9 (a texture without edges is the hardest);
    # a wrong sign, a lost half of the blur or no restoration give below 1.
    assert gain(restored.frames[0], pan.blurred[1], pan.sharp[1]) > 3.5
    report = restored.reports[0]
    assert report["exposure"] == pytest.approx(1.0, abs=0.05)
    assert report["verdict"] == "restored"
    assert report["expected_gain_db"] > 3
    json.dumps(report, allow_nan=False)


def test_keeps_type_shape_and_input(
    pan: synthetic.Sequence, restored: unsmear.SequenceResult
) -> None:
    assert restored.frames.dtype == pan.blurred.dtype
    assert restored.frames.shape == (1, *SHAPE)
    assert restored.flows.shape == (1, *SHAPE, 2)


def test_repeats_bit_for_bit_with_any_number_of_threads(
    pan: synthetic.Sequence, restored: unsmear.SequenceResult
) -> None:
    before = unsmear.get_num_threads()
    try:
        unsmear.set_num_threads(before % 2 + 1)
        again = unsmear.deblur_sequence(pan.blurred, indices=[-2])
    finally:
        unsmear.set_num_threads(before)
    np.testing.assert_array_equal(again.frames, restored.frames)
    assert again.reports == restored.reports


def test_a_still_clip_comes_back_as_it_is() -> None:
    frame = (255 * synthetic.texture((96, 96), seed=1)).clip(0, 255).astype(np.uint8)
    clip = np.stack([frame] * 3)
    result = unsmear.deblur_sequence(clip)
    np.testing.assert_array_equal(result.frames, clip)
    assert "left as is" in result.reports[0]["verdict"]


def test_a_small_mover_is_restored_and_the_still_rest_untouched() -> None:
    back = synthetic.texture((200, 200), seed=2)
    front = synthetic.texture((200, 200), seed=9)
    y, x = np.mgrid[:200, :200]
    disc = (np.hypot(y - 99.5, x - 99.5) < 26).astype(float)
    clip = synthetic.layers(
        back,
        front,
        disc,
        shape=SHAPE,
        background_motion=synthetic.translating((0.0, 0.0)),
        foreground_motion=synthetic.translating((7.0, 2.0)),
        exposure=0.8,
        n_frames=3,
        bits=8,
    )
    result = unsmear.deblur_sequence(clip.blurred, indices=[1], exposure=0.8)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]] - 63.5
    mover = np.hypot(row, column) < 18
    still = np.hypot(row, column) > 45
    np.testing.assert_array_equal(result.frames[0][still], clip.blurred[1][still])

    def error(picture: Any) -> float:
        return float(
            np.mean((picture[mover].astype(float) - clip.sharp[1][mover]) ** 2)
        )

    # Measured 0.79 (36 px of texture without edges); voted down it would be 1.
    assert error(result.frames[0]) < 0.9 * error(clip.blurred[1])


def test_memory_does_not_grow_with_the_clip() -> None:
    memo = Memo()
    for index in range(40):
        for other in range(max(0, index - 2), index + 3):
            memo.get("value", other, object)
        memo.forget_before(index - 2)
    assert len(memo) <= 5


def test_memory_spares_what_guides_the_next_pass() -> None:
    memo = Memo()
    for index in range(10):
        for kind in ("value", "restored"):
            memo.get(kind, index, object)
    memo.forget_before(8, "restored", 5)
    made: list[tuple[str, int]] = []
    for kind in ("value", "restored"):
        for index in range(10):
            memo.get(kind, index, lambda key=(kind, index): made.append(key))
    assert made == [("value", k) for k in range(8)] + [
        ("restored", k) for k in range(5)
    ]
    # Less is spared than is kept anyway: nothing more is dropped.
    memo.forget_before(3, "restored", 7)
    memo.get("restored", 3, lambda: made.append(("again", 3)))
    assert ("again", 3) not in made


@pytest.mark.filterwarnings("error")
def test_a_frame_of_which_nothing_is_known_comes_back_so() -> None:
    frames = np.random.default_rng(0).random((3, 40, 50), np.float32)
    frames[1] = np.nan
    result = unsmear.deblur_sequence(frames)
    np.testing.assert_array_equal(result.frames, frames)
    assert [report["blur_px"] for report in result.reports] == [None] * 3


def test_bad_input_is_named(pan: synthetic.Sequence) -> None:
    frames = pan.blurred
    for options, words in [
        ({"exposure": "long"}, "exposure must be"),
        ({"exposure": -1.0}, "exposure must be"),
        ({"joint": 2}, "joint must be"),
        ({"indices": [3]}, "indices must be"),
        ({"indices": []}, "indices must name"),
        ({"flow_method": "thesis"}, "flow_method must be"),
        ({"noise": float("nan")}, "noise must be"),
        ({"channel_axis": 7}, "channel_axis must name"),
    ]:
        with pytest.raises(ValueError, match=words):
            unsmear.deblur_sequence(frames, **options)
    with pytest.raises(ValueError, match="at least 2"):
        unsmear.deblur_sequence(frames[:1])
    with pytest.raises(ValueError, match="frames must have shape"):
        unsmear.deblur_sequence(frames[0])
