"""How well a restored picture explains the blurred one: a judge that needs no truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import as_flow, as_picture_array, scale_of
from unsmear.blur import blur

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def reblur_error(
    blurred: ArrayLike,
    restored: ArrayLike,
    flow: ArrayLike,
    *,
    exposure: float = 1.0,
    channel_axis: int | None = None,
) -> float:
    """Return the root mean square of ``blur(restored, flow) - blurred``.

    Parameters
    ----------
    blurred, restored : array_like of one shape, (H, W) or colour with ``channel_axis``
        The picture as recorded and what was made of it, in the same units.
    flow : array_like of shape (H, W, 2)
        Velocity at mid-exposure, px/frame; NaN is unknown.
    exposure : float, default 1.0
        Fraction of the frame interval the shutter was open; > 0.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: the pictures are grey.

    Returns
    -------
    float
        In the units of the pictures. Only pixels count that are known in both and
        whose path stays inside the picture; NaN when there are none.

    Raises
    ------
    ValueError
        If shapes do not match or ``exposure`` is not positive.
    TypeError
        If an array is not of real numbers.

    Notes
    -----
    A right restoration comes down to the noise of the blurred picture. Below the noise
    it is overfitted; above, flow, exposure or restoration are wrong somewhere. What
    blur removes cannot be judged: ringing at the zeros of the blur does not show. The
    blur is that of `unsmear.blur`, which integrates along streamlines with splines and
    shares nothing with the operators of `unsmear.deblur`.

    References
    ----------
    V. A. Morozov, Soviet Math. Dokl. 7 (1966) 414-417, on the discrepancy as a judge.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> sharp = np.random.default_rng(0).random((48, 64))
    >>> flow = np.full((48, 64, 2), (5.0, 1.0))
    >>> blurred = unsmear.blur(sharp, flow)
    >>> wrong = unsmear.metrics.reblur_error(blurred, blurred, flow)
    >>> unsmear.metrics.reblur_error(blurred, sharp, flow) < 1e-3 * wrong
    True
    """
    scale = scale_of(np.asanyarray(blurred).dtype)
    pictures = [
        _floats(p, n) for p, n in ((blurred, "blurred"), (restored, "restored"))
    ]
    if pictures[0].shape != pictures[1].shape:
        msg = (
            f"restored must have shape {pictures[0].shape} like blurred, "
            f"got {pictures[1].shape}"
        )
        raise ValueError(msg)
    again = blur(pictures[1], flow, exposure=exposure, channel_axis=channel_axis)
    difference = again - pictures[0]
    if channel_axis is not None:
        difference = np.moveaxis(difference, channel_axis, -1)
    inside = _path_inside(exposure * as_flow(flow))
    squares = difference[inside] ** 2
    known = squares[np.isfinite(squares)]
    return scale * float(np.sqrt(known.mean())) if known.size else float("nan")


def _floats(picture: ArrayLike, argument: str) -> NDArray[np.float64]:
    array = as_picture_array(picture, argument)
    return array.astype(np.float64) / scale_of(array.dtype)


def _path_inside(motion: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the straight path of each pixel, px, stays inside; not where unknown."""
    height, width = motion.shape[:2]
    y, x = np.indices((height, width))
    half_u, half_v = np.abs(motion[..., 0]) / 2, np.abs(motion[..., 1]) / 2
    # Comparisons with NaN are false.
    return np.asarray(
        (x >= half_u)
        & (x <= width - 1 - half_u)
        & (y >= half_v)
        & (y <= height - 1 - half_v)
    )
