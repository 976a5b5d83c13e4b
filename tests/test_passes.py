"""How many passes a frame gets, and what they are guided by."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from unsmear.restoration import passes as module
from unsmear.restoration.passes import Passes
from unsmear.restoration.records import Alone, Restored, Settings
from unsmear.restoration.source import Source

SETTINGS = Settings(None, None, "balanced", {}, 1, 0)
SHAPE = (4, 5)


class FakeChain:
    """A pass whose frames are its own number and whose ratios are given."""

    made: list[FakeChain]
    ratios: tuple[float, ...]
    used_from = 0
    unsteady = 1.0

    def __init__(self, _source: Source, guide: Any, _settings: Settings) -> None:
        self.guide = guide
        self.number = len(self.made)
        self.forgotten: list[int] = []
        self.made.append(self)

    def restored(self, _index: int) -> Restored:
        picture = np.full((1, *SHAPE), 10.0 + self.number, np.float32)
        ones = np.ones(SHAPE, np.float32)
        alone = Alone(np.pad(picture, ((0, 0), (2, 2), (2, 2))), 2, 0.1, ones)
        changed = np.full(SHAPE, self.number >= self.used_from)
        came = np.zeros((1, *SHAPE), np.float32)
        return Restored(came, changed, self.ratios[self.number], {}, alone)

    def unsteadiness(self, _index: int) -> float:
        return self.unsteady

    def forget_before(self, index: int, guided: int = 0) -> None:
        self.forgotten.append((index, guided))


@pytest.fixture
def chains(monkeypatch: pytest.MonkeyPatch) -> type[FakeChain]:
    fresh: dict[str, Any] = {"made": [], "ratios": (0.9, 0.8, 0.7)}
    chain = type("Chain", (FakeChain,), fresh)
    monkeypatch.setattr(module, "Chain", chain)
    return chain


def passes() -> Passes:
    frames = np.arange(2 * 4 * 5, dtype=np.uint8).reshape(2, *SHAPE)
    return Passes(Source(frames, None), SETTINGS)


@pytest.mark.parametrize(
    ("ratios", "unsteady", "again", "expected"),
    [
        ((0.9, 0.8, 0.7), 1.0, None, 3),
        ((0.9, 0.8, 0.85), 1.0, None, 2),
        ((0.9, 0.95, 0.1), 1.0, None, 1),
        ((0.9, 0.8, 0.7), 0.1, None, 1),
        ((0.9, 0.8, 0.7), 0.1, True, 3),
        ((0.9, 0.8, 0.7), 1.0, False, 1),
    ],
)
def test_goes_on_while_frames_agree_better(
    chains: Any,
    ratios: tuple[float, ...],
    unsteady: float,
    again: bool | None,
    expected: int,
) -> None:
    chains.ratios, chains.unsteady = ratios, unsteady
    result, chain, number = passes().best(0, again)
    assert number == expected
    assert result.ratio == ratios[expected - 1]
    assert chain is chains.made[expected - 1]


@pytest.mark.parametrize(
    ("ratio", "expected"), [(1.05, 3), (1.2, 3), (1.4, 1), (np.nan, 1)]
)
def test_what_is_not_shown_may_still_guide(
    chains: Any, ratio: float, expected: int
) -> None:
    chains.ratios = (ratio, 0.8, 0.7)
    made = passes()
    chains.used_from = 3
    # Flow is measured on it, unless it is hopeless ...
    guide = chains.made[1].guide(0)
    shown = 10.0 if ratio < 1.3 else 0.0
    np.testing.assert_allclose(guide, np.full(SHAPE, shown))
    # ... and what changes nothing is no better than what came.
    assert made.best(0, None)[2] == 1
    # It does not end the search either: the pass after it may be shown.
    for first in (1, 2):
        chains.used_from = first
        assert made.best(0, None)[2] == expected
    # But no better than the blurred frame is not enough then.
    chains.ratios = (1.05, 1.02, 1.0)
    assert made.best(0, None)[2] == 1
    chains.used_from = 0
    assert made.best(0, None)[2] == 3


def test_each_pass_keeps_results_that_those_after_it_look_back_on(
    chains: Any,
) -> None:
    passes().forget_before(20)
    # 5 frames back for every pass to come.
    kept = [[(20, 10)], [(20, 5)], [(20, 0)]]
    assert [chain.forgotten for chain in chains.made] == kept
