"""The forward operator: what a known motion does to a sharp picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from unsmear import _unsmear
from unsmear._channels import Channels
from unsmear._progress import of_steps

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress


def blur(
    image: ArrayLike,
    flow: ArrayLike,
    *,
    exposure: float = 1.0,
    channel_axis: int | None = None,
    progress: Progress | None = None,
) -> NDArray[Any]:
    r"""Blur a sharp picture by its motion.

    Parameters
    ----------
    image : array_like of shape (H, W), or colour with ``channel_axis``
        The picture at mid-exposure. Integers of any depth, or floats of any scale.
        NaN is unknown and makes unknown what its light reaches.
    flow : array_like of shape (H, W, 2)
        Velocity ``(u, v)`` at mid-exposure, px/frame, x to the right, y downwards.
        Pixels of unknown (NaN) motion are copied.
    exposure : float, default 1.0
        Fraction of the frame interval the shutter is open, centred on the frame; > 0.
        The default is a shutter that never closes, the most blur a film can show.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: the picture is grey.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.

    Returns
    -------
    ndarray
        Like ``image`` in shape, type and range; integers rounded and clipped.

    Raises
    ------
    ValueError
        If shapes do not match, ``exposure`` is not positive, the blur exceeds 4096 px,
        or unknown pixels would have to be stored as integers.
    TypeError
        If an array is not of real numbers.

    Notes
    -----
    Along the streamline :math:`X_p` of the flow through each pixel p,

    .. math:: b(p) = \frac1e \int_{-e/2}^{e/2} x(X_p(t))\,dt,
              \qquad \dot X_p = v(X_p), \quad X_p(0) = p,

    with cubic spline interpolation and Simpson's rule (two intervals per px at least).
    Beyond the picture its edge pixels continue.

    References
    ----------
    J. Bardsley, S. Jefferies, J. Nagy, R. Plemmons, Opt. Express 14 (2006) 1767-1782,
    doi:10.1364/OE.14.001767.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> edge = np.repeat([[0.0, 1.0]], 4, axis=0).repeat(4, axis=1)
    >>> flow = np.full((4, 8, 2), (4.0, 0.0))
    >>> unsmear.blur(edge, flow)[0].round(1) + 0.0
    array([0. , 0. , 0.1, 0.4, 0.6, 0.9, 1. , 1. ])
    """
    channels = Channels(image, channel_axis)
    function = _unsmear.blur_f32 if channels.array.itemsize == 4 else _unsmear.blur_f64
    blurred = function(
        channels.array, channels.flow(flow), float(exposure), of_steps(progress)
    )
    return channels.restore(blurred)
