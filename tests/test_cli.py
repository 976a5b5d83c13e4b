"""The command line as its user meets it."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import unsmear
from unsmear.cli import main


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "unsmear", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    texture = unsmear.synthetic.texture((80, 90), seed=1)
    sequence = unsmear.synthetic.translation(
        texture, (2.0, 1.0), shape=(60, 64), exposure=1.0, bits=8, noise=1.0
    )
    unsmear.write_frames(tmp_path / "clip", sequence.blurred)
    unsmear.write_flow(tmp_path / "truth.flo", sequence.flow[1])
    return tmp_path


def test_demo_writes_and_measures(tmp_path: Path, capsys) -> None:
    assert main(["demo", "-o", str(tmp_path / "demo"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["PSNR gain (dB)"] > 3 and printed["worst frame's gain (dB)"] > 2
    assert printed["flow endpoint error (px)"] < 0.6
    assert printed["seconds"] < 60
    names = {path.name for path in (tmp_path / "demo").iterdir()}
    assert names == {
        "deblurred",
        "flow.png",
        "side_by_side.png",
        "report.json",
        "report.html",
    }
    page = (tmp_path / "demo" / "report.html").read_text("utf-8")
    assert f"unsmear demo -o {tmp_path / 'demo'} --json" in page, "what repeats it"
    assert unsmear.read_frames(tmp_path / "demo" / "deblurred").shape == (
        5,
        216,
        288,
        3,
    )


def test_flow_then_evaluate_then_show(clip: Path, capsys) -> None:
    flow = clip / "flow.flo"
    plot = clip / "flow.png"
    command = ["flow", str(clip / "clip"), "-o", str(flow), "--plot", str(plot)]
    assert main([*command, "--json", "-p", "passes=1"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"]["passes"] == 1
    assert unsmear.read_image(plot).ndim == 3
    assert main(["evaluate", str(flow), str(clip / "truth.flo"), "--json"]) == 0
    errors = json.loads(capsys.readouterr().out)
    assert errors["epe"] < 0.3 and errors["density"] > 0.9
    assert main(["show", str(flow), "-o", str(clip / "again.png")]) == 0
    np.testing.assert_array_equal(
        unsmear.read_image(clip / "again.png"), unsmear.read_image(plot)
    )


def test_tables_are_for_machines(clip: Path, capsys) -> None:
    command = ["flow", str(clip / "clip"), "-o", str(clip / "a.flo"), "--method=fast"]
    assert main(command) == 0
    told = capsys.readouterr().out.splitlines()
    assert any(line.startswith("density ") for line in told)
    assert max(map(len, told)) < 88 + len(str(clip)), "no line is a table"
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["levels"], "nothing is lost"


def test_a_missing_file_is_named_in_words(tmp_path: Path, capsys) -> None:
    missing = str(tmp_path / "clip.mp4")
    assert main(["deblur", missing, "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert said == f"unsmear: {missing}: No such file or directory\n"


def test_evaluate_counts_what_is_asked_for(clip: Path, capsys) -> None:
    truth = unsmear.read_flow(clip / "truth.flo")
    truth[:10] = 0
    unsmear.write_flow(clip / "truth.flo", truth)
    mask = np.zeros(truth.shape[:2], np.uint8)
    mask[:30] = 255
    unsmear.write_image(clip / "mask.png", mask)
    files = [str(clip / "truth.flo")] * 2
    options = ["--mask", str(clip / "mask.png"), "--min-speed", "0.5", "--json"]
    assert main(["evaluate", *files, *options]) == 0
    errors = json.loads(capsys.readouterr().out)
    assert errors["pixels"] == 20 * 64 and errors["epe"] == 0


def test_images_and_convert(clip: Path, capsys) -> None:
    frames = sorted(str(path) for path in (clip / "clip").iterdir())
    assert main(["evaluate", "--images", frames[0], frames[0], "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"psnr": None, "ssim": 1.0}
    target = clip / "truth.png"
    assert main(["convert", str(clip / "truth.flo"), str(target)]) == 0
    np.testing.assert_array_equal(
        unsmear.read_flow(target), unsmear.read_flow(clip / "truth.flo")
    )


def test_deblur_writes_frames_that_are_sharper(clip: Path) -> None:
    out = clip / "out"
    assert main(["deblur", str(clip / "clip"), "-o", str(out)]) == 0
    before, after = (unsmear.read_frames(path) for path in (clip / "clip", out))
    assert after.shape == before.shape and after.dtype == before.dtype
    detail = [np.abs(np.diff(f.astype(float), axis=2)).mean() for f in (before, after)]
    assert detail[1] > 1.1 * detail[0]
    flow = ["--flow", str(clip / "truth.flo"), "--method", "thesis"]
    assert main(["deblur", str(clip / "clip"), "-o", str(clip / "old"), *flow]) == 0


def test_the_page_names_the_digest_of_every_file(clip: Path) -> None:
    page = clip / "page.html"
    quick = ["--method", "wiener", "--exposure", "1", "--flow", str(clip / "truth.flo")]
    arguments = ["deblur", str(clip / "clip"), "-o", str(clip / "out"), *quick]
    assert main([*arguments, "--report", str(page)]) == 0
    html = page.read_text("utf-8")
    for path in (clip / "clip").iterdir():
        assert hashlib.sha256(path.read_bytes()).hexdigest() in html


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["flow", "nowhere/", "-o", "x.flo"], "nowhere"),
        (["convert", "missing.flo", "x.png"], "missing.flo"),
        (["evaluate", "one.flo"], "two files"),
        (["flow", "CLIP", "-o", "x.flo", "-p", "passes"], "NAME=VALUE"),
        (["flow", "CLIP", "-o", "x.flo", "-p", "speed=1"], "no parameter 'speed'"),
        (["flow", "CLIP", "-o", "x.txt"], "x.txt"),
        (["deblur", "CLIP", "-o", "out", "--exposure", "-1"], "exposure"),
    ],
)
def test_failures_say_why_and_leave_nothing(
    clip: Path, monkeypatch, capsys, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(clip)
    before = sorted(path.name for path in clip.rglob("*"))
    arguments = ["clip" if word == "CLIP" else word for word in arguments]
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("unsmear: ") and message in error
    assert sorted(path.name for path in clip.rglob("*")) == before


def test_wrong_usage_ends_with_2_and_help_with_0() -> None:
    assert run("flow").returncode == 2
    assert run("no-such-verb").returncode == 2
    help_of = run("flow", "--help")
    assert help_of.returncode == 0 and "example:" in help_of.stdout
    assert run("--version").stdout.startswith("unsmear ")
