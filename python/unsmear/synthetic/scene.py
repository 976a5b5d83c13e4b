"""Scenes of moving layers, seen at any time.

A layer is a texture with an opacity and a motion; a scene is a list of layers from back
to front, seen through a window of ``shape`` px in the middle. Textures are sampled by
splines of degree 5 (mirrored beyond their edges), opacities linearly, so that they
neither ring nor leave [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_floating

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear.synthetic.motion import Motion

__all__ = ["Layer", "Scene"]

_TEXTURE_DEGREE = 5
_SOLID = 0.5  # opacity from which a layer owns a pixel's motion


class Layer:
    """A texture, its opacity and its motion.

    Parameters
    ----------
    texture : array_like of shape (H, W) or (H, W, C)
        Integers are scaled by their range. Its middle is the scene's origin.
    motion : Motion
        See `motion`.
    opacity : array_like of shape (H, W), optional
        Bool, or in [0, 1] (integers are scaled by their range); transparent beyond its
        edges. Default: opaque everywhere, the texture mirrored beyond its edges.
    """

    def __init__(
        self, texture: ArrayLike, motion: Motion, opacity: ArrayLike | None = None
    ) -> None:
        self.motion = motion
        self.texture = as_floating(texture, "texture", np.float64)
        if self.texture.ndim not in (2, 3) or self.texture.size == 0:
            msg = (
                f"texture must have shape (H, W) or (H, W, C), got {self.texture.shape}"
            )
            raise ValueError(msg)
        if not np.isfinite(self.texture).all():
            msg = "texture must be finite, got NaN or infinite pixels"
            raise ValueError(msg)
        self.opacity: NDArray[np.float64] | None = None
        if opacity is not None:
            mask = np.asarray(opacity)
            if mask.dtype == np.bool_:
                mask = mask.astype(np.float64)
            self.opacity = as_floating(mask, "opacity", np.float64)
            if self.opacity.shape != self.texture.shape[:2]:
                msg = (
                    f"opacity must have shape {self.texture.shape[:2]}, "
                    f"got {self.opacity.shape}"
                )
                raise ValueError(msg)
            if not ((self.opacity >= 0) & (self.opacity <= 1)).all():
                msg = (
                    "opacity must be in [0, 1], got values in "
                    f"[{self.opacity.min()}, {self.opacity.max()}]"
                )
                raise ValueError(msg)

    def at(
        self, time: float, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values (H, W[, C]) and opacities (H, W) at points (H, W, 2)."""
        scene = self.scene_points(time, points)
        height, width = self.texture.shape[:2]
        x = np.ascontiguousarray(scene[..., 0] + (width - 1) / 2)
        y = np.ascontiguousarray(scene[..., 1] + (height - 1) / 2)
        planes = self.texture[..., None] if self.texture.ndim == 2 else self.texture
        values = np.stack(
            [
                _unsmear.sample(
                    np.ascontiguousarray(planes[..., c]),
                    y,
                    x,
                    _TEXTURE_DEGREE,
                    "reflect",
                )
                for c in range(planes.shape[-1])
            ],
            axis=-1,
        )
        if self.opacity is None:
            opacity = np.ones(x.shape)
        else:
            framed = np.pad(self.opacity, 1)
            opacity = _unsmear.sample(framed, y + 1, x + 1, 1, "replicate")
        return values[..., 0] if self.texture.ndim == 2 else values, opacity

    def scene_points(
        self, time: float, points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the scene points shown at picture ``points`` (..., 2)."""
        matrix, offset = self.motion(time)
        return np.asarray((points - offset) @ np.linalg.inv(matrix).T)

    def displacement(
        self, points: NDArray[np.float64], start: float, end: float
    ) -> NDArray[np.float64]:
        """Return how far what is at ``points`` at ``start`` moves until ``end``, px."""
        matrix, offset = self.motion(end)
        return np.asarray(self.scene_points(start, points) @ matrix.T + offset - points)


@dataclass(frozen=True)
class Scene:
    """Layers from back to front, seen through a window of ``shape`` (H, W)."""

    layers: tuple[Layer, ...]
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        if not self.layers:
            msg = "layers must hold at least one layer, got none"
            raise ValueError(msg)
        channels = {layer.texture.shape[2:] for layer in self.layers}
        if len(channels) > 1:
            shapes = [layer.texture.shape for layer in self.layers]
            msg = f"layers must agree in their channels, got textures {shapes}"
            raise ValueError(msg)
        if len(self.shape) != 2 or min(self.shape) < 1:
            msg = f"shape must be (H >= 1, W >= 1), got {tuple(self.shape)}"
            raise ValueError(msg)

    def points(self) -> NDArray[np.float64]:
        """Return (x, y) of every pixel, px from the middle, (H, W, 2)."""
        height, width = self.shape
        y, x = np.mgrid[:height, :width].astype(np.float64)
        return np.stack([x - (width - 1) / 2, y - (height - 1) / 2], axis=-1)

    def render(self, time: float) -> NDArray[np.float64]:
        """Return the picture at ``time``, (H, W) or (H, W, C)."""
        points = self.points()
        back, *others = self.layers
        picture = back.at(time, points)[0]  # whatever its opacity: nothing is behind
        for layer in others:
            values, opacity = layer.at(time, points)
            share = opacity[..., None] if values.ndim == 3 else opacity
            picture = picture + share * (values - picture)
        return picture

    def front(self, time: float, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return which layer is in front at picture ``points``, (H, W)."""
        front = np.zeros(points.shape[:2], dtype=np.intp)
        for number, layer in enumerate(self.layers[1:], start=1):
            front[layer.at(time, points)[1] >= _SOLID] = number
        return front

    def displacement(
        self, start: float, end: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the motion (H, W, 2) of what is seen, and whether it stays visible."""
        points = self.points()
        front = self.front(start, points)
        moved = np.zeros_like(points)
        for number, layer in enumerate(self.layers):
            own = front == number
            moved[own] = layer.displacement(points, start, end)[own]
        landed = points + moved
        limit = np.array(self.shape[::-1]) / 2.0
        inside = np.asarray((np.abs(landed) <= limit).all(axis=-1))
        return moved, inside & (self.front(end, landed) == front)

    def velocity(self, time: float, step: float) -> NDArray[np.float64]:
        """Return the central difference of positions over ``2 step``, (H, W, 2)."""
        ahead, _ = self.displacement(time, time + step)
        back, _ = self.displacement(time, time - step)
        return (ahead - back) / (2 * step)

    def acceleration(self, time: float, step: float) -> NDArray[np.float64]:
        """Return how the velocity at each pixel changes, (H, W, 2), px/frame^2.

        At a fixed place, not along the motion, of the layer that is in front at
        ``time``; central differences over ``2 step``.
        """
        points = self.points()
        front = self.front(time, points)
        change = np.zeros_like(points)

        for number, layer in enumerate(self.layers):
            earlier, later = (
                layer.displacement(points, t, t + step)
                - layer.displacement(points, t, t - step)
                for t in (time - step, time + step)
            )
            own = front == number
            change[own] = ((later - earlier) / (2 * step) ** 2)[own]
        return change
