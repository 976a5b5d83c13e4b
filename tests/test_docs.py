"""The documentation: what it shows runs, what it names exists, nothing is left out."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import unsmear

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PACKAGE = ROOT / "python" / "unsmear"
CORE = ROOT / "crates" / "unsmear" / "src"
PAGES = [ROOT / "README.md", ROOT / "benches" / "README.md", *sorted(DOCS.glob("*.md"))]

# Commands shown that no test repeats, and why.
NOT_RUN = {
    "make demo": "builds the package; the gate installs it and runs its demo",
    "make test": "runs this very test",
}


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Yield language and text of each fenced block."""
    for fence in re.finditer(
        r"^```([^\n]*)\n(.*?)^```", page.read_text("utf-8"), re.M | re.S
    ):
        yield fence[1].strip(), fence[2]


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_is_of_a_kind_that_is_checked(page: Path) -> None:
    for language, text in blocks(page):
        # A directive is run by the site's build, a block without a name is no program.
        known = language in ("python", "sh", "") or language.startswith("{")
        assert known, f"{language}: {text}"


# The README's own programs run in test_readme, which also reads what they print.
@pytest.mark.parametrize(
    "page",
    [p for p in PAGES[1:] if any(kind == "python" for kind, _ in blocks(p))],
    ids=name,
)
def test_python_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if page.name == "clusters.md":
        pytest.importorskip("dask.array", reason="dask is not here")
    monkeypatch.chdir(tmp_path)
    together: dict[str, object] = {}  # a page is read from top to bottom
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, str(page), "exec"), together)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds what the commands name."""
    made = tmp_path_factory.mktemp("shell")
    shot = unsmear.synthetic.translation(
        unsmear.synthetic.texture((96, 96), seed=1),
        (4.0, 2.0),
        shape=(48, 64),
        exposure=1.0,
        n_frames=3,
        bits=8,
        noise=1.0,
    )
    unsmear.write_frames(made / "frames", shot.blurred)
    unsmear.write_frames(made / "clip.mp4", shot.blurred)
    (made / "clips").mkdir()
    for name in ("first.mp4", "second.mp4"):
        unsmear.write_frames(made / "clips" / name, shot.blurred[:2])
    unsmear.write_flow(made / "truth.flo", shot.flow[1])
    unsmear.write_flow(made / "flow.flo", shot.flow[1])
    (made / "bin").mkdir()
    program = made / "bin" / "unsmear"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m unsmear "$@"\n')
    program.chmod(0o755)
    return made


def commands() -> Iterator[pytest.param]:
    for page in PAGES:
        for language, text in blocks(page):
            if language == "sh":
                for line in text.replace("\\\n", " ").splitlines():
                    if line.strip():
                        yield pytest.param(line, id=f"{name(page)}: {line.strip()}")


@pytest.mark.parametrize("line", list(commands()))
def test_shell_commands_run(line: str, folder: Path) -> None:
    command = line.split(" #")[0].strip()
    if command in NOT_RUN:
        return
    if "--scheduler" in command:
        pytest.importorskip("distributed", reason="dask.distributed is not here")
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euc", command],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_exceptions_are_still_shown() -> None:
    shown = {text.strip() for page in PAGES for _, text in blocks(page)}
    assert set(NOT_RUN) <= shown, "an exception nobody needs"


def test_the_table_of_symbols_names_what_exists() -> None:
    rows = re.findall(
        r"^\|[^|]*\|[^|]*\| `(\w+)` \| `([\w/.]+)` \|",
        (DOCS / "theory.md").read_text("utf-8"),
        re.M,
    )
    assert len(rows) > 20
    for code, file in rows:
        path = ROOT / file if file.startswith("python/") else CORE / file
        assert re.search(rf"\b{code}\b", path.read_text("utf-8")), f"{code} in {file}"


def public_names() -> set[str]:
    """All that `__all__` of the package and its public modules promise."""
    parts = ("convert", "metrics", "noise", "plot", "synthetic")
    names = {n for n in unsmear.__all__ if n not in parts}
    for part in parts:
        names |= set(getattr(unsmear, part).__all__)
    return names


def names_in_all(path: Path) -> set[str]:
    """What a module promises, read without importing what it may need."""
    listed = re.search(r"__all__ = \[(.*?)\]", path.read_text("utf-8"), re.S)
    return set(re.findall(r'"(\w+)"', listed[1])) if listed else set()


def test_the_reference_leaves_nothing_out() -> None:
    text = "\n".join(p.read_text("utf-8") for p in (DOCS / "reference").glob("*.md"))
    shown = set(
        re.findall(r"^\.\. (?:auto\w+|py:data):: (?:[\w.]+\.)?(\w+)$", text, re.M)
    )
    lazy = re.findall(r"^\.\. auto\w+:: unsmear\.dask\.(\w+)$", text, re.M)
    assert set(lazy) == names_in_all(PACKAGE / "dask" / "__init__.py")
    whole = re.findall(r"^\.\. automodule:: unsmear\.(\w+)\n   :members:", text, re.M)
    for module in whole:
        shown |= set(getattr(unsmear, module).__all__)
    assert public_names() <= shown, f"not shown: {sorted(public_names() - shown)}"


def test_the_build_refuses_what_needs_a_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sphinx", reason="the site's tools are not here")
    monkeypatch.syspath_prepend(str(DOCS / "_extensions"))
    import offline

    page, style = tmp_path / "a.html", tmp_path / "a.css"
    page.write_text(
        '<a href="https://doi.org/1">read</a> <img src="b.png"> <script src="c.js">'
        '<link rel="stylesheet" href="_static/d.css">'
    )
    assert offline.from_elsewhere(tmp_path) == []
    page.write_text(
        '<script async src="https://cdn.example/x.js"></script>'
        '<link rel="stylesheet" href="//fonts.example/y.css"><img src="http://z/1.png">'
    )
    style.write_text("@import url(https://fonts.example/z.css);")
    found = offline.from_elsewhere(tmp_path)
    assert len(found) == 4 and found[0].startswith("a.css: ")


def test_the_gallery_has_a_place_for_every_example() -> None:
    listed = re.findall(r'^    "(plot_\w+)",$', (DOCS / "conf.py").read_text(), re.M)
    found = {path.stem for path in (ROOT / "examples").glob("*.py")}
    assert set(listed) == found and len(listed) == len(found)
