"""Sequences recorded from a scene: sharp frames, exposed frames, truth.

Frame t of T is centred at time ``t - (T - 1) / 2``, so the middle of the sequence shows
the scene as given. With exposure e, a blurred frame is the mean of ``n_subframes``
sharp pictures at the midpoints of equal parts of ``t - e/2 .. t + e/2``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from unsmear.synthetic.motion import Motion, rotating, shaking, translating, zooming
from unsmear.synthetic.scene import Layer, Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Sequence", "layers", "record", "rotation", "shake", "translation", "zoom"]

_GREY_LEVELS = 255.0
# Half step of the central difference for velocities, frames: error of order step^2.
_VELOCITY_STEP = 1e-4


class Recordable(Protocol):
    """What a scene must tell to be recorded: `Scene` and `World` do."""

    def render(self, time: float) -> NDArray[np.float64]:
        """Return the picture at ``time``, (H, W) or (H, W, C)."""

    def displacement(
        self, start: float, end: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the motion (H, W, 2) of what is seen, and whether it stays visible."""

    def velocity(self, time: float, step: float) -> NDArray[np.float64]:
        """Return the velocity (H, W, 2) by a central difference over ``2 step``."""


@dataclass(frozen=True)
class Sequence:
    """A recorded scene.

    Attributes
    ----------
    sharp, blurred : ndarray of shape (T, H, W) or (T, H, W, C)
        Float64 in the range of the textures ([0, 1] for integer ones), or uint8 when
        ``bits=8`` was asked for. With exposure 0 the blurred frames are the sharp ones
        plus noise.
    flow : ndarray of shape (T, H, W, 2), float32
        Exact motion from each frame's time to one frame later, px; NaN for what is
        behind the camera by then.
    velocity : ndarray of shape (T, H, W, 2), float32
        Exact velocity at the middle of each exposure, px/frame: what blurs.
    visible : ndarray of shape (T, H, W), bool
        Whether what a pixel shows is still seen, and in the picture, one frame later.
    exposure : float
        Share of the frame interval.
    """

    sharp: NDArray[Any]
    blurred: NDArray[Any]
    flow: NDArray[np.float32]
    velocity: NDArray[np.float32]
    visible: NDArray[np.bool_]
    exposure: float


def record(
    scene: Recordable,
    *,
    n_frames: int = 3,
    exposure: float = 0.0,
    n_subframes: int = 64,
    noise: float = 0.0,
    bits: int | None = None,
    seed: int = 0,
) -> Sequence:
    """Record a scene.

    Parameters
    ----------
    scene : Scene or World
        What is seen.
    n_frames : int, default 3
        T >= 1.
    exposure : float, default 0
        Share of the frame interval, in [0, 1]; more than 1 is no camera's, but allowed
        up to 10 to make harder cases.
    n_subframes : int, default 64
        Pictures averaged per blurred frame; at least one per px of blur is smooth.
    noise : float, default 0
        Standard deviation of white noise on the blurred frames, in grey levels of 255.
    bits : {None, 8}
        8 rounds and clips to uint8.
    seed : int, default 0
        Of the noise.

    Returns
    -------
    Sequence

    Raises
    ------
    ValueError
        A parameter out of range.
    """
    if n_frames < 1 or n_subframes < 1:
        msg = f"n_frames and n_subframes must be >= 1, got {n_frames} and {n_subframes}"
        raise ValueError(msg)
    if not 0 <= exposure <= 10:
        msg = f"exposure must be in [0, 10] frame intervals, got {exposure}"
        raise ValueError(msg)
    if not 0 <= noise < np.inf:
        msg = f"noise must be >= 0 grey levels, got {noise}"
        raise ValueError(msg)
    if bits not in (None, 8):
        msg = f"bits must be None or 8, got {bits}"
        raise ValueError(msg)
    rng = np.random.default_rng(seed)
    times = np.arange(n_frames) - (n_frames - 1) / 2
    offsets = ((np.arange(n_subframes) + 0.5) / n_subframes - 0.5) * exposure
    sharp = np.stack([scene.render(t) for t in times])
    blurred = sharp.copy()
    if exposure > 0:
        for frame, t in zip(blurred, times, strict=True):
            frame[...] = sum(scene.render(t + o) for o in offsets) / n_subframes
    if noise > 0:
        blurred += rng.normal(scale=noise / _GREY_LEVELS, size=blurred.shape)
    flow, visible = zip(*(scene.displacement(t, t + 1) for t in times), strict=True)
    velocity = [scene.velocity(t, _VELOCITY_STEP) for t in times]
    return Sequence(
        sharp=_quantised(sharp, bits),
        blurred=_quantised(blurred, bits),
        flow=np.stack(flow).astype(np.float32),
        velocity=np.stack(velocity).astype(np.float32),
        visible=np.stack(visible),
        exposure=float(exposure),
    )


def _quantised(frames: NDArray[np.float64], bits: int | None) -> NDArray[Any]:
    if bits is None:
        return frames
    return np.rint(np.clip(frames, 0, 1) * _GREY_LEVELS).astype(np.uint8)


def _moved(
    texture: ArrayLike, motion: Motion, shape: tuple[int, int], options: dict[str, Any]
) -> Sequence:
    return record(Scene((Layer(texture, motion),), shape), **options)


def translation(
    texture: ArrayLike,
    velocity: tuple[float, float],
    *,
    shape: tuple[int, int],
    acceleration: tuple[float, float] = (0.0, 0.0),
    **options: Any,
) -> Sequence:
    """Record a texture that moves by ``velocity`` (u, v) px/frame.

    ``shape`` (H, W) is the window; the texture should be larger by what moves in.
    ``acceleration`` is px/frame^2, ``options`` are those of `record`.
    """
    return _moved(texture, translating(velocity, acceleration), shape, options)


def rotation(
    texture: ArrayLike, degrees: float, *, shape: tuple[int, int], **options: Any
) -> Sequence:
    """Record a texture that turns by ``degrees`` per frame; see `translation`."""
    return _moved(texture, rotating(degrees), shape, options)


def zoom(
    texture: ArrayLike, rate: float, *, shape: tuple[int, int], **options: Any
) -> Sequence:
    """Record a texture that grows by ``exp(rate)`` per frame; see `translation`."""
    return _moved(texture, zooming(rate), shape, options)


def shake(
    texture: ArrayLike,
    amplitude: float,
    *,
    shape: tuple[int, int],
    period: float = 4.0,
    motion_seed: int = 0,
    **options: Any,
) -> Sequence:
    """Record a texture shaken by ``amplitude`` px (rms); see `translation`."""
    motion = shaking(amplitude, size=max(shape), period=period, seed=motion_seed)
    return _moved(texture, motion, shape, options)


def layers(
    background: ArrayLike,
    foreground: ArrayLike,
    opacity: ArrayLike,
    *,
    shape: tuple[int, int],
    background_motion: Motion,
    foreground_motion: Motion,
    **options: Any,
) -> Sequence:
    """Record an object (``foreground`` where ``opacity`` is 1) before a background."""
    scene = Scene(
        (
            Layer(background, background_motion),
            Layer(foreground, foreground_motion, opacity),
        ),
        shape,
    )
    return record(scene, **options)
