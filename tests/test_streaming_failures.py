"""Sources and disks that fail: a clear message, status 1, nothing half-written."""

from __future__ import annotations

import errno
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import unsmear
from picture_helpers import frames_of
from unsmear.cli import main

SHAPE = (40, 52)


def clip_in(folder: Path, name: str = "clip.tif", count: int = 4) -> Path:
    folder.mkdir(exist_ok=True)
    unsmear.write_frames(folder / name, frames_of(np.uint8, count, *SHAPE, 3))
    unsmear.write_flow(folder / "flow.flo", np.zeros((*SHAPE, 2), np.float32))
    return folder / name


def failure(source: Path, target: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What the command line says of a clip it cannot restore; nothing may be left."""
    around = [source.parent, target.parent]
    before = [sorted(folder.rglob("*")) for folder in around]
    flow = str(source.with_name("flow.flo"))
    command = ["deblur", str(source), "-o", str(target), "--method", "wiener"]
    assert main([*command, "--flow", flow]) == 1
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("unsmear: ")
    assert said.err.count("\n") == 1, "one line tells all"
    assert [sorted(folder.rglob("*")) for folder in around] == before
    return said.err


@pytest.mark.parametrize("suffix", [".mkv", ".mp4"])
def test_damaged_videos(tmp_path: Path, capsys, suffix: str) -> None:
    pytest.importorskip("av")
    source = clip_in(tmp_path, f"clip{suffix}")
    data = source.read_bytes()
    target = tmp_path / "out.mp4"
    source.write_bytes(data[: len(data) * 2 // 3])
    assert "cut off" in failure(source, target, capsys)
    source.write_bytes(b"")
    assert "the file is empty" in failure(source, target, capsys)
    source.write_bytes(b"Dear Sir, please find enclosed\n" * 99)
    assert "as a video" in failure(source, target, capsys)
    shutil.copy(clip_in(tmp_path / "other", "a.tif"), source)
    assert "it is no video by what it holds" in failure(source, target, capsys)


def test_a_video_named_like_a_picture(tmp_path: Path, capsys) -> None:
    pytest.importorskip("av")
    source = clip_in(tmp_path, "clip.mp4").rename(tmp_path / "clip.png")
    assert "as a picture" in failure(source, tmp_path / "out", capsys)


def test_frames_of_different_sizes(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "frames"
    clip_in(tmp_path)
    unsmear.write_frames(folder, frames_of(np.uint8, 3, *SHAPE))
    unsmear.write_image(folder / "frame_0002.png", frames_of(np.uint8, 9, 9))
    said = failure(folder, tmp_path / "out.mkv", capsys)
    assert "agree in size" in said and "frame_0002.png" in said and "(9, 9)" in said
    (folder / "frame_0002.png").write_bytes(b"")
    assert "the file is empty" in failure(folder, tmp_path / "out.mkv", capsys)


def test_targets_that_cannot_be(tmp_path: Path, capsys) -> None:
    source = clip_in(tmp_path)
    assert "does not exist" in failure(source, tmp_path / "no" / "a.tif", capsys)
    assert "got" in failure(source, tmp_path / "out.txt", capsys)
    (tmp_path / "folder.tif").mkdir()
    unsmear.write_frames(tmp_path / "folder.tif", frames_of(np.uint8, 9, *SHAPE))
    said = failure(source, tmp_path / "folder.tif", capsys)
    assert "frames of another sequence" in said


def test_floats_that_integers_cannot_hold_are_refused_before_work(
    tmp_path: Path, capsys
) -> None:
    source = clip_in(tmp_path)
    unsmear.write_frames(source, 2 * frames_of(np.float32, 3, *SHAPE))
    assert "must lie in [0, 1]" in failure(source, tmp_path / "out", capsys)


@pytest.mark.parametrize("target", ["out.mkv", "out"])
def test_a_folder_that_may_not_be_written_to(
    tmp_path: Path, capsys, monkeypatch, target: str
) -> None:
    source = clip_in(tmp_path / "source")
    closed = tmp_path / "closed"
    closed.mkdir()
    made = Path.mkdir

    def refused(path: Path, *arguments: object, **options: object) -> None:
        if closed in path.parents:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        made(path, *arguments, **options)  # type: ignore[arg-type]

    # Permissions stop no superuser, who may be the one to run this.
    monkeypatch.setattr(Path, "mkdir", refused)
    said = failure(source, closed / target, capsys)
    assert "folder that can be written to" in said and "Permission denied" in said


@pytest.fixture
def mounted(tmp_path: Path) -> Iterator[Path]:
    """A file system of 300 kB."""
    place = tmp_path / "small"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(place)]
    if not shutil.which("mount") or subprocess.run(command, check=False).returncode:
        pytest.skip("mounting is not allowed here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("target", ["out.mkv", "out.mp4", "out.tif", "out", "out.gif"])
def test_full_disks(tmp_path: Path, mounted: Path, capsys, target: str) -> None:
    source = clip_in(tmp_path / "source", count=80)
    said = failure(source, mounted / target, capsys)
    assert "no space left" in said and target in said
    assert list(mounted.iterdir()) == []


def test_a_read_only_file_system(mounted: Path, tmp_path: Path, capsys) -> None:
    source = clip_in(tmp_path / "source")
    subprocess.run(["mount", "-o", "remount,ro", str(mounted)], check=True)
    said = failure(source, mounted / "out.mkv", capsys)
    assert "Read-only file system" in said


def test_a_disk_that_fills_while_the_whole_is_made(
    tmp_path: Path, mounted: Path, capsys
) -> None:
    # The pieces fit, twice they do not.
    source = clip_in(tmp_path / "source", count=30)
    said = failure(source, mounted / "out.tif", capsys)
    assert "no space left" in said
    assert list(mounted.iterdir()) == []
