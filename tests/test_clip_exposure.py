"""Exposures of a clip: what its frames agree on, and what not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from unsmear.restoration.clip_exposure import ClipExposure
from unsmear.restoration.memo import Memo


def exposure(
    monkeypatch: pytest.MonkeyPatch,
    found: list[tuple[float, str]],
    tiles: int = 40,
    vote: float = 0.5,
) -> Any:
    """Return the exposure of the middle frame of a clip in which these are found."""

    def search(_self: ClipExposure, index: int) -> dict[str, Any]:
        value, status = found[index]
        return {
            "value": value if status == "ok" else 0.4,
            "likeliest": value,
            "vote": vote,
            "status": status,
            "spread": 0.02,
            "noise": 1.0,
            "tiles": tiles,
        }

    monkeypatch.setattr(ClipExposure, "_search", search)
    source: Any = SimpleNamespace(count=len(found))
    nothing: Any = None
    clip = ClipExposure(source, nothing, Memo(), given=None, noise=None, seed=0)
    return clip.exposure(len(found) // 2)


def test_what_frames_agree_on_is_smoothed(monkeypatch: pytest.MonkeyPatch) -> None:
    values = [0.44, 0.52, 0.5, 0.47, 0.55]
    one = exposure(monkeypatch, [(value, "ok") for value in values])
    assert one.status == "ok"
    assert 0.47 < one.value < 0.53


def test_a_shutter_that_jumps_about_is_not_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # As found in a shaken page of print, exposed for the whole interval.
    values = [0.13, 1.28, 1.4, 0.25, 0.2]
    one = exposure(monkeypatch, [(value, "ok") for value in values])
    assert (one.value, one.status) == (1.0, "unsure")


def test_unsure_frames_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [(0.13, "unsure"), (0.5, "ok"), (0.5, "ok"), (0.5, "ok"), (1.0, "unsure")]
    one = exposure(monkeypatch, found)
    assert one.status == "ok"
    assert one.value == pytest.approx(0.5)


def test_alone_among_unsure_ones_is_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [(0.4, "unsure")] * 2 + [(1.2, "ok")] + [(0.4, "unsure")] * 2
    one = exposure(monkeypatch, found)
    assert (one.value, one.status) == (1.0, "unsure")


def test_no_shutter_is_open_for_longer_than_the_interval(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    used = {
        value: exposure(monkeypatch, [(value, "ok")] * 5).value
        for value in (0.9, 1.0, 1.04, 1.09, 1.15, 1.3)
    }
    assert used[0.9] == pytest.approx(0.9)
    assert used[1.0] == pytest.approx(1.0)
    assert used[1.04] == used[1.09] == pytest.approx(1.012)
    # A greater error is one of the flow, which exposure takes up.
    assert 1.0 < used[1.15] < 1.15
    assert used[1.3] == pytest.approx(1.3)


def test_a_few_tiles_do_not_show_what_no_shutter_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # As found on a car of 30 px in a street at rest.
    found = [(1.7, "ok")] * 5
    few, many = (exposure(monkeypatch, found, tiles) for tiles in (5, 40))
    assert (few.value, few.status) == (1.0, "unsure")
    assert (many.value, many.status) == (pytest.approx(1.7), "beyond")


def test_frames_that_are_nearly_sure_count_if_they_agree(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # As found in a page of print that turns.
    agree = [(value, "unsure") for value in (1.02, 1.02, 1.02, 1.0, 1.01)]
    one = exposure(monkeypatch, agree, vote=0.67)
    assert one.status == "ok"
    assert 1.0 < one.value <= 1.012
    one = exposure(monkeypatch, agree, vote=0.5)
    assert (one.value, one.status) == (0.4, "unsure")
    one = exposure(monkeypatch, agree, tiles=8, vote=0.67)
    assert (one.value, one.status) == (0.4, "unsure")
    at_the_end = [(0.051, "unsure")] * 5
    one = exposure(monkeypatch, at_the_end, vote=1.0)
    assert (one.value, one.status) == (0.4, "unsure")
    scattered = [(value, "unsure") for value in (0.9, 0.75, 1.02, 0.8, 1.01)]
    one = exposure(monkeypatch, scattered, vote=0.67)
    assert (one.value, one.status) == (0.4, "unsure")
