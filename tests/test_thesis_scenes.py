"""The nine scenes: each moves as it says, with its own difficulty."""

import doctest
import importlib

import numpy as np
import pytest
import unsmear
from unsmear.synthetic import THESIS_SCENES, sphere, thesis_scene

SHAPE = (72, 96)
# Largest speed promised, px/frame in a picture 256 px wide.
SPEEDS = {"yosemite": 8, "sphere": 3.2, "office": 6, "street": 8, "blocks": 12}
SPEEDS |= {"vcbox": 8, "simple": 4.4, "medium": 8, "complex": 19}


@pytest.mark.parametrize("name", THESIS_SCENES)
def test_each_scene_moves_as_it_says(name: str) -> None:
    s = thesis_scene(name, shape=SHAPE, n_frames=2)
    assert s.sharp.shape == (2, *SHAPE) and 0 <= s.sharp.min() <= s.sharp.max() <= 1
    speed = np.linalg.norm(s.flow[0], axis=-1) * 256 / SHAPE[1]
    assert 0.6 * SPEEDS[name] < speed.max() < 1.15 * SPEEDS[name]
    assert s.visible[0].mean() > 0.85
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    u, v = (np.ascontiguousarray(c, float) for c in np.moveaxis(s.flow[0], -1, 0))
    moving = s.visible[0] & (speed > 0.2)
    errors = []
    for sign in (1, -1):
        back = unsmear._unsmear.sample(
            s.sharp[1], y + sign * v, x + sign * u, 3, "replicate"
        )
        errors.append(np.median(np.abs(back - s.sharp[0])[moving]))
    # Shadows, changing clouds and mixed outlines keep no brightness: hence medians.
    assert errors[0] < 0.01 and errors[1] > 2 * errors[0]


def test_the_ball_turns_before_nothing() -> None:
    s = sphere(shape=SHAPE, n_frames=1)
    assert (s.flow[0, :, :8] == 0).all() and (s.sharp[0, :, :8] == 0.35).all()


def test_uneven_scenes_change_their_motion() -> None:
    # What defeats methods that pool frames: motion that is not constant.
    for name, uneven in (("blocks", True), ("vcbox", True), ("office", False)):
        s = thesis_scene(name, shape=SHAPE, n_frames=3)
        change = np.linalg.norm(s.flow[2] - s.flow[1], axis=-1)
        typical = np.median(change) / np.median(np.linalg.norm(s.flow[1], axis=-1))
        assert (typical > 0.3) == uneven


def test_shadows_move_where_the_wall_rests() -> None:
    s = thesis_scene("simple", shape=SHAPE, n_frames=2)
    resting = (s.flow[0] == 0).all(axis=-1) & s.visible[0]
    assert (np.abs(s.sharp[1] - s.sharp[0])[resting] > 0.05).sum() > 20


def test_unknown_scenes_are_named() -> None:
    with pytest.raises(ValueError, match="name must be one of 'yosemite'"):
        thesis_scene("rubik")


@pytest.mark.parametrize("name", ["thesis_scenes", "ray_caster", "blur_cases"])
def test_examples_run(name: str) -> None:
    module = importlib.import_module(f"unsmear.synthetic.{name}")
    failed, tried = doctest.testmod(module)
    assert failed == 0 < tried
