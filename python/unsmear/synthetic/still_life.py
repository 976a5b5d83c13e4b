"""Scenes of things at rest or turning in place: sphere, office, blocks, vcbox, simple.

Recreated in kind after chapter 5.1.1 of the founding work; shapes, patterns and paths
are our own. Lengths are metres; speeds in px are for a picture 256 px wide and grow
with its width.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.lighting import Light, Sky
from unsmear.synthetic.pose import looking, placed, turned
from unsmear.synthetic.ray_caster import Body, Camera, World
from unsmear.synthetic.solids import Box, Rectangle, Sphere
from unsmear.synthetic.surface import Surface
from unsmear.synthetic.texture import checkers, texture

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.synthetic.pose import Pose

__all__ = ["blocks", "floor", "office", "pattern", "simple", "sphere", "vcbox"]

_SIDE = 256  # px of a pattern
_FLAT = turned((1, 0, 0), 90)  # lays a rectangle down, its y ahead


def pattern(seed: int, size: float, exponent: float = 1.0) -> Surface:
    """Return a random pattern whose copies are ``size`` wide."""
    return Surface(texture((_SIDE, _SIDE), seed=seed, exponent=exponent), size)


def floor(surface: Surface, below: float) -> Body:
    """Return an endless floor ``below`` the camera's level."""
    return Body(Rectangle(), surface, placed((0, below, 0), orientation=_FLAT))


def _resting() -> Pose:
    return placed()


def sphere(shape: tuple[int, int]) -> World:
    """Return a checkered ball that turns in place before one even brightness.

    The axis leans forward, so that the pole is seen turning. Up to 3.2 px/frame;
    exactly 0 around it. Difficulty: nothing but the outline says where motion ends, the
    squares are the only texture, and the background has none.
    """
    lean = turned((1, 0, 0), -25)
    ball = Body(
        Sphere(1.0),
        Surface(checkers((128, 256), (8, 20)), 2 * math.pi),
        placed((0, 0, 4), orientation=lean, axis=(0, 1, 0), degrees=-2.0),
    )
    return World((ball,), Camera(_resting(), 1.1 * shape[1]), shape, sky=0.35)


def office(shape: tuple[int, int]) -> World:
    """Return a furnished room that the camera enters, straight ahead.

    Up to 6 px/frame at the border and 0 at the focus of expansion in the middle.
    Difficulty: slow motion around the focus, walls with faint texture, and depth that
    jumps at the furniture.
    """
    walls = Surface(0.55 + 0.35 * (texture((_SIDE, _SIDE), seed=11) - 0.5), 4.0)
    bodies = [Body(Box(6, 3, 10), walls, placed((0, 0, 3)))]
    pictures = [((-1.4, -0.3, 7.9), 1.2, 0.9), ((1.3, -0.4, 7.9), 0.9, 1.1)]
    for n, (place, width, height) in enumerate(pictures):
        frame = Body(Rectangle(width + 0.16, height + 0.16), 0.1, placed(place))
        canvas = placed((place[0], place[1], place[2] - 0.02))
        view = Body(Rectangle(width, height), pattern(12 + n, 1.2), canvas)
        bodies += [frame, view]
    furniture = [
        ((-2.1, 1.0, 4.5), (1.2, 1.0, 2.2)),
        ((1.9, 0.9, 3.6), (1.6, 1.2, 1.0)),
        ((1.7, 0.1, 3.7), (0.6, 0.5, 0.3)),
        ((-2.6, -0.1, 6.5), (0.6, 2.8, 1.4)),
        ((0.3, 1.2, 6.0), (0.7, 0.6, 0.7)),
    ]
    for n, (place, size) in enumerate(furniture):
        bodies.append(Body(Box(*size), pattern(20 + n, 2.0), placed(place)))
    camera = Camera(placed((0, 0, 0), velocity=(0, 0, 0.12)), 0.9 * shape[1])
    return World(tuple(bodies), camera, shape)


