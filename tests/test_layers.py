"""The shape of the sources: imports run one way, files stay small.

The ranks of the core's modules are the table at the head of its ``lib.rs``: a module
uses modules of lower rank only. The package's layers, from below: the compiled core,
private helpers, public modules, the package itself, the command line.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "crates" / "unsmear" / "src"
PACKAGE = ROOT / "python" / "unsmear"

# Lines a file may have. A core file carries its own tests, a boundary file none.
LARGEST = {"crates/unsmear/": 300, "crates/unsmear-py/": 200, "python/": 300}
LARGEST |= {"tests/": 400, "benches/": 300, "scripts/": 300, "examples/": 80}
LARGEST_ROOT = 150  # lib.rs, a table of contents


# The core


@cache
def core_modules() -> dict[str, Path]:
    """Every module by its path in Rust."""
    modules = {}
    for path in sorted(CORE.rglob("*.rs")):
        parts = path.relative_to(CORE).with_suffix("").parts
        if parts[-1] == "mod":
            parts = parts[:-1]
        # Tests kept in a file beside their module may use what they like.
        if parts != ("lib",) and parts[-1] != "tests":
            modules["::".join(parts)] = path
    return modules


@cache
def ranks() -> dict[str, int]:
    """The table of ``lib.rs``: rank and modules in its first two columns."""
    table = {}
    for rank, names in re.findall(
        r"^//! \| (\d+) \| ([^|]*) \|", (CORE / "lib.rs").read_text("utf-8"), re.M
    ):
        for name in re.findall(r"`([\w:]+)`", names):
            assert name not in table, f"{name} is listed twice in lib.rs"
            table[name] = int(rank)
    return table


@cache
def code_of(path: Path) -> str:
    """The source without comments and without its tests."""
    source = path.read_text("utf-8").split("#[cfg(test)]\nmod tests")[0]
    return re.sub(r"//.*", "", source)


def uses(name: str, modules: dict[str, Path]) -> set[str]:
    """The modules that ``name`` uses, itself and re-exports of its parts apart."""
    code = code_of(modules[name])
    parent = name.rpartition("::")[0]
    paths = re.findall(r"\bcrate::(\w+(?:::\w+)*)", code)
    for inside in re.findall(r"\bcrate::\{([^}]*)\}", code):
        paths += re.findall(r"(?:^|,)\s*(\w+(?:::\w+)*)", inside)
    paths += [f"{parent}::{rest}" for rest in re.findall(r"\bsuper::([\w:]+)", code)]
    # A module's own submodules: `use bank::Bank`.
    paths += [f"{name}::{rest}" for rest in re.findall(r"\b([a-z]\w*)::", code)]
    found = set()
    for path in paths:
        parts = path.split("::")
        # The longest beginning that is a module: the rest names items in it.
        for end in range(len(parts), 0, -1):
            if "::".join(parts[:end]) in modules:
                found.add("::".join(parts[:end]))
                break
    return found - {name}


def test_every_core_module_has_a_rank() -> None:
    assert set(core_modules()) == set(ranks()), "the table in lib.rs is not the sources"


@pytest.mark.parametrize("name", core_modules())
def test_core_modules_use_lower_ranks_only(name: str) -> None:
    table, modules = ranks(), core_modules()
    upward = {u for u in uses(name, modules) if table[u] >= table[name]}
    assert not upward, f"{name} (rank {table[name]}) uses {sorted(upward)}"


def test_the_scan_sees_what_modules_use() -> None:
    modules = core_modules()
    assert {"gabor", "array", "border"} <= uses("component_velocity", modules)
    assert "flow::affine" in uses("flow::fleet_jepson", modules)
    assert "flow::thesis::bank" in uses("flow::thesis", modules)


def test_the_core_is_pure() -> None:
    for path in core_modules().values():
        code = code_of(path)
        for forbidden in (
            r"\bunsafe\b",
            r"\bprintln!",
            r"\bpyo3\b",
            r"std::(fs|env|io)\b",
        ):
            assert not re.search(forbidden, code), f"{path.name}: {forbidden}"


# The package


@cache
def package_modules() -> dict[str, Path]:
    """Every Python module by its dotted name; the compiled core by its stub."""
    modules = {"unsmear._unsmear": PACKAGE / "_unsmear.pyi"}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        modules[".".join(p for p in parts if p != "__init__")] = path
    return modules


@cache
def imports(name: str) -> frozenset[str]:
    """Modules of the package that ``name`` imports, anywhere, at run time."""
    modules = package_modules()
    path = modules[name]
    tree = ast.parse(path.read_text("utf-8"))
    for node in ast.walk(tree):
        # What only a type checker runs cannot close a circle.
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative imports hide the layer"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in modules else str(node.module))
    return frozenset(found & modules.keys()) - {name}


def layer(name: str) -> int:
    """From below: core, private helpers, public modules, the package, commands."""
    _, *rest = name.split(".")
    if not rest:
        return 3
    if rest[0] == "_unsmear":
        return 0
    if rest[0] in ("cli", "__main__"):
        return 4
    return 1 if rest[0].startswith("_") else 2


@pytest.mark.parametrize("name", package_modules())
def test_python_modules_do_not_import_upward(name: str) -> None:
    upward = {used for used in imports(name) if layer(used) > layer(name)}
    assert not upward, f"{name} imports {sorted(upward)}"


def test_python_modules_import_in_no_circle() -> None:
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " -> ".join([*path, name])
        if name not in done:
            for used in imports(name):
                # A package imports its parts, and they each other through it.
                if not name.startswith(f"{used}."):
                    visit(used, (*path, name))
            done.add(name)

    for name in package_modules():
        visit(name, ())
    assert {"unsmear._unsmear", "unsmear._arrays"} <= imports("unsmear.flow")


# Sizes


def sources() -> list[Path]:
    found = []
    for folder in LARGEST:
        for suffix in ("rs", "py", "pyi"):
            found += (ROOT / folder).rglob(f"*.{suffix}")
    return sorted(
        path.relative_to(ROOT) for path in found if "target" not in path.parts
    )


@pytest.mark.parametrize("path", sources(), ids=str)
def test_files_stay_small(path: Path) -> None:
    lines = len((ROOT / path).read_text("utf-8").splitlines())
    most = next(n for start, n in LARGEST.items() if path.as_posix().startswith(start))
    if path.name == "lib.rs":
        most = LARGEST_ROOT
    assert lines <= most, f"{lines} lines: which two concepts are here?"
