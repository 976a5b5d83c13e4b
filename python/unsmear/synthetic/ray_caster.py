r"""Scenes of solid bodies, seen by a moving camera.

Each pixel's ray :math:`o + \lambda\, d`, with :math:`d = R_c (x/f, y/f, 1)`, x and y in
px from the middle and f the focal length in px, is followed to the first body it meets;
:math:`\lambda` is the depth. The body's own point q met there moves with the body, so

.. math:: u(t \to t') = \pi_{t'}(R(t') q + p(t')) - \pi_t(R(t) q + p(t)),

with :math:`\pi_t` the projection by the camera at t, is the exact flow; bodies and
cameras that rest give exactly 0. A point is visible at t' when it lands in the picture
and the ray to it meets nothing before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.lighting import Light, Sky
from unsmear.synthetic.surface import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.synthetic.pose import Pose
    from unsmear.synthetic.solids import Solid

__all__ = ["Body", "Camera", "World"]

_NOTHING = -1  # the number of the body where a ray meets none
# Of the depth: what a ray meets within it of a point is the point itself.
_SAME_DEPTH = 1e-3
# Of the depth: how far off the surface a ray to the light starts.
_LIFT = 1e-4
# At lower angles a footprint is no longer than at this one.
_LEAST_COSINE = 1e-3


@dataclass(frozen=True)
class Body:
    """A shape with a surface (or one brightness, in [0, 1]) and a pose."""

    solid: Solid
    surface: Surface | float
    pose: Pose


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: its pose (axes right, down, ahead) and focal length in px."""

    pose: Pose
    focal: float

    def __post_init__(self) -> None:
        if not 0 < self.focal < np.inf:
            msg = f"focal must be > 0 px, got {self.focal}"
            raise ValueError(msg)


@dataclass(frozen=True)
class Hits:
    """What rays meet: body numbers (N,), depths (N,), the bodies' own points (N, 3).

    Where a ray meets nothing the depth is infinite and the point is the direction in
    the axes of the sky.
    """

    body: NDArray[np.intp]
    depth: NDArray[np.float64]
    point: NDArray[np.float64]


