"""Videos: lossless and lossy round trips, rotation, cut and crashing files."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from picture_helpers import assert_same, frames_of
from unsmear.sequences import read_frames, write_frames
from unsmear.video import read_video

DTYPES = [np.uint8, np.uint16]


@pytest.mark.parametrize("suffix", [".mkv", ".avi"])
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(3, 20, 30), (3, 21, 31, 3)])
def test_lossless_video_round_trip(tmp_path: Path, suffix: str, dtype: type, shape):
    pytest.importorskip("av")
    frames = frames_of(dtype, *shape)
    write_frames(tmp_path / f"a{suffix}", frames)
    assert_same(read_frames(tmp_path / f"a{suffix}"), frames)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("size", [(48, 64), (47, 63)])
def test_lossy_video_is_close(tmp_path: Path, size: tuple[int, int]):
    pytest.importorskip("av")
    y, x = np.mgrid[: size[0], : size[1]]
    waves = [0.5 + 0.4 * np.sin((x + 2 * t) / 9) * np.cos(y / 7) for t in range(6)]
    frames = np.stack([waves] * 3, axis=-1)
    write_frames(tmp_path / "a.mp4", frames, fps=29.97)
    read = read_frames(tmp_path / "a.mp4")
    assert read.dtype == np.uint8
    assert read.shape == frames.shape
    # Smooth grey waves: the coder's own noise at this quality is about 1 grey level; a
    # wrong colour matrix or range would show as 10 and more.
    assert np.abs(read - 255 * frames).mean() < 2.5


def test_camera_rotation_of_a_video(tmp_path: Path):
    pytest.importorskip("av")
    frames = np.zeros((3, 32, 48, 3), np.uint8)
    frames[:, :16, :24] = 250  # bright upper left quarter
    path = tmp_path / "a.mp4"
    write_frames(path, frames)
    data = bytearray(path.read_bytes())
    # The display matrix in the track header (ISO/IEC 14496-12, 8.3.2), 40 bytes after
    # its version field: a, b, c, d of a clockwise turn by 90 degrees are 0, 1, -1, 0.
    start = data.index(b"tkhd") + 4 + 40
    unit = 0x10000
    data[start : start + 36] = struct.pack(">9i", 0, unit, 0, -unit, 0, 0, 0, 0, 2**30)
    path.write_bytes(data)
    read = read_frames(path)
    assert read.shape == (3, 48, 32, 3)
    bright = read[0, ..., 1] > 128
    # Turned clockwise, the upper left quarter becomes the upper right one.
    assert bright[4:20, 20:28].all()
    assert not bright[28:].any()
    assert not bright[:, :12].any()


@pytest.mark.parametrize("suffix", [".mkv", ".avi", ".mp4"])
def test_truncated_videos(tmp_path: Path, suffix: str):
    pytest.importorskip("av")
    path = tmp_path / f"a{suffix}"
    write_frames(path, frames_of(np.uint8, 6, 20, 30))
    data = path.read_bytes()
    for length in [0, 1, 40, 700, len(data) // 3, len(data) // 2, len(data) - 300]:
        path.write_bytes(data[:length])
        with pytest.raises(ValueError, match=rf"cannot read .*a\{suffix}"):
            read_frames(path)


def test_a_crash_of_the_decoder_is_an_error(tmp_path: Path, monkeypatch):
    pytest.importorskip("av")
    write_frames(tmp_path / "a.mkv", frames_of(np.uint8, 2, 8, 8))
    script = tmp_path / "_video_child.py"
    script.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(
        "unsmear._video_stream.__file__", str(tmp_path / "_video_stream.py")
    )
    with pytest.raises(ValueError, match="the decoder crashed"):
        read_video(tmp_path / "a.mkv")


def test_an_encoder_that_fails_leaves_the_old_video(tmp_path: Path):
    av = pytest.importorskip("av")
    path = tmp_path / "a.mkv"
    write_frames(path, frames_of(np.uint8, 2, 8, 8))
    shutil.copy(path, tmp_path / "copy.mkv")

    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(av, "open", fail)
        with pytest.raises(OSError, match="disk full"):
            write_frames(path, frames_of(np.uint8, 2, 8, 8, seed=1))
    assert path.read_bytes() == (tmp_path / "copy.mkv").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2
