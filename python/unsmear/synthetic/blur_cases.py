r"""Blurred pictures with known motion, to judge deblurring by.

Eleven motions, each over one exposure of one frame interval, applied to any picture:
translations of 3, 7, 11.3 and 21.7 px, a zoom, rotations by 5, 12 and 25 degrees, an
affine shake of 10 to 17 px, the same while speeding up from half to one and a half
times its speed, and two layers that move apart. A blurred picture is the mean of
sub-frames, each sampled by a spline of degree 5 from the whole picture, so what enters
the window from beyond is real.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from unsmear.synthetic.eight_bits import in_eight_bits
from unsmear.synthetic.motion import flowing, rotating, translating, zooming
from unsmear.synthetic.scene import Layer, Scene
from unsmear.synthetic.sequence import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear.synthetic.motion import Motion
    from unsmear.synthetic.sequence import Sequence

__all__ = ["BLUR_CASES", "BlurCase", "blur_case", "blur_clip"]

BLUR_CASES = {
    "T3": "translation by 3 px",
    "T7": "translation by 7 px",
    "T11": "translation by 11.3 px",
    "T22": "translation by 21.7 px",
    "Z": "zoom by a tenth, 17 px at the corners of 240 x 240 px",
    "R5": "rotation by 5 degrees",
    "R12": "rotation by 12 degrees",
    "R25": "rotation by 25 degrees",
    "SH": "affine shake, 10 to 17 px over 240 x 240 px",
    "SHa": "the same while its speed triples",
    "2L": "a disc moving 3.6 px before a background moving 13 px",
}
"""Name -> what moves."""

_LENGTHS = {"T3": 3.0, "T7": 7.0, "T11": 11.3, "T22": 21.7}  # px
_ANGLES = {"R5": 5.0, "R12": 12.0, "R25": 25.0}  # degrees
_ZOOM = 0.1  # per exposure
_SHAKE = 13.5  # px
_SHAKE_GRADIENT = ((0.010, -0.012), (0.016, -0.008))  # a turn, a stretch, a shear
_LAYERS = (13.0, 3.6)  # px, background and disc
_DISC = 0.28  # of the window's shorter side, radius
# Half step of second differences, frames: rounding and truncation are both below 1e-6.
_STEP = 1e-3


@dataclass(frozen=True)
class BlurCase:
    """A picture, blurred by a known motion over an exposure of one frame interval.

    Attributes
    ----------
    sharp, blurred : ndarray of shape (H, W) or (H, W, C), uint8
        At mid-exposure, and exposed, with noise.
    exposed : ndarray like ``blurred``, float64
        Before noise and rounding, in [0, 1]; see `with_noise`.
    velocity : ndarray of shape (H, W, 2), float32
        True (u, v) at mid-exposure, px/frame.
    acceleration : ndarray of shape (H, W, 2), float32
        Change of the velocity at a fixed pixel, px/frame^2.
    mixed : ndarray of shape (H, W), bool
        Where more than one layer was seen during the exposure.
    """

    sharp: NDArray[np.uint8]
    blurred: NDArray[np.uint8]
    exposed: NDArray[np.float64]
    velocity: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    mixed: NDArray[np.bool_]

    def with_noise(self, noise: float, seed: int = 0) -> BlurCase:
        """Return the case with other noise, deviation in grey levels, >= 0."""
        return replace(self, blurred=in_eight_bits(self.exposed, noise, seed))


def blur_case(
    name: str,
    picture: ArrayLike,
    *,
    shape: tuple[int, int],
    direction: float = 30.0,
    behind: ArrayLike | None = None,
    noise: float = 1.0,
    seed: int = 0,
    n_subframes: int = 96,
) -> BlurCase:
    """Blur a picture by one of the motions in ``BLUR_CASES``.

    Parameters
    ----------
    name : str
        A key of ``BLUR_CASES``.
    picture : array_like of shape (H, W) or (H, W, C)
        The content, seen through a window in its middle; it should be larger than
        ``shape`` by what moves in (mirrored beyond). Integers are scaled by their
        range, floats are in [0, 1].
    shape : (int, int)
        (H, W) of the window.
    direction : float, default 30
        Of translations and shakes, degrees from x (right) to y (down).
    behind : array_like like ``picture``, optional
        The background of "2L"; must be given there, and only there.
    noise : float, default 1.0
        Standard deviation, in grey levels of 255.
    seed : int, default 0
        Of the noise.
    n_subframes : int, default 96
        Pictures averaged, >= 1; at least one per px of blur is smooth.

    Returns
    -------
    BlurCase

    Raises
    ------
    ValueError
        An unknown name, a missing or needless ``behind``, or what `record` refuses.

    Examples
    --------
    >>> from unsmear import synthetic
    >>> picture = synthetic.texture((96, 96), seed=1)
    >>> case = synthetic.blur_case("R5", picture, shape=(64, 64), n_subframes=16)
    >>> case.blurred.dtype, case.velocity.shape
    (dtype('uint8'), (64, 64, 2))
    """
    scene = _scene(name, picture, shape, direction, behind)
    s = record(scene, n_frames=1, exposure=1.0, n_subframes=n_subframes)
    return BlurCase(
        sharp=in_eight_bits(s.sharp[0]),
        blurred=in_eight_bits(s.blurred[0]),
        exposed=s.blurred[0],
        velocity=s.velocity[0],
        acceleration=scene.acceleration(0.0, _STEP).astype(np.float32),
        mixed=_mixed(scene, n_subframes),
    ).with_noise(noise, seed)


def blur_clip(
    name: str,
    picture: ArrayLike,
    *,
    shape: tuple[int, int],
    direction: float = 30.0,
    behind: ArrayLike | None = None,
    n_frames: int = 5,
    exposure: float = 1.0,
    noise: float = 1.0,
    seed: int = 0,
    n_subframes: int = 96,
) -> Sequence:
    """Record a clip that moves on as one of the motions in ``BLUR_CASES``.

    Parameters
    ----------
    name : str
        A key of ``BLUR_CASES`` but "SHa", whose speed would turn round.
    picture, shape, direction, behind, noise, seed, n_subframes
        As for `blur_case`; the longer the clip the more moves in.
    n_frames : int, default 5
        T >= 1; the middle one shows what `blur_case` shows.
    exposure : float, default 1.0
        Share of the frame interval; lengths of blur are this share of those named.

    Returns
    -------
    Sequence
        8 bit.

    Raises
    ------
    ValueError
        As `blur_case`.
    """
    if name == "SHa":
        msg = "name must be that of a motion that can go on, got 'SHa'"
        raise ValueError(msg)
    return record(
        _scene(name, picture, shape, direction, behind),
        n_frames=n_frames,
        exposure=exposure,
        noise=noise,
        bits=8,
        seed=seed,
        n_subframes=n_subframes,
    )


def _scene(
    name: str,
    picture: ArrayLike,
    shape: tuple[int, int],
    direction: float,
    behind: ArrayLike | None,
) -> Scene:
    if name not in BLUR_CASES:
        known = ", ".join(repr(case) for case in BLUR_CASES)
        msg = f"name must be one of {known}, got {name!r}"
        raise ValueError(msg)
    if (behind is not None) != (name == "2L"):
        msg = f"behind must be given for case '2L' alone, got {name!r}"
        raise ValueError(msg)
    if behind is None:
        layers: tuple[Layer, ...] = (Layer(picture, _motion(name, direction)),)
    else:
        far, near = _LAYERS
        background = Layer(behind, translating(_vector(far, direction)))
        path = translating(_vector(near, direction - 120))
        front = Layer(picture, path)
        front.opacity = _disc(front.texture.shape[:2], _DISC * min(shape))
        layers = (background, front)
    return Scene(layers, shape)


def _vector(length: float, degrees: float) -> tuple[float, float]:
    angle = math.radians(degrees)
    return length * math.cos(angle), length * math.sin(angle)


def _motion(name: str, direction: float) -> Motion:
    if name in _LENGTHS:
        return translating(_vector(_LENGTHS[name], direction))
    if name in _ANGLES:
        return rotating(_ANGLES[name])
    if name == "Z":
        return zooming(_ZOOM)
    quickening = 1.0 if name == "SHa" else 0.0
    way = _vector(_SHAKE, direction)
    return flowing(way, _SHAKE_GRADIENT, quickening=quickening)


def _disc(shape: tuple[int, ...], radius: float) -> NDArray[np.float64]:
    """Return the opacity of a disc in the middle, its edge one pixel wide."""
    y, x = np.ogrid[: shape[0], : shape[1]]
    away = np.hypot(x - (shape[1] - 1) / 2, y - (shape[0] - 1) / 2)
    return np.clip(radius + 0.5 - away, 0.0, 1.0)


def _mixed(scene: Scene, n_times: int) -> NDArray[np.bool_]:
    """Return where the layer in front changes within the exposure."""
    if len(scene.layers) == 1:
        return np.zeros(scene.shape, dtype=np.bool_)
    points = scene.points()
    times = np.linspace(-0.5, 0.5, n_times)
    fronts = np.stack([scene.front(t, points) for t in times])
    return np.asarray((fronts != fronts[0]).any(axis=0))
