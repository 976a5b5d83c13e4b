"""Clips restored with several frames at once: better, calmer, and never worse."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.restoration.agreement import agreed
from unsmear.restoration.clip_exposure import ClipExposure, Exposure
from unsmear.restoration.sampling import pulled

SHAPE = (112, 112)
MIDDLE = [1, 2]
INNER = (slice(24, -24),) * 2


@pytest.fixture(scope="module")
def pan() -> synthetic.Sequence:
    y, x = np.mgrid[:220, :220]
    picture = 0.6 * synthetic.texture((220, 220), seed=6, exponent=1.2)
    picture += 0.4 * ((y // 19 + x // 14) % 2)
    return synthetic.translation(
        picture,
        (7.5, 3.0),
        shape=SHAPE,
        exposure=1.0,
        n_frames=4,
        noise=1.0,
        bits=8,
    )


@pytest.fixture(scope="module")
def alone(pan: synthetic.Sequence) -> unsmear.SequenceResult:
    return unsmear.deblur_sequence(pan.blurred, indices=MIDDLE, joint=1)


@pytest.fixture(scope="module")
def joint(pan: synthetic.Sequence) -> unsmear.SequenceResult:
    return unsmear.deblur_sequence(pan.blurred, indices=MIDDLE)


def quality(frames: Any, pan: synthetic.Sequence) -> float:
    """Mean PSNR of the two frames in the middle, dB."""
    inner = [
        unsmear.metrics.psnr(frame[INNER], pan.sharp[i][INNER])
        for frame, i in zip(frames, MIDDLE, strict=True)
    ]
    return float(np.mean(inner))


def flicker(first: Any, second: Any, flow: Any) -> float:
    """Root mean square difference along the motion, grey levels."""
    difference = pulled(second.astype(np.float32), flow) - first
    return float(np.sqrt(np.nanmean(difference[INNER] ** 2)))


def test_frames_blurred_alike_still_help_each_other(
    pan: synthetic.Sequence,
    alone: unsmear.SequenceResult,
    joint: unsmear.SequenceResult,
) -> None:
    # Three looks at one blur are one look with less noise.
    assert quality(joint.frames, pan) > quality(alone.frames, pan) + 0.5
    for report in joint.reports:
        assert report["joint"] == 3
        assert report["neighbours_weight"] > 0.5
        assert report["kept_alone"] < 0.1
        json.dumps(report, allow_nan=False)


def test_a_neighbour_may_be_hardly_blurred(
    monkeypatch: pytest.MonkeyPatch, pan: synthetic.Sequence
) -> None:
    found = ClipExposure.exposure

    def exposure(self: ClipExposure, index: int) -> Exposure:
        one = found(self, index)
        return replace(one, status="small") if index == 2 else one

    monkeypatch.setattr(ClipExposure, "exposure", exposure)
    result = unsmear.deblur_sequence(pan.blurred, indices=[1, 2])
    assert result.reports[0]["neighbours_weight"] > 0.5
    assert "neighbours_weight" not in result.reports[1]


def test_restored_clips_do_not_flicker(
    pan: synthetic.Sequence,
    alone: unsmear.SequenceResult,
    joint: unsmear.SequenceResult,
) -> None:
    flow = pan.flow[MIDDLE[0]]
    one, three = (flicker(*result.frames, flow) for result in (alone, joint))
    recorded = flicker(*pan.blurred[MIDDLE], flow)
    true = flicker(*pan.sharp[MIDDLE], flow)
    assert three < 0.8 * one
    # Detail is not carried exactly between pixels, in the truth neither.
    assert three < np.hypot(recorded, true)


def test_a_frame_does_not_depend_on_which_are_asked_for(
    pan: synthetic.Sequence, joint: unsmear.SequenceResult
) -> None:
    again = unsmear.deblur_sequence(pan.blurred, indices=MIDDLE[1:], joint=3)
    np.testing.assert_array_equal(again.frames[0], joint.frames[1])
    assert again.reports[0] == joint.reports[1]


def test_agreement_is_a_mean_along_the_motion() -> None:
    rng = np.random.default_rng(5)
    truth = 255 * synthetic.texture((60, 70), seed=3, exponent=1.6)
    truth = truth.astype(np.float32)[np.newaxis]
    way = np.full((60, 70, 2), (3.0, -2.0), np.float32)
    everywhere = np.ones((60, 70), np.float32)
    grain = rng.normal(size=(3, 1, 60, 70)).astype(np.float32)
    neighbours = [
        (np.roll(truth, (2 * s, -3 * s), (1, 2)) + part, -s * way, everywhere)
        for s, part in zip((1, -1), grain[1:], strict=True)
    ]
    mean = agreed(truth + grain[0], neighbours, noise=1.0)
    inside = np.s_[0, 6:-6, 6:-6]
    left = (mean - truth)[inside].std()
    # Three equal noises, one of them whole: whole px carry it unchanged.
    assert left == pytest.approx(3**-0.5, rel=0.05)
    # Nothing believed, nothing changed; unknown motion is no motion to anywhere.
    unknown = [(neighbours[0][0], np.full_like(way, np.nan), everywhere)]
    nowhere = [(neighbours[0][0], way, 0 * everywhere)]
    for others in ([], unknown, nowhere):
        np.testing.assert_array_equal(agreed(truth, others, noise=1.0), truth)


def test_agreement_leaves_out_what_differs() -> None:
    own = np.zeros((1, 50, 50), np.float32)
    other = own.copy()
    other[0, :, 30:] = 100.0
    still = np.zeros((50, 50, 2), np.float32)
    everywhere = np.ones((50, 50), np.float32)
    mean = agreed(own, [(other, still, everywhere)], noise=0.0)
    assert np.abs(mean[0, :, :20]).max() < 1e-6
    # Of 100 grey levels w / (1 + w) is left, w = (64 / (64 + 100^2))^2.
    assert 0 < mean[0, :, 40:].max() < 0.01


def test_what_is_hardly_blurred_is_restored_by_itself() -> None:
    clip = synthetic.translation(
        synthetic.texture((140, 140), seed=6, exponent=1.2),
        (1.6, 0.5),
        shape=(96, 96),
        n_frames=3,
        noise=1.0,
        bits=8,
    )
    alone, joint = (
        unsmear.deblur_sequence(clip.blurred, indices=[1], joint=n) for n in (1, 3)
    )
    assert alone.reports[0]["exposure_status"] == "small"
    np.testing.assert_array_equal(joint.frames, alone.frames)