def blocks(shape: tuple[int, int]) -> World:
    """Return blocks on a patterned floor; the camera turns and moves in, unevenly.

    About its axis and ahead at once, both changing from frame to frame by as much as
    they are: up to 12 px/frame. Difficulty: no constant motion for any method that
    pools frames, rotation and expansion together.
    """
    bodies = [floor(pattern(30, 3.0, 0.8), 1.2)]
    stands = [
        (-1.3, 5.0, 0.9, 20),
        (0.2, 4.2, 0.7, 50),
        (1.5, 5.4, 1.1, -15),
        (0.5, 6.6, 1.3, 5),
        (-0.9, 3.4, 0.5, 70),
    ]
    for n, (x, z, size, turn) in enumerate(stands):
        place = placed((x, 1.2 - size / 2, z), orientation=turned((0, 1, 0), turn))
        bodies.append(Body(Box(size, size, size), pattern(31 + n, 1.5, 0.9), place))

    def eye(t: float) -> tuple[float, float, float]:
        advance = 0.05 * t + 0.07 * math.sin(2.2 * t)
        return 0.05 * math.sin(1.7 * t), -0.6, advance

    def roll(t: float) -> float:
        return 0.8 * t + 0.9 * math.sin(2.6 * t)

    camera = Camera(looking(eye, lambda _: (0.1, 0.6, 5.0), roll), 1.1 * shape[1])
    return World(tuple(bodies), camera, shape, sky=Sky(pattern(39, 2.0, 1.5)))


def _label() -> NDArray[np.float64]:
    """Return a bright label with bars and blocks as dark as print."""
    picture = np.full((_SIDE, _SIDE), 0.85)
    rng = np.random.default_rng(40)
    for row in range(24, 232, 26):
        edges = np.sort(rng.choice(np.arange(16, 240, 4), 10, replace=False))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            picture[row : row + 14, start:end] = rng.uniform(0.05, 0.5)
    return picture


def vcbox(shape: tuple[int, int]) -> World:
    """Return a labelled box on a patterned floor that the camera nears unsteadily.

    The focus of expansion jumps about between frames. Up to 8 px/frame. Difficulty:
    print with even areas between, and motion that is not constant.
    """
    body = placed((0, 0.2, 3.2), orientation=turned((0, 1, 0), 12))
    front = turned((0, 1, 0), 12) @ np.array([0, 0, -0.31])
    label = placed(np.array([0, 0.2, 3.2]) + front, orientation=turned((0, 1, 0), 12))
    bodies = (
        floor(pattern(41, 2.5, 0.8), 1.1),
        Body(Box(1.5, 1.8, 0.6), pattern(42, 2.0), body),
        Body(Rectangle(1.5, 1.8), Surface(_label(), 1.8), label),
    )

    def eye(t: float) -> tuple[float, float, float]:
        return 0.025 * math.sin(2.4 * t), -0.2 + 0.02 * math.sin(3.1 * t), 0.07 * t

    camera = Camera(lambda t: (np.eye(3), np.array(eye(t))), 1.1 * shape[1])
    return World(bodies, camera, shape, sky=0.6)


def simple(shape: tuple[int, int]) -> World:
    """Return a turning ball and a turning plate that come to hide each other.

    The ball is checkered and turns about a vertical axis; the plate is plain, hardly
    darker than the wall behind, and turns the other way. Lit from the side: both throw
    shadows, which move over the wall. The truth is the motion of the surfaces, so
    shadows move where the flow is 0. Up to 4 px/frame. Difficulty: shadows, shading
    that stays while the pattern turns, and an object without texture.
    """
    faint = 0.5 + 0.25 * (texture((_SIDE, _SIDE), seed=51) - 0.5)
    wall = Body(Rectangle(), Surface(faint, 3.0), placed((0, 0, 6.5)))
    ball = Body(
        Sphere(0.8),
        Surface(checkers((128, 256), (8, 16)), 2 * math.pi * 0.8),
        placed((-0.8, -0.1, 4.2), velocity=(0.025, 0, 0), degrees=-2.0),
    )
    plate = Body(
        Box(1.3, 1.3, 0.1),
        0.48,
        placed((0.9, 0.2, 5.2), velocity=(-0.03, 0, 0), axis=(0, 0, 1), degrees=2.0),
    )
    sun = Light((0.5, 0.35, 1.0), ambient=0.35)
    camera = Camera(_resting(), 1.1 * shape[1])
    return World((wall, ball, plate), camera, shape, light=sun)
