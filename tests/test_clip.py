"""Clips read frame by frame, and their clocks."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import tifffile
import unsmear
from picture_helpers import assert_same, frames_of
from unsmear.streaming import clip as clips
from unsmear.streaming.clock import Clock, clock_of

SHAPE = (12, 17)
MS = Fraction(1, 1000)


@pytest.mark.parametrize("target", ["a.mkv", "a.tif", "a.gif", "frames"])
@pytest.mark.parametrize("colour", [False, True])
def test_every_frame_in_any_order(
    tmp_path: Path, target: str, colour: bool, monkeypatch
) -> None:
    monkeypatch.setattr(clips, "WINDOW", 3)
    frames = frames_of(np.uint8, 9, *SHAPE, *[3] * colour)
    unsmear.write_frames(tmp_path / target, frames)
    whole = unsmear.read_frames(tmp_path / target)
    with unsmear.open_clip(tmp_path / target) as clip:
        assert clip.shape == whole.shape and clip.dtype == whole.dtype
        assert len(clip) == 9 and clip.bits == 8
        assert_same(np.stack(list(clip)), whole)
        # Near, far ahead, behind the window, from the end.
        for index in (2, 3, 8, 1, 0, -1, -9):
            assert_same(clip[index], whole[index])
        assert_same(clip.between(-2, 3), whole[:3])
        with pytest.raises(IndexError, match="below 9, got 9"):
            clip[9]


def test_keeps_few_frames(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(clips, "WINDOW", 3)
    unsmear.write_frames(tmp_path / "a.tif", frames_of(np.uint8, 9, *SHAPE))
    with unsmear.open_clip(tmp_path / "a.tif") as clip:
        for _ in clip:
            assert len(clip._kept) <= 3


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("dtype", [np.uint16, np.float32, ">u2"])
def test_pages_of_tiff_one_by_one(tmp_path: Path, compression, dtype) -> None:
    frames = frames_of(np.uint16, 5, *SHAPE).astype(dtype)
    tifffile.imwrite(
        tmp_path / "a.tif", frames, compression=compression, photometric="minisblack"
    )
    with unsmear.open_clip(tmp_path / "a.tif") as clip:
        assert_same(np.stack(list(clip)), unsmear.read_frames(tmp_path / "a.tif"))


def test_white_may_be_low_and_pages_upside_down(tmp_path: Path) -> None:
    frames = frames_of(np.uint8, 3, *SHAPE)
    tifffile.imwrite(
        tmp_path / "a.tif",
        frames,
        photometric="miniswhite",
        extratags=[(274, "H", 1, 3, True)],
    )
    with unsmear.open_clip(tmp_path / "a.tif") as clip:
        assert_same(np.stack(list(clip)), unsmear.read_frames(tmp_path / "a.tif"))


def test_pages_that_cannot_be_told_apart_are_read_together(tmp_path: Path) -> None:
    frames = frames_of(np.uint8, 3, *SHAPE, 3)
    planes = np.moveaxis(frames, -1, 1)
    tifffile.imwrite(tmp_path / "a.tif", planes, imagej=True, metadata={"axes": "TCYX"})
    with unsmear.open_clip(tmp_path / "a.tif") as clip:
        assert_same(np.stack(list(clip)), frames)


def test_a_source_that_changes_is_noticed(tmp_path: Path) -> None:
    unsmear.write_frames(tmp_path / "f", frames_of(np.uint8, 5, *SHAPE))
    with unsmear.open_clip(tmp_path / "f") as clip:
        unsmear.write_image(tmp_path / "f" / "frame_0003.png", np.zeros((4, 4), "u1"))
        with pytest.raises(ValueError, match="must not change while it is read"):
            clip[3]


def test_fingerprints_tell_clips_apart(tmp_path: Path) -> None:
    frames = frames_of(np.uint8, 3, *SHAPE)
    changed = frames.copy()
    changed[2, 3, 4] ^= 1
    marks = set()
    for number, one in enumerate((frames, changed, frames[:2], frames)):
        unsmear.write_frames(tmp_path / f"{number}", one)
        with unsmear.open_clip(tmp_path / f"{number}") as clip:
            marks.add(clip.fingerprint)
    assert len(marks) == 3


def test_frames_per_second(tmp_path: Path) -> None:
    unsmear.write_frames(tmp_path / "f", frames_of(np.uint8, 2, *SHAPE))
    with unsmear.open_clip(tmp_path / "f", fps=29.97) as clip:
        assert clip.clock.rate == Fraction(2997, 100) and not clip.has_clock
    with unsmear.open_clip(tmp_path / "f") as clip:
        assert clip.clock.rate == 25
    with pytest.raises(ValueError, match="fps must be a positive finite number"):
        unsmear.open_clip(tmp_path / "f", fps=0)
    unsmear.write_frames(tmp_path / "a.gif", frames_of(np.uint8, 2, *SHAPE))
    with pytest.raises(ValueError, match="which has a clock"):
        unsmear.open_clip(tmp_path / "a.gif", fps=10)


def test_a_rate_survives_rounded_stamps() -> None:
    rate = Fraction(30000, 1001)
    stamps = [round(n / rate / MS) for n in range(500)]
    assert clock_of(stamps, MS, rate).rate == rate
    assert clock_of(stamps, MS, rate).stamps is None
    # Without word from the container the mean has to do.
    found = clock_of(stamps, MS, None)
    assert abs(found.rate - rate) < 1e-3


def test_stamps_that_vary_are_kept() -> None:
    stamps = [0, 33, 70, 200]
    clock = clock_of(stamps, MS, Fraction(30))
    assert clock.stamps == tuple(stamps) and clock.rate == Fraction(15)
    assert clock.ticks(4) == (MS, stamps)
    assert clock.delays(4, Fraction(1, 100)) == [3, 4, 13, 7]


@pytest.mark.parametrize("stamps", [[None, 40], [40, 40], [80, 40]])
def test_useless_stamps_are_passed_over(stamps) -> None:
    clock = clock_of(stamps, MS, Fraction(24))
    assert clock.rate == 24 and clock.stamps is None


def test_the_start_is_kept_for_the_sound() -> None:
    clock = Clock(Fraction(25), MS, start=Fraction(1, 5))
    assert clock.ticks(3) == (Fraction(1, 25), [5, 6, 7])
