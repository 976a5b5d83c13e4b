"""Which exposure is taken where the search for it was not sure."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from unsmear.restoration import alternatives as module
from unsmear.restoration.alternatives import Alternatives
from unsmear.restoration.records import Alone, Restored, Settings

SETTINGS = Settings(None, None, "balanced", {}, 1, 0)


def frame(
    ratio: float,
    exposure: float,
    likeliest: float | None = None,
    blur: float = 9.0,
    *,
    used: bool = True,
) -> Restored:
    report: dict[str, Any] = {
        "exposure": exposure,
        "blur_px": blur,
        "exposure_status": "unsure",
        "exposure_found": {"likeliest": likeliest},
    }
    changed, planes = np.full((2, 2), used), np.zeros((1, 2, 2), np.float32)
    alone = Alone(planes, 0, 0.1, np.ones((2, 2), np.float32))
    return Restored(planes, changed, ratio, report, alone)


@pytest.mark.parametrize(
    ("ratios", "likeliest", "expected"),
    [
        # What no shutter does is not tried, whatever an unsure search says.
        ({0.7: 0.92, 1.0: 0.68, 1.4: 0.50}, None, 1.0),
        ({0.7: 0.92, 1.0: 0.68, 1.4: 0.50}, 2.34, 1.0),
        ({0.7: 0.92, 1.0: 0.68, 1.4: 0.50}, 0.9, 1.0),
        ({0.7: 0.92, 1.0: 0.68, 1.4: 0.50}, 1.8, 1.0),
        # Of ratios within 5 % the one next to what the search found.
        ({0.7: 0.69, 1.0: 0.68}, 0.6, 0.7),
        ({0.7: 0.69, 1.0: 0.68}, 0.9, 1.0),
        ({0.7: 0.75, 1.0: 0.68}, 0.6, 1.0),
        # Without its word the least ratio.
        ({0.7: 0.60, 1.0: 0.61}, None, 0.7),
    ],
)
def test_ratios_and_the_search_decide(
    monkeypatch: pytest.MonkeyPatch,
    ratios: dict[float, float],
    likeliest: float | None,
    expected: float,
) -> None:
    class Chain:
        def __init__(self, _source: Any, _guide: Any, settings: Settings) -> None:
            assert settings.exposure is not None
            self.exposure = settings.exposure

        def restored(self, _index: int) -> Restored:
            return frame(ratios[self.exposure], self.exposure)

    monkeypatch.setattr(module, "Chain", Chain)
    source: Any = SimpleNamespace(guide=None)
    others = Alternatives(source, SETTINGS)
    own: Any = Chain(None, None, Settings(1.0, None, "balanced", {}, 1, 0))
    best, chain = others.best(0, frame(ratios[1.0], 1.0, likeliest), own)
    assert best.report["exposure"] == expected
    assert best.report["exposure_status"] == "unsure"
    assert (chain is own) == (expected == 1.0)


@pytest.mark.parametrize(("ratio", "used"), [(0.95, False), (0.85, True)])
def test_of_a_frame_left_as_it_came_only_what_convinces_is_used(
    monkeypatch: pytest.MonkeyPatch, ratio: float, *, used: bool
) -> None:
    # Its neighbours may have been restored by a wrong exposure, not it.
    def chain(_source: Any, _guide: Any, settings: Settings) -> Any:
        exposure = settings.exposure
        assert exposure is not None
        return SimpleNamespace(restored=lambda _: frame(ratio, exposure))

    monkeypatch.setattr(module, "Chain", chain)
    source: Any = SimpleNamespace(guide=None)
    others = Alternatives(source, SETTINGS)
    left, own = frame(1.2, 0.8, 1.0, used=False), object()
    any_chain: Any = own
    best, _ = others.best(0, left, any_chain)
    assert best.changed.any() == used
    assert best.report["exposure"] == (1.0 if used else 0.8)


def test_of_short_blur_twins_know_nothing() -> None:
    source: Any = SimpleNamespace(guide=None)
    others = Alternatives(source, SETTINGS)
    result, chain = frame(0.9, 0.6, 0.7, blur=2.0), object()
    own: Any = chain
    # No other exposure is tried: there is no clip to try it on.
    assert others.best(0, result, own) == (result, own)
