"""How long the shutter was open, read from the blur itself."""

from __future__ import annotations

import operator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_grey_frames, as_picture_array, as_real_array, scale_of
from unsmear._progress import of_steps

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress

__all__ = ["ExposureEstimate", "estimate_exposure"]

LIMITS_OF_IMAGE = (0.06, 2.5)
LIMITS_OF_CLIP = (0.06, 1.25)
LENGTHS_OF_TURN = (0.83, 1.2)
BLUR_OF_TURN = (2.4, 200.0)  # px: with a dark line; restored at all


@dataclass(frozen=True)
class ExposureEstimate:
    """An exposure and the trust in it.

    Attributes
    ----------
    value : float
        Share of the frame interval; what was found if ``status`` is "ok", else a
        cautious value, for blur taken too short does little harm.
    status : {"ok", "unsure", "small"}
        "unsure": parts of the picture or assumptions about it disagree, there are
        less than eight parts, or nothing could be measured; "small": because hardly
        anything moves by 3 px, so that no wave is missing and only how far they are
        dimmed tells, from .4 to .8.
    vote : float
        Share, in [0, 1], of those of ten assumptions on the scene's spectrum that
        explain it nearly as well as the best and agree with it; NaN without tiles.
    spread : float
        Deviation of the logarithm of the value over resampled tiles; NaN without.
    tiles : int
        Parts of the frames it rests on.
    likeliest : float
        The most likely value, trusted or not; NaN without tiles.
    noise : float
        Standard deviation of the noise used, in the units of the frames.
    turn : float
        Degrees, from right to down, by which ``flow`` had to be turned to run along
        the blur; ``value`` belongs to the turned flow. 0 unless one is clear.
    """

    value: float
    status: Literal["ok", "unsure", "small"]
    vote: float
    spread: float
    tiles: int
    likeliest: float
    noise: float
    turn: float = 0.0

    def report(self) -> dict[str, Any]:
        """Return the attributes as plain data; NaN becomes None."""
        return {
            name: None if isinstance(item, float) and np.isnan(item) else item
            for name, item in asdict(self).items()
        }


def estimate_exposure(
    frames: ArrayLike,
    flow: ArrayLike,
    *,
    acceleration: ArrayLike | None = None,
    noise: float | None = None,
    limits: tuple[float, float] | None = None,
    turn: bool | None = None,
    seed: int = 0,
    channel_axis: int | None = None,
    progress: Progress | None = None,
) -> ExposureEstimate:
    r"""Find the share of the frame interval during which light was gathered.

    The blur of a pixel is its velocity times this share. A common error in the length
    of the flow is taken up too: what is found is the blur.

    Parameters
    ----------
    frames : array_like of shape (H, W) or (N, H, W), or colour with ``channel_axis``
        One blurred picture, or several that share their exposure; NaN = unknown.
    flow : array_like of shape (H, W, 2) or (N, H, W, 2)
        Velocity ``(u, v)`` at mid-exposure of each, px/frame; NaN = unknown.
    acceleration : array_like like ``flow``, optional
        Change of the velocity at a fixed pixel, px/frame^2. Default: none.
    noise : float, optional
        Standard deviation of the noise, in the units of ``frames``; >= 0. Default:
        measured; never less than what rounding to 8 bits adds.
    limits : (float, float), optional
        Least and greatest exposure sought, > 0. Default: 0.06 to 1.25 for several
        frames, since a shutter closes before the next frame, with some error of the
        flow allowed; to 2.5 for one picture, whose flow may be in other units. A least
        one far from 0 makes a sharp picture find a blur that fits it by chance.
    turn : bool, optional
        Whether ``flow`` may run beside the blur, by one angle of up to 15 degrees for
        the whole picture, as when it was made with another axis. Default: for one
        picture, not for several frames, whose flow is measured in them.
    seed : int, default 0
        Of the random choice of tiles; the same seed gives the same result.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels, of which the luma is used. Default: grey.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.

    Returns
    -------
    ExposureEstimate

    Raises
    ------
    ValueError
        If shapes do not match, or a parameter is out of range.
    TypeError
        If an array is not of real numbers, or ``seed`` no integer.

    Notes
    -----
    Light that comes along :math:`D(t) = -t s v + t^2 s^2 q / 2` passes waves of
    frequency :math:`\omega` by :math:`K = \int \exp(i \omega \cdot D) dt`, with zeros
    that tell s. Over tiles with a periodogram P it minimises Whittle's

    .. math:: \sum \log S + P / S, \qquad S = c\, |\omega|^{-\alpha}
              e^{-\tau |\omega|^2} |K|^2 + m^2 \sigma^2,

    for the best of :math:`\alpha \in \{2.5, 3.5\}, \tau \in \{0, .2, .5\}, m \in \{1,
    1.5\}` in each tile, and the tile's own c in each of twelve sectors of directions.
    It needs blur between 2.4 and about 70 px (35 in pictures of less than 288 px),
    turns of up to 15 degrees, and pictures not sharpened after they were blurred.

    References
    ----------
    P. Whittle, J. R. Stat. Soc. B 15 (1953) 125-139,
    doi:10.1111/j.2517-6161.1953.tb00131.x.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> texture = unsmear.synthetic.texture((260, 260), seed=2)
    >>> clip = unsmear.synthetic.translation(
    ...     texture, (9.0, 4.0), shape=(200, 200), exposure=0.7, n_frames=1, noise=1)
    >>> found = unsmear.estimate_exposure(clip.blurred[0], clip.velocity[0])
    >>> found.status, round(found.value, 1)
    ('ok', 0.7)
    """
    grey, fields, bend = _prepared(frames, flow, acceleration, channel_axis)
    count = len(fields)
    if limits is None:
        limits = LIMITS_OF_IMAGE if count == 1 else LIMITS_OF_CLIP
    try:
        seed = operator.index(seed)
    except TypeError:
        msg = f"seed must be an integer, got {type(seed).__name__} {seed!r}"
        raise TypeError(msg) from None
    scale = scale_of(np.asanyarray(frames).dtype)
    found = _unsmear.estimate_exposure(
        grey,
        fields,
        bend,
        (float(limits[0]), float(limits[1])),
        None if noise is None else float(noise) / scale,
        seed % 2**64,
        turn=count == 1 if turn is None else bool(turn),
        progress=of_steps(progress),
    )
    found["noise"] *= scale
    return ExposureEstimate(**found)


