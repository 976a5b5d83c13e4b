"""Several motions: lines that meet, then a veil and an edge with known motions."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import unsmear
from numpy.typing import NDArray

Array = NDArray[Any]
BACK, FRONT = (1.0, -0.5), (-0.8, 0.9)


def components(
    velocities: list[tuple[float, float]], angles: list[float]
) -> unsmear.ComponentVelocities:
    """One pixel per velocity, one filter per direction, of 0.2 cycles/px."""
    k = 0.4 * np.pi * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    phi = np.empty((len(angles), 1, len(velocities), 3), np.float32)
    phi[..., :2] = k[:, None, None]
    phi[..., 2] = -(k @ np.array(velocities).T)[:, None]
    normal = -phi[..., 2:] * phi[..., :2] / (phi[..., :2] ** 2).sum(-1, keepdims=True)
    return unsmear.ComponentVelocities(
        velocity=normal,
        phase_gradient=phi,
        amplitude=np.ones(phi.shape[:-1], np.float32),
        orientation=np.array(angles),
        frequency=np.full(len(angles), 0.2),
    )


# Laws


def test_lines_meet_in_the_velocity() -> None:
    c = components([BACK] * 5 + [FRONT] * 3, [0.1, 0.7, 1.7, 2.6])
    first, second = unsmear.several_motions(c)
    # Single precision of the phase gradient, over the crossing of the lines.
    np.testing.assert_allclose(first.velocity, BACK, atol=1e-5)
    np.testing.assert_allclose(second.velocity, FRONT, atol=1e-5)
    assert (first.share, second.share) == (5 / 8, 3 / 8)
    votes, axis = unsmear.velocity_votes(c)
    assert axis[-1] == pytest.approx(2.5, abs=0.075)  # half of 5 px
    assert np.allclose(axis, -axis[::-1])
    # All lines of the five pass (1, -.5), a step of the axis away at most.
    row, column = (np.argmin(np.abs(axis - s)) for s in (BACK[1], BACK[0]))
    assert votes[row, column] > 0.5 * 5 / 8
    assert votes.max() <= 1


def test_parallel_lines_meet_nowhere() -> None:
    assert unsmear.several_motions(components([BACK], [0.3])) == []
    assert unsmear.several_motions(components([BACK, FRONT], [0.3, 0.31])) == []


def test_what_failed_its_tests_or_lies_outside_has_no_vote() -> None:
    c = components([BACK, FRONT], [0.1, 0.9, 1.7])
    c.velocity[:, 0, 1] = np.nan
    (only,) = unsmear.several_motions(c, count=3)
    assert only.share == 1
    there = np.array([[False, True]])
    assert unsmear.several_motions(c, region=there) == []
    votes, _ = unsmear.velocity_votes(c, region=there)
    assert (votes == 0).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"count": 0}, "count must be >= 1, got 0"),
        ({"tolerance": 0.0}, "tolerance must be > 0 px/frame, got 0"),
        ({"reach": np.inf}, "reach must be > 0 px/frame, got inf"),
        ({"region": np.ones((1, 1), bool)}, r"region must be bool of shape \(1, 2\)"),
        ({"region": np.ones((1, 2))}, "region must be bool .* got float64"),
    ],
)
def test_bad_calls_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        unsmear.several_motions(components([BACK, FRONT], [0.1, 0.9]), **given)


# Scenes


def scene(opacity: Array, motions: list[tuple[float, float]], n_frames: int) -> Array:
    make = unsmear.synthetic
    paint = [make.texture((110, 110), seed=seed, exponent=0.6) for seed in (1, 2)]
    back, front = (make.translating(motion) for motion in motions)
    return make.layers(
        *paint,
        opacity,
        shape=(56, 56),
        n_frames=n_frames,
        background_motion=back,
        foreground_motion=front,
    ).sharp


def found(c: unsmear.ComponentVelocities, **given: Any) -> list[Any]:
    """Motions in the order back, front, rest."""
    seen = unsmear.several_motions(c, **given)
    return sorted(
        seen, key=lambda m: (m.share < 0.1, np.hypot(*np.subtract(m.velocity, BACK)))
    )


def test_both_motions_of_a_veil_are_seen() -> None:
    frames = scene(np.full((110, 110), 0.5), [BACK, FRONT], 15)
    c = unsmear.component_velocities(
        frames, temporal="velocity-tuned", tuning_frequency=(0.25, 0.18)
    )
    back, front, rest = found(c, count=3)
    # Mixtures in single filters pull a little: a twentieth of a pixel at the most.
    np.testing.assert_allclose(back.velocity, BACK, atol=0.05)
    np.testing.assert_allclose(front.velocity, FRONT, atol=0.05)
    assert min(back.share, front.share) > 0.25
    assert rest.share < 0.1


def test_both_motions_at_an_edge_are_seen_and_only_one_beside_it() -> None:
    half = np.zeros((110, 110), bool)
    half[:, 55:] = True
    frames = scene(half, [BACK, FRONT], 3)
    c = unsmear.component_velocities(frames, tuning_frequency=(0.25, 0.18))
    back, front = found(c)
    np.testing.assert_allclose(back.velocity, BACK, atol=0.05)
    np.testing.assert_allclose(front.velocity, FRONT, atol=0.05)
    assert min(back.share, front.share) > 0.25
    left = np.zeros((56, 56), bool)
    left[:, :16] = True
    alone, nothing = unsmear.several_motions(c, region=left)
    np.testing.assert_allclose(alone.velocity, BACK, atol=0.05)
    assert alone.share > 0.7 and nothing.share < 0.1


def test_steadiness_sorts_out_what_beats() -> None:
    frames = scene(np.full((110, 110), 0.5), [BACK, FRONT], 3)

    def purity(least: float) -> float:
        c = unsmear.component_velocities(
            frames, tuning_frequency=0.25, least_steadiness=least
        )
        phi = c.phase_gradient[np.isfinite(c.velocity).all(-1)]
        assert len(phi) > 500
        lines = phi / np.hypot(phi[:, 0], phi[:, 1])[:, None]
        off = [np.abs(lines @ (*motion, 1.0)) for motion in (BACK, FRONT)]
        return float((np.minimum(*off) < 0.15).mean())

    # Half of the components of a veil belong to neither motion without the test.
    assert purity(0.95) > purity(0.0) + 0.1


def test_the_example_finds_both_motions_and_draws(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    monkeypatch.setattr(plt, "show", lambda: None)
    example = Path(__file__).parent.parent / "examples" / "plot_two_motions.py"
    there = runpy.run_path(str(example), run_name="__main__")
    panels = [axis for axis in there["figure"].axes if axis.get_title()]
    assert [axis.get_title() for axis in panels[::2]] == [
        "veil: middle frame",
        "edge: middle frame",
    ]
    plt.close("all")
    found = re.findall(
        r"(veil|edge): \(\s*([-.\d]+),\s*([-.\d]+)\) px", capsys.readouterr().out
    )
    for scene_ in ("veil", "edge"):
        velocities = sorted((float(u), float(v)) for n, u, v in found if n == scene_)
        # To a tenth of a pixel, as the docstring of `several_motions` has it.
        np.testing.assert_allclose(velocities, [(-0.8, 0.9), (1.0, -0.5)], atol=0.1)
