"""Several clips from the command line: which they are, where they go, what is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from picture_helpers import frames_of
from unsmear.cli import main
from unsmear.streaming.several_clips import clips_among, targets_in

SHAPE = (40, 52)
RESTORE = ["--method", "wiener", "--flow"]


@pytest.fixture
def clips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two stacks and two folders of frames, and an unfinished job."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "clips"
    folder.mkdir()
    for seed, name in enumerate(("take_2", "take_10", "a.tif", "b.tif")):
        frames = frames_of(np.uint8, 3, *SHAPE)
        unsmear.write_frames(folder / name, np.roll(frames, seed))
    (folder / "take_2.part").mkdir()
    (folder / "notes.txt").write_text("not a clip")
    unsmear.write_flow(tmp_path / "flow.flo", np.full((*SHAPE, 2), 2, np.float32))
    return folder


def names(found: list[str] | None) -> list[str]:
    assert found is not None
    return [Path(path).name for path in found]


def test_folders_are_clips_and_pictures_are_frames(clips: Path) -> None:
    assert names(clips_among([f"{clips}/take*"], each=False)) == ["take_2", "take_10"]
    both = [str(clips / "take_10"), str(clips / "take_2")]
    assert names(clips_among(both, each=False)) == ["take_10", "take_2"], "as given"
    assert clips_among([f"{clips}/*.tif"], each=False) is None
    assert clips_among([str(clips / "take_2")], each=False) is None
    assert clips_among([f"{clips}/take_2/*"], each=False) is None
    assert clips_among([f"{clips}/*"], each=False) is None, "pictures among them"
    every = ["a.tif", "b.tif", "take_2", "take_10"]
    assert names(clips_among([f"{clips}/*"], each=True)) == every
    with pytest.raises(ValueError, match="must match clips"):
        clips_among([f"{clips}/*.mov"], each=True)


def test_videos_are_clips(tmp_path: Path) -> None:
    for name in ("b.mp4", "a.webm"):
        (tmp_path / name).touch()
    found = clips_among([f"{tmp_path}/*"], each=False)
    assert names(found) == ["a.webm", "b.mp4"]
    assert found and names(targets_in("out", found)) == ["a.mkv", "b.mp4"]
    assert clips_among([f"{tmp_path}/*.mp4"], each=False) is None, "one is one"


def test_places_of_clips(clips: Path) -> None:
    (clips / "other").mkdir()
    (clips / "dotted.v2").mkdir()
    found = [str(clips / "a.tif"), str(clips / "dotted.v2"), "wave.gif"]
    assert targets_in("out", found) == ["out/a.tif", "out/dotted.v2/", "out/wave.tif"]
    with pytest.raises(ValueError, match="different names"):
        targets_in("out", [str(clips / "a.tif"), str(clips / "other" / "a.tif")])
    with pytest.raises(ValueError, match="another folder"):
        targets_in(str(clips), [str(clips / "a.tif")])


def test_one_after_the_other(clips: Path, capsys: Any) -> None:
    command = ["deblur", "clips/take*", "-o", "out", *RESTORE, "flow.flo"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "clips/take_2 -> out/take_2/  3 frames" in said
    assert said.index("take_2") < said.index("take_10") and "failed   0" in said
    for name in ("take_2", "take_10"):
        assert main(["deblur", f"clips/{name}", "-o", "alone", *command[4:]]) == 0
        np.testing.assert_array_equal(
            unsmear.read_frames(f"out/{name}"), unsmear.read_frames("alone")
        )


def test_a_clip_that_fails_is_told_and_the_next_is_made(
    clips: Path, capsys: Any
) -> None:
    (clips / "a.tif").write_bytes(b"")
    command = ["deblur", "clips/*.tif", "--each", "-o", "out", *RESTORE, "flow.flo"]
    assert main([*command, "--json"]) == 1
    said = capsys.readouterr()
    assert "unsmear: clips/a.tif: cannot read" in said.err and "empty" in said.err
    assert said.err.count("\n") == 1
    told = json.loads(said.out)
    assert (told["clips"], told["failed"]) == (2, 1)
    bad, good = told["results"]
    assert bad["source"] == "clips/a.tif" and "empty" in bad["error"]
    assert good["error"] is None and good["frames"] == len(good["reports"]) == 3
    assert [path.name for path in Path("out").iterdir()] == ["b.tif"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "out.mp4"], "output must be a folder for 2 clips"),
        (["-o", "clips"], "another folder"),
        (["-o", "out", "--report", "r.html"], "--report"),
        (["-o", "out", "--exposure", "-1", "--json"], "exposure"),
    ],
)
def test_wrong_usage(
    clips: Path, capsys: Any, arguments: list[str], message: str
) -> None:
    assert main(["deblur", "clips/take*", *arguments, *RESTORE, "flow.flo"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("unsmear: ") and message in said
    assert not list(clips.parent.glob("out/*"))
