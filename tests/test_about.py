"""``--version`` and completion, as a user's shell meets them."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import unsmear
from unsmear import _unsmear
from unsmear.cli import _about, main


def test_version_says_what_runs(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    first, *rest = capsys.readouterr().out.splitlines()
    # The first line stays what scripts read.
    assert first == f"unsmear {unsmear.__version__}"
    named = dict(line.split(maxsplit=1) for line in rest)
    assert named["threads"] == str(unsmear.get_num_threads())
    assert named["core"].startswith("optimised, ")
    assert re.search(r"rustc \d+\.\d+\.\d+", named["core"])
    assert re.search(r"\w+-\w+-\w+ with ", named["core"]), "the target"
    assert {"commit", "vectors", "python", "numpy", "machine"} <= set(named)


def test_the_vectors_are_the_processor_s() -> None:
    vectors = dict(_unsmear.build_info())["vectors"]
    assert vectors in {"avx512", "avx2", "baseline"}
    listed = Path("/proc/cpuinfo")
    if platform.machine() != "x86_64" or not listed.exists():
        pytest.skip("the system names no x86-64 extensions")
    has = set(listed.read_text().split())
    widest = {"avx512f", "avx512bw", "avx512dq", "avx512vl"}
    expected = "avx512" if widest <= has else "avx2" if "avx2" in has else "baseline"
    assert vectors == expected


def test_a_setting_that_cannot_be_is_named() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "unsmear", "--version"],
        env=os.environ | {"UNSMEAR_NUM_THREADS": "many"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("unsmear: UNSMEAR_NUM_THREADS must be")


class Recorded:
    """A distribution whose installer left this record."""

    def __init__(self, record: dict | str | None) -> None:
        self.record = record

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        known = self.record is None or isinstance(self.record, str)
        return self.record if known else json.dumps(self.record)


@pytest.mark.parametrize(
    ("record", "commit"),
    [
        ({"url": "git+x", "vcs_info": {"vcs": "git", "commit_id": "a1b2"}}, "a1b2"),
        ({"url": "file:///nowhere", "dir_info": {"editable": True}}, None),
        ({"url": "file:///nowhere", "dir_info": {}}, None),
        ("{broken", None),
        (None, None),
    ],
)
def test_the_commit_is_the_one_the_installer_recorded(
    monkeypatch: pytest.MonkeyPatch, record: dict | str | None, commit: str | None
) -> None:
    monkeypatch.setattr(_about.metadata, "distribution", lambda _: Recorded(record))
    assert _about._commit() == commit


def test_a_working_copy_names_its_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if shutil.which("git") is None:
        pytest.skip("no git on this machine")
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(tmp_path), *identity, *arguments]
        return subprocess.run(
            command, check=True, capture_output=True, text=True
        ).stdout.strip()

    git("init", "-q")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "-qm", "a")
    record = {"url": tmp_path.as_uri(), "dir_info": {"editable": True}}
    monkeypatch.setattr(_about.metadata, "distribution", lambda _: Recorded(record))
    head = git("rev-parse", "--short=12", "HEAD")
    assert _about._commit() == head
    (tmp_path / "a").write_text("2")
    assert _about._commit() == f"{head}-dirty"


@pytest.fixture(scope="module")
def bash_script() -> str:
    pytest.importorskip("shtab")
    command = [sys.executable, "-m", "unsmear", "--print-completion", "bash"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def completed(script: str, *words: str, folder: Path) -> set[str]:
    """Ask bash itself what it would offer for the last word."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash on this machine")
    function = re.findall(r"^complete .*-F (\w+) unsmear$", script, re.M)
    assert function, "the script registers a function for unsmear"
    asked = " ".join(f"'{word}'" for word in words)
    program = (
        f"{script}\nCOMP_WORDS=({asked}); COMP_CWORD={len(words) - 1}\n"
        f"{function[0]} unsmear '{words[-1]}' '{words[-2]}'\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(
        [bash, "--norc", "-c", program],
        capture_output=True,
        text=True,
        cwd=folder,
        env={"PATH": os.environ["PATH"]},
        check=True,
    )
    return set(done.stdout.split())


def test_bash_completes_verbs_options_and_choices(
    bash_script: str, tmp_path: Path
) -> None:
    assert completed(bash_script, "unsmear", "de", folder=tmp_path) == {
        "demo",
        "deblur",
    }
    options = completed(bash_script, "unsmear", "deblur", "--fl", folder=tmp_path)
    assert {"--flow", "--flow-method"} <= options
    methods = completed(
        bash_script, "unsmear", "flow", "--method", "le", folder=tmp_path
    )
    assert methods == {"least-squares"}


def test_bash_completes_files(bash_script: str, tmp_path: Path) -> None:
    (tmp_path / "clip.mp4").touch()
    offered = completed(bash_script, "unsmear", "flow", "cl", folder=tmp_path)
    assert offered == {"clip.mp4"}


@pytest.mark.parametrize("shell", ["zsh", "tcsh"])
def test_other_shells_get_a_script(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("shtab")
    with pytest.raises(SystemExit) as ended:
        main(["--print-completion", shell])
    assert ended.value.code == 0 and "unsmear" in capsys.readouterr().out


def test_without_shtab_the_message_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as ended:
        main(["--print-completion", "bash"])
    assert ended.value.code == 1
    assert "unsmear[completion]" in capsys.readouterr().err
