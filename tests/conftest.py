"""What many tests need: seeded randomness and, where it exists, real data."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import unsmear

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session", autouse=True)
def _interrupts_are_heard() -> None:
    """Let processes started by tests hear Ctrl-C.

    A shell ignores it for what it starts in the background, and so do all descendants
    of that, unless one of them listens.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20070525)


@pytest.fixture(scope="session")
def test_data() -> Callable[[str], Path]:
    """Return the path of an item of the real data, or skip the test.

    The data belong to their authors and are no part of the repository: the folder is
    named by UNSMEAR_TEST_DATA, else looked for beside it.
    """
    default = ROOT.parent / "shared" / "data"
    folder = Path(os.environ.get("UNSMEAR_TEST_DATA", default))

    def item(name: str) -> Path:
        path = folder / name
        if not path.exists():
            pytest.skip(f"no real data at {path}; UNSMEAR_TEST_DATA names their folder")
        return path

    return item


@pytest.fixture
def threads() -> Iterator[Callable[[int], None]]:
    """Set the number of threads for one test only."""
    before = unsmear.get_num_threads()
    yield unsmear.set_num_threads
    unsmear.set_num_threads(before)