@dataclass(frozen=True)
class World:
    """Bodies, a camera, and what lights and surrounds them.

    Parameters
    ----------
    bodies : tuple of Body
        In any order.
    camera : Camera
        Sees them.
    shape : (int, int)
        (H, W) of the picture, px.
    light : Light, optional
        Default: bodies are as bright as their surfaces, without shadows.
    sky : Sky or float, default 0.5
        What is seen where no body is; a number is one brightness, at rest.
    rays : int, default 2
        A pixel is the mean of ``rays`` x ``rays`` rays through it; >= 1.

    Raises
    ------
    ValueError
        A shape without pixels or no rays.

    Examples
    --------
    A ball in front of a wall, passed by a camera at 2 px/frame of the wall:

    >>> from unsmear import synthetic as s
    >>> pattern = s.Surface(s.texture((128, 128), seed=1), 3.0)
    >>> bodies = (s.Body(s.Rectangle(), pattern, s.placed((0, 0, 8))),
    ...           s.Body(s.Sphere(0.5), pattern, s.placed((0, 0, 4), degrees=3)))
    >>> camera = s.Camera(s.placed(velocity=(0.2, 0, 0)), focal=80)
    >>> world = s.World(bodies, camera, (48, 64))
    >>> clip = s.record(world, n_frames=2, exposure=0.5, n_subframes=16)
    >>> clip.blurred.shape, clip.flow[0, 0, 0].round(6).tolist()
    ((2, 48, 64), [-2.0, 0.0])
    """

    bodies: tuple[Body, ...]
    camera: Camera
    shape: tuple[int, int]
    light: Light | None = None
    sky: Sky | float = 0.5
    rays: int = 2

    def __post_init__(self) -> None:
        if len(self.shape) != 2 or min(self.shape) < 1:
            msg = f"shape must be (H >= 1, W >= 1), got {tuple(self.shape)}"
            raise ValueError(msg)
        if self.rays < 1:
            msg = f"rays must be >= 1, got {self.rays}"
            raise ValueError(msg)

    def render(self, time: float) -> NDArray[np.float64]:
        """Return the picture at ``time``, (H, W)."""
        steps = (np.arange(self.rays) + 0.5) / self.rays - 0.5
        offsets = [(x, y) for y in steps for x in steps]
        total = sum(self._brightness(time, self._pixels() + o) for o in offsets)
        return np.asarray(total / len(offsets)).reshape(self.shape)

    def displacement(
        self, start: float, end: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the motion (H, W, 2) of what is seen, and whether it stays visible."""
        hits = self.cast(start, self._pixels())
        before, after = self.project(hits, start), self.project(hits, end)
        limit = np.array(self.shape[::-1]) / 2.0
        ahead = np.isfinite(after).all(axis=1)
        visible = np.asarray(ahead & (np.abs(after) <= limit).all(axis=1))
        seen = self.cast(end, after[visible])
        depth = self._in_camera(hits, end)[visible, 2]
        own = np.where(hits.body[visible] == _NOTHING, np.inf, depth)
        visible[visible] = seen.depth >= own * (1 - _SAME_DEPTH)
        return (after - before).reshape(*self.shape, 2), visible.reshape(self.shape)

    def velocity(self, time: float, step: float) -> NDArray[np.float64]:
        """Return the central difference of positions over ``2 step``, (H, W, 2)."""
        hits = self.cast(time, self._pixels())
        moved = self.project(hits, time + step) - self.project(hits, time - step)
        return (moved / (2 * step)).reshape(*self.shape, 2)

    def _pixels(self) -> NDArray[np.float64]:
        height, width = self.shape
        y, x = np.mgrid[:height, :width].astype(np.float64)
        middle = np.stack([x - (width - 1) / 2, y - (height - 1) / 2], axis=-1)
        return middle.reshape(-1, 2)

    def _rays(
        self, time: float, pixels: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rotation, eye = self.camera.pose(time)
        own = np.concatenate([pixels / self.camera.focal, np.ones((len(pixels), 1))], 1)
        directions = own @ rotation.T
        return np.broadcast_to(eye, directions.shape), directions

    def cast(self, time: float, pixels: NDArray[np.float64]) -> Hits:
        """Return what rays through ``pixels`` (N, 2), px from the middle, meet."""
        origins, directions = self._rays(time, pixels)
        body, depth = self._nearest(time, origins, directions)
        points = directions @ self._sky_axes(time)
        for number, own in enumerate(self.bodies):
            mine = body == number
            if mine.any():
                rotation, position = own.pose(time)
                met = origins[mine] + depth[mine, None] * directions[mine]
                points[mine] = (met - position) @ rotation
        return Hits(body, depth, points)

    def _nearest(
        self, time: float, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        depth = np.full(len(directions), np.inf)
        body = np.full(len(directions), _NOTHING, dtype=np.intp)
        # Only rays that pass within a body's radius need a closer look. With o the
        # origin from the body and d the direction they pass at o^2 - (o.d)^2 / d^2.
        squares = (directions**2).sum(axis=1)
        origin_squares = (origins**2).sum(axis=1)
        along_origin = (origins * directions).sum(axis=1)
        for number, own in enumerate(self.bodies):
            rotation, position = own.pose(time)
            along = along_origin - directions @ position
            away = origin_squares - 2 * (origins @ position) + position @ position
            reach = own.solid.radius**2 * (1 + _SAME_DEPTH)
            near = np.flatnonzero(away - along**2 / squares <= reach)
            if not near.size:
                continue
            way = (origins[near] - position) @ rotation
            met = own.solid.meet(way, directions[near] @ rotation)
            first = met < depth[near]
            depth[near[first]], body[near[first]] = met[first], number
        return body, depth

    def _sky_axes(self, time: float) -> NDArray[np.float64]:
        return self.sky.pose(time)[0] if isinstance(self.sky, Sky) else np.eye(3)

    def _in_camera(self, hits: Hits, time: float) -> NDArray[np.float64]:
        """Return where the bodies' points are in the camera's axes, (N, 3)."""
        axes, eye = self.camera.pose(time)
        place = np.empty_like(hits.point)
        for number in np.unique(hits.body):
            mine = hits.body == number
            if number == _NOTHING:  # infinitely far: only rotations move it
                place[mine] = hits.point[mine] @ self._sky_axes(time).T
                continue
            rotation, position = self.bodies[number].pose(time)
            place[mine] = hits.point[mine] @ rotation.T + (position - eye)
        return place @ axes

    def project(self, hits: Hits, time: float) -> NDArray[np.float64]:
        """Return where points are seen, px from the middle; NaN behind the camera."""
        x, y, z = self._in_camera(hits, time).T
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(z > 0, self.camera.focal / z, np.nan)
        return np.stack([x * scale, y * scale], axis=1)

    def _brightness(
        self, time: float, pixels: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        origins, directions = self._rays(time, pixels)
        hits = self.cast(time, pixels)
        value = np.empty(len(pixels))
        footprint = 1 / (self.camera.focal * self.rays)  # at depth 1
        for number in np.unique(hits.body):
            mine = hits.body == number
            points, rays = hits.point[mine], directions[mine]
            if number == _NOTHING:
                extent = np.full(len(points), footprint)
                sky = self.sky
                shown = sky.at(time, points, extent) if isinstance(sky, Sky) else sky
                value[mine] = shown
                continue
            body, depth = self.bodies[number], hits.depth[mine]
            place, own_normal = body.solid.chart(points)
            normal = own_normal @ body.pose(time)[0].T
            slant = (normal * rays).sum(axis=1)
            normal = np.where(slant[:, None] > 0, -normal, normal)  # towards the eye
            if isinstance(body.surface, Surface):
                cosine = np.abs(slant) / np.linalg.norm(rays, axis=1)
                extent = depth * footprint / np.maximum(cosine, _LEAST_COSINE)
                shown = body.surface.at(place, extent)
            else:
                shown = np.full(len(points), body.surface)
            if self.light is not None:
                met = origins[mine] + depth[:, None] * rays
                met += (_LIFT * depth)[:, None] * normal
                shown = shown * self._light_at(time, met, normal)
            value[mine] = shown
        return value

    def _light_at(
        self, time: float, points: NDArray[np.float64], normals: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        light = self.light
        assert light is not None
        towards = -np.asarray(light.direction, dtype=np.float64)
        towards /= np.linalg.norm(towards)
        direct = np.maximum(normals @ towards, 0.0)
        lit = np.flatnonzero(direct > 0)
        rays = np.broadcast_to(towards, (len(lit), 3))
        blocked = self._nearest(time, points[lit], rays)[0] != _NOTHING
        direct[lit[blocked]] = 0.0
        return np.asarray(light.ambient + (1 - light.ambient) * direct)
