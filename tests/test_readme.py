"""What the README and the documentation show runs, and prints what they say."""

import doctest
import re
from pathlib import Path

import pytest
import unsmear
from unsmear import blur, component_velocity, deblur, demo_clip, flow  # noqa: F401

ROOT = Path(__file__).parent.parent
MODULES = (
    "blur",
    "convert",
    "deblur",
    "demo_clip",
    "exposure",
    "flow",
    "metrics",
    "motion_operator",
    "motions",
    "noise",
    "plot.flow_pictures",
    "psf",
    "sequence",
    "streaming.clip",
    "streaming.deblur_clip",
)


def test_python_blocks_of_the_readme_run(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert blocks, "the README shows Python"
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    before, after = re.findall(r"([\d.]+) dB", capsys.readouterr().out)
    assert float(after) > float(before) + 3


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings_run(name: str) -> None:
    import importlib

    module = importlib.import_module(f"unsmear.{name}")
    failed, _ = doctest.testmod(module, extraglobs={"unsmear": unsmear})
    assert failed == 0


def test_shell_commands_of_the_readme_exist() -> None:
    from unsmear.cli import parser

    text = (ROOT / "README.md").read_text()
    verbs = set(re.findall(r"^unsmear (\w+)", text, re.M))
    known = parser()._subparsers._group_actions[0].choices  # type: ignore[union-attr]
    assert verbs and verbs <= set(known)