def estimate_turn(
    image: ArrayLike,
    flow: ArrayLike,
    exposure: float,
    *,
    acceleration: ArrayLike | None = None,
    noise: float | None = None,
    channel_axis: int | None = None,
) -> float:
    """Return the degrees, from right to down, by which a picture's blur runs beside it.

    As `estimate_exposure` where the length of the blur is known but for a sixth.
    """
    grey, fields, bend = _prepared(image, flow, acceleration, channel_axis)
    blur = exposure * np.hypot(fields[..., 0], fields[..., 1])
    if not (blur > BLUR_OF_TURN[0]).any():
        return 0.0
    usable = (blur <= BLUR_OF_TURN[1])[..., np.newaxis]
    fields = np.where(usable, fields, np.float32(np.nan))
    limits = (LENGTHS_OF_TURN[0] * exposure, LENGTHS_OF_TURN[1] * exposure)
    scale = scale_of(np.asanyarray(image).dtype)
    deviation = None if noise is None else float(noise) / scale
    return _unsmear.estimate_turn(grey, fields, bend, limits, deviation, 0)


def _prepared(
    frames: ArrayLike,
    flow: ArrayLike,
    acceleration: ArrayLike | None,
    channel_axis: int | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32] | None]:
    """Return grey pictures (N, H, W), their velocities and accelerations."""
    fields = _fields(flow, "flow")
    count = 1 if np.ndim(flow) == 3 else len(fields)
    grey = _frames(frames, channel_axis, single=np.ndim(flow) == 3)
    expected = (count, *fields.shape[1:3])
    if grey.shape != expected or not grey.size:
        msg = f"frames must have shape {expected} like flow, got {grey.shape}"
        raise ValueError(msg)
    bend = None
    if acceleration is not None:
        bend = _fields(acceleration, "acceleration")
        if bend.shape != fields.shape:
            msg = (
                f"acceleration must have shape {fields.shape} like flow, "
                f"got {bend.shape}"
            )
            raise ValueError(msg)
    return grey, fields, bend


def _fields(field: ArrayLike, argument: str) -> NDArray[np.float32]:
    """Return one or several fields as packed (N, H, W, 2)."""
    array, _ = as_real_array(field, argument)
    if array.ndim == 3:
        array = array[np.newaxis]
    if array.ndim != 4 or array.shape[-1] != 2:
        msg = (
            f"{argument} must have shape (H, W, 2) or (N, H, W, 2), "
            f"got {np.shape(field)}"
        )
        raise ValueError(msg)
    return np.ascontiguousarray(array, dtype=np.float32)


def _frames(
    frames: ArrayLike, channel_axis: int | None, *, single: bool
) -> NDArray[np.float32]:
    """Return one or several pictures as grey (N, H, W)."""
    if not single:
        return as_grey_frames(frames, channel_axis, np.float32)
    array = as_picture_array(frames, "frames")
    if channel_axis is None and array.ndim != 2:
        msg = (
            "frames must have shape (H, W) for one flow field (or say which "
            f"channel_axis is colour), got {array.shape}"
        )
        raise ValueError(msg)
    axis = channel_axis
    if axis is not None:
        if not -array.ndim <= axis < array.ndim:
            msg = (
                f"channel_axis must name an axis of frames with shape {array.shape}, "
                f"got {axis}"
            )
            raise ValueError(msg)
        axis = axis % array.ndim + 1
    # Integers keep their type, by which they are scaled.
    return as_grey_frames(array[np.newaxis], axis, np.float32)
