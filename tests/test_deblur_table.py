"""The deblurring table: its rivals are given a fair problem, and it gets written."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from unsmear import synthetic

BENCHES = Path(__file__).resolve().parent.parent / "benches"
PICTURE = synthetic.texture((150, 150), seed=8, exponent=1.3)


@pytest.fixture
def rivals(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(BENCHES)
    import deblur_rivals

    return deblur_rivals


def problem(rivals, name: str, noise: float = 0.0):
    case = synthetic.blur_case(name, PICTURE, shape=(72, 72), noise=noise)
    return case, rivals.Problem(
        case.blurred.astype(float),
        case.velocity.astype(float),
        case.acceleration.astype(float),
        noise,
        case.sharp.astype(float),
    )


@pytest.mark.parametrize("name", ["T7", "R25", "SHa"])
def test_the_matrix_is_the_blur(rivals, name: str) -> None:
    case, given = problem(rivals, name)
    matrix, (height, width) = rivals.path_problem_matrix(
        given.velocity, given.acceleration
    )
    np.testing.assert_allclose(matrix.sum(axis=1), 1)
    assert matrix.shape == (72 * 72, height * width)
    # What the matrix takes from beyond the window is the picture there.
    whole = synthetic.blur_case(name, PICTURE, shape=(height, width), noise=0.0)
    made = (matrix @ whole.sharp.astype(float).ravel()).reshape(72, 72)
    error = made - 255 * case.exposed
    # The prototype's operator errs by .4 to .6 grey levels on smoother pictures; cut
    # paths and cubic samples by as much here. Blur itself is 20 times that.
    assert np.sqrt((error**2).mean()) < 1.0
    assert np.std(255 * case.exposed - case.sharp) > 7


@pytest.mark.parametrize("name", ["sk RL", "sk Wiener", "tiled RL"])
def test_rivals_sharpen_what_they_can(rivals, name: str) -> None:
    case, given = problem(rivals, "T7")
    restored = rivals.RIVALS[name](given)
    inner = np.s_[24:-24, 24:-24]
    before, after = (np.std((x - case.sharp)[inner]) for x in (given.blurred, restored))
    assert after < 0.8 * before


def test_blind_deconvolution_keeps_brightness(rivals) -> None:
    _, given = problem(rivals, "T3")
    restored = rivals.RIVALS["blind RL"](given)
    assert restored.mean() == pytest.approx(given.blurred.mean(), rel=0.02)


def test_the_table_gets_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(BENCHES)
    import deblur_table

    arguments = ["--pictures", "camera", "--cases", "T7", "--noises", "1"]
    arguments += ["--seeds", "1", "--size", "96", "--rivals", "blind RL"]
    arguments += ["--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["deblur_table", *arguments])
    # It works with one thread; the tests after this one shall not.
    monkeypatch.setattr(deblur_table.unsmear, "set_num_threads", lambda _: None)
    assert deblur_table.main() == 0
    report = json.loads((tmp_path / "deblur_table.json").read_text())
    gains = {r["method"]: r["gain"] for r in report["records"]}
    assert set(gains) == {*deblur_table.METHODS, "blind RL"}
    assert gains["wiener"] > 3 > 0 > gains["thesis"]
    table = (tmp_path / "deblur_table.md").read_text()
    assert "| T7 |" in table and "wiener" in table


def test_wrong_velocities_are_told_apart(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(BENCHES)
    import deblur_mismatch

    right = np.zeros((2, 2, 2), np.float32) + np.float32([3, 4])
    wrong = deblur_mismatch.distorted(right, 1.5, 90.0)
    np.testing.assert_allclose(wrong[0, 0], [-6, 4.5], atol=1e-6)
    arguments = ["--pictures", "camera", "--cases", "T7", "--noises", "1"]
    arguments += ["--methods", "wiener", "--size", "96", "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["deblur_mismatch", *arguments])
    monkeypatch.setattr(deblur_mismatch.unsmear, "set_num_threads", lambda _: None)
    assert deblur_mismatch.main() == 0
    (record,) = json.loads((tmp_path / "deblur_mismatch.json").read_text())["records"]
    assert record["gains"]["true"] > 3 + record["gains"]["x 1.5"]
    assert "| all |" in (tmp_path / "deblur_mismatch.md").read_text()


def record(picture: str, method: str, gain: float, seed: int = 1) -> dict:
    about = {"case": "T7", "picture": picture, "noise": 1.0, "seed": seed}
    values = {"gain": gain, "ssim": 0.9, "seconds": 0.1}
    return about | {"method": method, "before": {"psnr": 25.0, "ssim": 0.8}} | values


def table(*records: dict) -> dict:
    about = {"date": "2026-01-01", "processor": "one", "version": "1", "size": 96}
    kinds = {"pictures": "picture", "noises": "noise", "seeds": "seed"}
    lists = {k: list({r[key] for r in records}) for k, key in kinds.items()}
    return about | lists | {"records": list(records)}


def test_slices_of_a_bench_are_joined(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(BENCHES)
    import join_reports

    slices = [
        table(record("camera", "tv", 9.0), record("camera", "sk RL", 4.0)),
        table(record("coffee", "tv", 1.0)),
        # Measured again: it takes the place of the first.
        table(record("camera", "tv", 8.5)),
    ]
    for n, part in enumerate(slices):
        (tmp_path / str(n)).mkdir()
        (tmp_path / str(n) / "deblur_table.json").write_text(json.dumps(part))
    folders = [str(tmp_path / str(n)) for n in range(len(slices))]
    arguments = ["join_reports", "deblur_table", *folders, "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", arguments)
    assert join_reports.main() == 0
    report = json.loads((tmp_path / "deblur_table.json").read_text())
    assert report["pictures"] == ["camera", "coffee"]
    assert [r["gain"] for r in report["records"]] == [8.5, 4.0, 1.0]
    page = (tmp_path / "deblur_table.md").read_text()
    # The mean of both pictures; the lead on the one that both have restored.
    assert "| T7 | 25.0/0.80 | +4.8/0.90 | +4.0/0.90 |" in page
    assert "| T7 | +4.5 (sk RL) |" in page
    assert "Only part of it ran with sk RL: camera; seed 1" in page


def test_slices_of_other_versions_are_not_joined(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(BENCHES)
    import join_reports

    old = table(record("camera", "tv", 9.0)) | {"version": "0"}
    with pytest.raises(ValueError, match="differ in version"):
        join_reports.joined([old, table(record("coffee", "tv", 1.0))])


def test_a_slice_of_the_pictures_blurs_them_as_all_of_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(BENCHES)
    import deblur_table

    # Two layers: both the direction and the picture behind depend on the picture.
    every = list(deblur_table.blurred_cases(["2L"], ["astronaut", "camera"], 64))
    alone = list(deblur_table.blurred_cases(["2L"], ["camera"], 64))
    np.testing.assert_array_equal(every[1][2].blurred, alone[0][2].blurred)
