"""Suites: what is found in folders, what is measured, what the tables say."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear.cli import main
from unsmear.suite import (
    MeasurementError,
    contender,
    evaluate_suite,
    find_sequences,
    markdown,
    measure,
)
from unsmear.suite.contenders import RIVALS

SHAPE = (48, 56)


def write_sequence(
    frames: Path,
    truth: Path,
    numbers: range,
    *,
    prefix: str = "frame_",
    shape: tuple[int, int] = SHAPE,
) -> Any:
    """Frames of a translation and its truth; returns the sequence."""
    texture = unsmear.synthetic.texture((shape[0] + 32, shape[1] + 34), seed=3)
    made = unsmear.synthetic.translation(
        texture, (1.25, -0.5), shape=shape, n_frames=len(numbers), bits=8
    )
    frames.mkdir(parents=True, exist_ok=True)
    for number, frame in zip(numbers, made.blurred, strict=True):
        unsmear.write_image(frames / f"{prefix}{number:02d}.png", frame)
    truth.parent.mkdir(parents=True, exist_ok=True)
    unsmear.write_flow(truth, made.flow[0])
    return made


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """One sequence with masks beside its truth, one laid out as Middlebury's."""
    root = tmp_path / "suite"
    here = root / "own" / "street"
    write_sequence(here, here / "flow_08.flo", range(6, 11))
    land = np.zeros(SHAPE, np.uint8)
    land[20:] = 255
    unsmear.write_image(here / "mask_land_08.png", land)
    unsmear.write_image(here / "mask_other_09.png", land)
    hidden = np.zeros(SHAPE, np.uint8)
    hidden[:, :10] = 255
    unsmear.write_image(here / "occlusions_08.png", hidden)
    unsmear.write_image(here / "invalid_08.png", hidden.copy()[::-1])
    write_sequence(
        root / "mb" / "other-data" / "Venus",
        root / "mb" / "other-gt-flow" / "Venus" / "flow10.flo",
        range(10, 12),
        prefix="frame",
    )
    # None of these is a sequence with truth.
    write_sequence(root / "no_truth", tmp_path / "elsewhere" / "x.flo", range(3))
    write_sequence(root / "gap", root / "gap" / "flow_07.flo", range(6, 8))
    return root


# Folders


def test_sequences_are_found_by_their_truth(suite: Path) -> None:
    own, venus = sorted(find_sequences(suite), key=lambda s: s.name, reverse=True)
    assert (own.name, own.index, len(own.frames)) == ("own/street", 2, 5)
    assert own.frames[own.index].name == "frame_08.png"
    assert set(own.masks) == {"land"}
    assert set(own.without) == {"occlusions"}
    assert (venus.name, venus.index, len(venus.frames)) == ("mb/other-data/Venus", 0, 2)


def test_invalid_pixels_do_not_count_and_masks_are_parts(suite: Path) -> None:
    own = next(s for s in find_sequences(suite) if s.name == "own/street")
    truth = own.read_truth()
    assert np.isnan(truth[:, :10]).all() and np.isfinite(truth[:, 10:]).all()
    parts = own.subsets(SHAPE)
    assert parts["land"].sum() == 28 * 56
    assert parts["no occlusions"].sum() == 48 * 46
    with pytest.raises(
        ValueError, match=r"'mask_land_08.png' must have shape \(9, 9\)"
    ):
        own.subsets((9, 9))


def test_a_sequence_ends_at_a_gap_of_its_numbers(suite: Path) -> None:
    (suite / "own" / "street" / "frame_06.png").rename(
        suite / "own" / "street" / "frame_05.png"
    )
    own = next(s for s in find_sequences(suite) if s.name == "own/street")
    assert [path.name[6:8] for path in own.frames] == ["07", "08", "09", "10"]
    assert own.index == 1


def test_several_truths_of_one_folder_are_several_sequences(suite: Path) -> None:
    here = suite / "own" / "street"
    unsmear.write_flow(here / "flow_09.flo", np.zeros((*SHAPE, 2), np.float32))
    names = [s.name for s in find_sequences(suite)]
    assert names == ["mb/other-data/Venus", "own/street 8", "own/street 9"]


def test_bad_folders_are_named(suite: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="folder must exist"):
        find_sequences(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="folder must hold flow files"):
        find_sequences(tmp_path / "empty")
    here = suite / "own" / "street"
    for number in (8, 9):
        unsmear.write_image(here / f"left_{number:02d}.png", np.zeros(SHAPE, np.uint8))
    with pytest.raises(ValueError, match="must be one series of pictures"):
        find_sequences(suite)


# Contenders


