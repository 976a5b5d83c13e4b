"""Clips from file to file: equal to memory, taken up after a break, whole or absent."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic
from unsmear.velocity import velocity_of_frame

COUNT = 7
SHAPE = (41, 51)
FLOW = np.full((*SHAPE, 2), (4, 2), np.float32)
QUICK: dict[str, Any] = {"method": "wiener", "exposure": 0.8, "noise": 1.0}
GIVEN: dict[str, Any] = QUICK | {"flow": FLOW}


@pytest.fixture(scope="module")
def blurred() -> np.ndarray:
    return synthetic.translation(
        synthetic.texture((140, 140), seed=4),
        (4.0, 2.0),
        shape=SHAPE,
        exposure=0.8,
        n_frames=COUNT,
        noise=1.0,
        bits=8,
    ).blurred


@pytest.fixture
def clip(tmp_path: Path, blurred: np.ndarray) -> Path:
    unsmear.write_frames(tmp_path / "clip.tif", blurred)
    return tmp_path / "clip.tif"


class BrokenOffError(Exception):
    """What stops a job in these tests."""


def after(frames: int) -> Any:
    """A callback that stops the job when so many frames are done."""

    def progress(share: float) -> None:
        if share >= frames / COUNT:
            raise BrokenOffError

    return progress


def test_equals_the_clip_in_memory(tmp_path: Path, blurred) -> None:
    clip = tmp_path / "clip.mkv"
    unsmear.write_frames(clip, blurred)
    made = unsmear.deblur_clip(clip, tmp_path / "out.tif", flow_method="fast", seed=3)
    whole = unsmear.deblur_sequence(blurred, flow_method="fast", seed=3)
    np.testing.assert_array_equal(
        unsmear.read_frames(tmp_path / "out.tif"), whole.frames
    )
    assert made.reports == json.loads(json.dumps(whole.reports))
    assert made.count == COUNT and made.taken_up_at == 0


def test_equals_the_clip_in_memory_wherever_it_is_taken_up(
    tmp_path: Path, clip: Path
) -> None:
    # The second pass looks farthest around a frame.
    options = {"flow_method": "fast", "second_pass": True, "exposure": 0.8}
    unsmear.deblur_clip(clip, tmp_path / "whole.tif", **options)
    with pytest.raises(BrokenOffError):
        unsmear.deblur_clip(
            clip, tmp_path / "out.tif", resume=True, progress=after(4), **options
        )
    made = unsmear.deblur_clip(clip, tmp_path / "out.tif", resume=True, **options)
    assert made.taken_up_at == 4 and len(made.reports) == COUNT
    assert (tmp_path / "out.tif").read_bytes() == (tmp_path / "whole.tif").read_bytes()
    assert not (tmp_path / "out.tif.part").exists()


@pytest.mark.parametrize("method", ["balanced", "steady", "least-squares"])
def test_frames_restored_by_themselves_equal_those_in_memory(
    tmp_path: Path, clip: Path, blurred, method: str
) -> None:
    samples = unsmear.deblur_clip(
        clip, tmp_path / "out.tif", flow_method=method, samples=True, **QUICK
    ).samples
    made = unsmear.read_frames(tmp_path / "out.tif")
    for index in (0, 3, COUNT - 1):
        velocity, _ = velocity_of_frame(blurred, index, method=method)
        alone = unsmear.deblur(blurred[index], velocity, **QUICK).image
        np.testing.assert_array_equal(made[index], alone)
        confidence = samples[index].confidence
        if method == "least-squares":  # pools many frames
            assert confidence is None
            continue
        pair = [index, index + 1 if index + 1 < COUNT else index - 1]
        between = unsmear.optical_flow(blurred[pair], index=0, method=method)
        np.testing.assert_array_equal(confidence, between.confidence)


@pytest.mark.parametrize("target", ["out.mp4", "out.avi", "out.gif", "out.tif", "out"])
def test_same_bytes_after_a_break(
    tmp_path: Path, clip: Path, target: str, monkeypatch
) -> None:
    # Pieces of 3 frames: breaks inside the first and behind the first.
    monkeypatch.setattr("unsmear.streaming.video_writer.VideoWriter.length", 3)
    for name, stops in (("whole", ()), ("broken", (1, 5))):
        (tmp_path / name).mkdir()
        for frames in stops:
            with pytest.raises(BrokenOffError):
                unsmear.deblur_clip(
                    clip,
                    tmp_path / name / target,
                    resume=True,
                    progress=after(frames),
                    **GIVEN,
                )
        made = unsmear.deblur_clip(
            clip, tmp_path / name / target, resume=True, samples=True, **GIVEN
        )
        assert made.taken_up_at == max(stops, default=0)
        assert [sample.index for sample in made.samples] == list(range(COUNT))
        # The motion was given.
        assert all(sample.confidence is None for sample in made.samples)
    whole, broken = (
        {
            path.relative_to(tmp_path / name): path.read_bytes()
            for path in sorted((tmp_path / name).rglob("*"))
            if path.is_file()
        }
        for name in ("whole", "broken")
    )
    assert whole == broken
    assert len(whole) == (COUNT if target == "out" else 1)


@pytest.mark.parametrize("name", ["frame_000001", "piece_000000.mkv"])
def test_damaged_parts_are_made_again(
    tmp_path: Path, clip: Path, name: str, monkeypatch
) -> None:
    monkeypatch.setattr("unsmear.streaming.video_writer.VideoWriter.length", 3)
    unsmear.deblur_clip(clip, tmp_path / "whole.mkv", **GIVEN)
    target = tmp_path / "out.mkv"
    frames = 2 if name.startswith("frame") else 5
    with pytest.raises(BrokenOffError):
        unsmear.deblur_clip(clip, target, resume=True, progress=after(frames), **GIVEN)
    part = tmp_path / "out.mkv.part" / name
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    made = unsmear.deblur_clip(clip, target, resume=True, **GIVEN)
    assert made.taken_up_at == (1 if name.startswith("frame") else 0)
    assert target.read_bytes() == (tmp_path / "whole.mkv").read_bytes()


def test_refuses_to_go_on_with_other_work(tmp_path: Path, clip: Path, blurred) -> None:
    target = tmp_path / "out.mkv"

    def attempt(source: Path, **options: Any) -> None:
        unsmear.deblur_clip(source, target, resume=True, **(GIVEN | options))

    with pytest.raises(BrokenOffError):
        attempt(clip, progress=after(3))
    before = sorted((tmp_path / "out.mkv.part").iterdir())
    with pytest.raises(ValueError, match=r"resume .* exposure = 0.5 .* has 0.8"):
        attempt(clip, exposure=0.5)
    unsmear.write_frames(tmp_path / "other.tif", blurred[::-1])
    with pytest.raises(ValueError, match=r"resume .* source = "):
        attempt(tmp_path / "other.tif")
    assert sorted((tmp_path / "out.mkv.part").iterdir()) == before
    # Started anew on request, and then nothing of the old job is left.
    made = unsmear.deblur_clip(clip, target, **(GIVEN | {"exposure": 0.5}))
    assert made.taken_up_at == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "clip.tif",
        "other.tif",
        "out.mkv",
    ]


def test_does_not_touch_a_folder_of_somebody_else(tmp_path: Path, clip: Path) -> None:
    (tmp_path / "out.mkv.part").mkdir()
    (tmp_path / "out.mkv.part" / "diary.txt").write_text("dear diary")
    with pytest.raises(ValueError, match="must be an unfinished job"):
        unsmear.deblur_clip(clip, tmp_path / "out.mkv", **GIVEN)
    assert (tmp_path / "out.mkv.part" / "diary.txt").read_text() == "dear diary"


def test_two_runs_keep_out_of_each_other_s_way(tmp_path: Path, clip: Path) -> None:
    pytest.importorskip("fcntl")

    def second_run(share: float) -> None:
        if share > 0:
            unsmear.deblur_clip(clip, tmp_path / "out.mkv", **GIVEN)

    with pytest.raises(OSError, match="another process is at work"):
        unsmear.deblur_clip(clip, tmp_path / "out.mkv", progress=second_run, **GIVEN)


@pytest.mark.parametrize("target", ["out.mp4", "out"])
def test_a_failure_leaves_what_was_there(
    tmp_path: Path, clip: Path, target: str, blurred
) -> None:
    unsmear.write_frames(tmp_path / target, blurred[:2])
    before = unsmear.read_frames(tmp_path / target)
    if target == "out":  # as many frames as the clip has: they may be replaced
        unsmear.write_frames(tmp_path / target, blurred)
        before = unsmear.read_frames(tmp_path / target)
    with pytest.raises(BrokenOffError):
        unsmear.deblur_clip(clip, tmp_path / target, progress=after(3), **GIVEN)
    np.testing.assert_array_equal(unsmear.read_frames(tmp_path / target), before)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip.tif", target]


def command(clip: Path, target: Path, *more: str) -> list[str]:
    options = [f"--{name}={value}" for name, value in QUICK.items()]
    flow = clip.with_name("flow.flo")
    if not flow.exists():
        unsmear.write_flow(flow, FLOW)
    options.append(f"--flow={flow}")
    return [sys.executable, "-m", "unsmear", "deblur", str(clip), "-o", str(target),
            *options, *more]  # fmt: skip


def begun(clip: Path, target: Path, *more: str) -> subprocess.Popen[bytes]:
    """A run on the command line that has finished at least one frame."""
    child = subprocess.Popen(
        command(clip, target, *more), stderr=subprocess.PIPE, stdout=subprocess.PIPE
    )
    part = target.with_name(f"{target.name}.part")
    while not list(part.glob("frame_*")):
        assert child.poll() is None, "ended before it could be broken off"
        time.sleep(0.002)
    return child


@pytest.fixture
def longer(tmp_path: Path, blurred: np.ndarray) -> Path:
    """A clip that takes a while."""
    unsmear.write_frames(tmp_path / "clip.tif", np.concatenate([blurred] * 12))
    return tmp_path / "clip.tif"


def test_a_killed_run_is_taken_up(tmp_path: Path, longer: Path) -> None:
    clip = longer
    unsmear.deblur_clip(clip, tmp_path / "whole.mkv", **GIVEN)
    target = tmp_path / "out.mkv"
    with begun(clip, target) as child:
        child.kill()
    assert not target.exists()
    done = subprocess.run(
        command(clip, target, "--resume", "--json"), capture_output=True, check=True
    )
    assert json.loads(done.stdout)["taken up at frame"] >= 1
    assert target.read_bytes() == (tmp_path / "whole.mkv").read_bytes()


@pytest.mark.parametrize("resume", [False, True])
def test_an_interrupted_run_leaves_nothing_half_written(
    tmp_path: Path, longer: Path, *, resume: bool
) -> None:
    with begun(longer, tmp_path / "out.mkv", *["--resume"] * resume) as child:
        child.send_signal(signal.SIGINT)
        _, said = child.communicate()
    assert child.returncode == 130
    assert said == b"unsmear: interrupted\n"
    kept = ["out.mkv.part"] if resume else []
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "clip.tif",
        "flow.flo",
        *kept,
    ]
