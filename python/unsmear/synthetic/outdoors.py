"""Scenes under the sky: yosemite, street, medium, complex.

Recreated in kind after chapter 5.1.1 of the founding work; shapes, patterns and paths
are our own. Lengths are metres (the hills' are hundreds); speeds in px are for a
picture 256 px wide and grow with its width.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.lighting import Light, Sky
from unsmear.synthetic.pose import looking, placed, turned
from unsmear.synthetic.ray_caster import Body, Camera, World
from unsmear.synthetic.solids import Box, Disc, Rectangle, Sphere
from unsmear.synthetic.still_life import floor, pattern
from unsmear.synthetic.surface import Surface
from unsmear.synthetic.terrain import Terrain
from unsmear.synthetic.texture import checkers, texture

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from unsmear.synthetic.pose import Pose

__all__ = ["car", "complex_", "medium", "street", "yosemite"]

_WHEEL = 0.34  # m, radius


def car(
    position: ArrayLike, *, heading: float = 0.0, speed: float = 0.0, seed: int = 0
) -> list[Body]:
    """Return a car whose wheels roll.

    Parameters
    ----------
    position : array_like of shape (3,)
        Of the middle of its stand on the road, at time 0.
    heading : float, default 0
        Degrees from x (right) towards the camera's near side: it drives along its x.
    speed : float, default 0
        Per frame.
    seed : int, default 0
        Of its paint.
    """
    turn = turned((0, 1, 0), heading)
    velocity = turn @ np.array([speed, 0, 0])
    stand = np.asarray(position, dtype=np.float64)

    def part(offset: tuple[float, float, float], spin: float = 0.0) -> Pose:
        return placed(
            stand + turn @ np.array(offset),
            velocity=velocity,
            orientation=turn,
            axis=(0, 0, 1),
            degrees=spin,
        )

    paint, cabin = pattern(60 + seed, 3.0), pattern(70 + seed, 2.0)
    roll = math.degrees(speed / _WHEEL)
    tread = Surface(checkers((64, 64), (4, 4), dark=0.05, bright=0.5), 2 * _WHEEL)
    bodies = [
        Body(Box(3.8, 0.75, 1.6), paint, part((0, -0.65, 0))),
        Body(Box(1.9, 0.6, 1.4), cabin, part((-0.2, -1.3, 0))),
    ]
    wheels = [(x, -_WHEEL, z) for x in (-1.15, 1.2) for z in (-0.82, 0.82)]
    return bodies + [Body(Disc(_WHEEL), tread, part(at, roll)) for at in wheels]


def yosemite(shape: tuple[int, int]) -> World:
    """Return a flight over hills towards the middle right, under drifting clouds.

    The land moves up to 8 px/frame, the clouds about 2 px to the right while they
    change. Difficulty: expansion over smooth texture, a ragged horizon, and clouds
    that do not keep their brightness.
    """
    # A valley along x, in which we fly, and mountains 48 ahead that close it.
    z, _ = np.mgrid[:64, :64] / 64
    hills = 15 * (texture((64, 64), seed=85, exponent=2.2) - 0.5)
    land = Body(
        Terrain(hills - 8 * np.cos(2 * np.pi * z), 1.5),
        Surface(texture((512, 512), seed=82, exponent=0.9), 40.0),
        placed(),
    )
    # As far as Yosemite's: 2 px of a picture 256 px wide, per frame.
    drift = placed(degrees=math.degrees(2 / 256))
    clouds = [
        Surface(texture((256, 256), seed=83 + n, exponent=1.5), 2.0) for n in (0, 1)
    ]
    camera = Camera(
        looking(
            lambda t: (0.12 * t, -4.0, 0.55 * t),
            lambda t: (0.12 * t, -4.0, 20 + 0.55 * t),
            lambda _: 0.0,
        ),
        shape[1],
    )
    sky = Sky(clouds[0], drift, clouds[1], 0.03)
    return World((land,), camera, shape, sky=sky)


def street(shape: tuple[int, int]) -> World:
    """Return a car driving past house fronts while the camera pans slowly.

    The car, partly behind a pillar at first, moves 4 px/frame on screen, the rims of
    its rolling wheels up to 8; the houses move 1 px to the left. Difficulty: small fast
    parts, occlusion, and a slow pan.
    """
    houses = Body(Rectangle(), pattern(90, 8.0, 0.8), placed((0, 0, 11)))
    road = floor(pattern(91, 4.0, 0.9), 1.6)
    pillar = Body(Box(0.9, 6, 0.9), pattern(92, 2.0), placed((-2.3, 0, 5)))
    windows = [
        Body(Rectangle(1.1, 1.5), 0.15, placed((x, -1.2, 10.95)))
        for x in np.arange(-8, 9, 2.5)
    ]
    vehicle = car((-0.9, 1.6, 7.0), speed=0.11)

    def ahead(t: float) -> tuple[float, float, float]:
        return math.sin(0.004 * t), 0.0, math.cos(0.004 * t)

    eye = looking(lambda _: (0, 0, 0), ahead, lambda _: 0.0)
    bodies = (houses, road, *windows, *vehicle, pillar)
    return World(bodies, Camera(eye, shape[1]), shape)


def medium(shape: tuple[int, int]) -> World:
    """Return a parked car on a checkered floor that the camera nears and swings round.

    Up to 8 px/frame. Difficulty: expansion and translation together on a floor whose
    squares repeat, so that only the car's edges say which of the two moves.
    """
    squares = checkers((256, 256), (16, 16), dark=0.25, bright=0.75)
    ground = floor(Surface(squares, 16.0), 1.5)

    def eye(t: float) -> tuple[float, float, float]:
        angle, distance = math.radians(1.2 * t - 35), 8.0 - 0.12 * t
        return distance * math.sin(angle), -0.7, 8 - distance * math.cos(angle)

    camera = looking(eye, lambda _: (0, 0.6, 8), lambda _: 0.0)
    vehicle = car((0, 1.5, 8), seed=1)
    sky = Sky(pattern(95, 2.0, 1.5))
    return World((ground, *vehicle), Camera(camera, shape[1]), shape, sky=sky)


def complex_(shape: tuple[int, int]) -> World:
    """Return what a driver sees: houses and trees go by, two cars come.

    One car pulls out of a side street, one comes towards us. Up to 19 px/frame at the
    border. Difficulty: large motion, thin trunks, many depths, and shadows.
    """
    bodies = [floor(pattern(100, 4.0, 0.8), 1.4)]
    for n in range(10):
        side = -1 if n % 2 else 1
        ahead = 9 + 5.5 * n + (3 if n % 2 else 0)
        height = 4 + (n * 7) % 5
        if n == 3:
            continue  # the side street
        house = placed((side * 8.5, 1.4 - height / 2, ahead))
        bodies.append(Body(Box(7, height, 5), pattern(101 + n, 6.0, 0.8), house))
    for n in range(6):
        x, z = (3.9 if n % 2 else -3.9), 5.0 + 4.5 * n
        trunk = placed((x, 0.2, z))
        bodies.append(Body(Box(0.22, 2.4, 0.22), pattern(120, 1.0), trunk))
        crown = placed((x, -1.5, z))
        bodies.append(Body(Sphere(0.95), pattern(121 + n, 3.0, 0.6), crown))
    bodies += car((-3.6, 1.4, 15.5), speed=0.16, seed=2)
    bodies += car((-1.5, 1.4, 22.0), heading=90, speed=0.35, seed=3)
    sun = Light((0.5, 1.0, 0.6), ambient=0.45)
    camera = Camera(placed((0.6, 0, 0), velocity=(0, 0, 0.4)), shape[1])
    clouds = Surface(
        0.7 + 0.5 * (texture((256, 256), seed=130, exponent=1.6) - 0.5), 3.0
    )
    return World(tuple(bodies), camera, shape, light=sun, sky=Sky(clouds))