def test_contenders_get_the_frames_they_can_use() -> None:
    assert contender("balanced").frames_of(9, 4) == (slice(4, 6), 0)
    assert contender("thesis").frames_of(9, 4) == (slice(3, 6), 1)
    assert contender("thesis").frames_of(2, 0) == (slice(0, 2), 0)
    assert contender("steady").frames_of(9, 4) == (slice(0, 9), 4)
    assert contender("OpenCV DIS").frames_of(9, 4) == (slice(4, 6), 0)
    given = contender("fast:warps=2,static_evidence=false")
    assert given.parameters == {"warps": 2, "static_evidence": False}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("quick", "method must be one of .*fast.*OpenCV DIS.*, got 'quick'"),
        ("fast:warp=2", "no parameter 'warp'"),
        ("fast:warps", "NAME:parameter=value"),
        ("OpenCV DIS:preset=2", "is run with its library's defaults"),
    ],
)
def test_bad_contenders_are_named(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        contender(text)


def test_skimage_rivals_agree_on_the_axes(suite: Path) -> None:
    pytest.importorskip("skimage")
    frames = unsmear.read_frames(suite / "mb" / "other-data" / "Venus")
    for name in ("scikit-image TV-L1", "scikit-image iLK"):
        flow = RIVALS[name](frames[0], frames[1])
        # A swapped axis or sign is off by more than a pixel.
        np.testing.assert_allclose(np.median(flow, (0, 1)), (1.25, -0.5), atol=0.2)


def test_opencv_rivals_agree_on_the_axes(suite: Path) -> None:
    pytest.importorskip("cv2")
    frames = unsmear.read_frames(suite / "mb" / "other-data" / "Venus")
    for name in [name for name in RIVALS if name.startswith("OpenCV")]:
        flow = RIVALS[name](frames[0], frames[1])
        np.testing.assert_allclose(np.median(flow, (0, 1)), (1.25, -0.5), atol=0.3)
        with pytest.raises(ValueError, match="frames must be of 8 bit"):
            RIVALS[name](frames[0] / 255, frames[1] / 255)


# Measurement


def test_the_child_finds_the_same_flow_and_its_cost(suite: Path) -> None:
    venus = next(s for s in find_sequences(suite) if s.name.endswith("Venus"))
    flow, cost = measure(contender("fast"), venus, runs=1)
    frames = unsmear.read_frames(venus.frames)
    np.testing.assert_array_equal(
        flow, unsmear.optical_flow(frames, index=0, method="fast").flow
    )
    assert cost["seconds"] is not None and 0 <= cost["seconds"] < 30


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
def test_the_child_measures_memory(tmp_path: Path) -> None:
    # Large beside what the process keeps from its warm-up.
    folder = tmp_path / "large"
    write_sequence(folder, folder / "flow_08.flo", range(8, 10), shape=(240, 320))
    (large,) = find_sequences(tmp_path)
    _, cost = measure(contender("fast"), large, runs=1)
    # Flow and confidence alone are 12 bytes; no method keeps a hundred planes.
    assert cost["bytes_per_pixel"] is not None
    assert 12 <= cost["bytes_per_pixel"] < 800


def test_a_failing_contender_says_why(suite: Path) -> None:
    venus = next(s for s in find_sequences(suite) if s.name.endswith("Venus"))
    with pytest.raises(MeasurementError, match=r"frames must have shape \(T >= 3"):
        measure(contender("fleet-jepson"), venus, runs=1)


# The whole


def test_a_suite_becomes_figures_and_tables(suite: Path) -> None:
    said: list[str] = []
    result = evaluate_suite(
        suite, methods=["fast", "fleet-jepson"], runs=1, report=said.append
    )
    assert said[0] == "mb/other-data/Venus: fast" and len(said) == 4
    assert json.loads(json.dumps(result)) == result
    fast = result["results"]["fast"]["own/street"]
    assert fast["density"] == 1 and fast["epe"] < 0.2
    assert set(fast["parts"]) == {"land", "no occlusions"}
    frames = unsmear.read_frames(sorted((suite / "own" / "street").glob("frame*.png")))
    own = next(s for s in find_sequences(suite) if s.name == "own/street")
    flow = unsmear.optical_flow(frames[2:4], method="fast").flow
    expected = unsmear.metrics.flow_errors(flow, own.read_truth())
    assert fast["epe"] == expected["epe"] and fast["aae"] == expected["aae"]
    assert "T >= 3" in result["results"]["fleet-jepson"]["mb/other-data/Venus"]["error"]
    text = markdown(result)
    assert (
        f"| fast | **{result['results']['fast']['mb/other-data/Venus']['epe']:.3f}**"
        in text
    )
    # A mean over what is missing is missing, and a sparse method wins nothing.
    assert re.search(r"\| fleet-jepson \| – \| 0\.\d+ \|", text)
    assert str(suite) not in text + json.dumps(result["sequences"])


def test_the_command_writes_both_files(
    suite: Path, tmp_path: Path, capsys: Any
) -> None:
    command = ["evaluate", "--suite", str(suite), "--methods", "fast", "--runs", "1"]
    assert main([*command, "-o", str(tmp_path / "table.md")]) == 0
    printed = capsys.readouterr()
    assert (tmp_path / "table.md").read_text("utf-8") == printed.out
    written = json.loads((tmp_path / "table.json").read_text("utf-8"))
    assert set(written["results"]) == {"fast"}
    assert "own/street: fast" in printed.err
    assert main([*command, "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["results"]) == {"fast"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--suite", "nowhere"], "folder must exist"),
        (["--suite", "nowhere", "a.flo", "b.flo"], "give one of"),
    ],
)
def test_bad_commands_are_named(
    arguments: list[str], message: str, capsys: Any
) -> None:
    assert main(["evaluate", *arguments]) == 1
    assert message in capsys.readouterr().err
