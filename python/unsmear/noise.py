"""Noise of a picture blurred by known motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear._channels import Channels
from unsmear._deblur_methods import noise_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["estimate_noise"]


def estimate_noise(
    image: ArrayLike,
    flow: ArrayLike,
    *,
    exposure: float = 1.0,
    channel_axis: int | None = None,
) -> float:
    r"""Measure the standard deviation of white noise where motion leaves no texture.

    Parameters
    ----------
    image : array_like of shape (H, W), or colour with ``channel_axis``
        The blurred picture; NaN is unknown.
    flow : array_like of shape (H, W, 2)
        Velocity at mid-exposure, px/frame; NaN is unknown.
    exposure : float, default 1.0
        Fraction of the frame interval the shutter was open; > 0.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: the picture is grey.

    Returns
    -------
    float
        In the units of ``image``; the root mean square over channels. 0 when no tile
        of 32 x 32 known pixels exists.

    Raises
    ------
    ValueError
        If shapes do not match or ``exposure`` is not positive.
    TypeError
        If an array is not of real numbers.

    Notes
    -----
    A motion of more than 3.5 px attenuates a picture's spectrum at frequencies above
    1.8 rad/px along it, while noise stays. Over 32 x 32 tiles under a Hann window,

    .. math:: n = \langle |F(\omega)|^2 \rangle / 32^2, \qquad
              |\omega \cdot d| > 1.8, \; |\omega| < 3.6,

    d the tile's direction of motion (:math:`|\omega| > 2.2` where it moves less than
    1 px); the result is the root of the 20 % quantile of n. Texture that fills the
    band everywhere is taken for noise.

    References
    ----------
    S. Pyatykh, J. Hesser, L. Zheng, IEEE Trans. Image Process. 22 (2013) 687-699,
    doi:10.1109/TIP.2012.2221728, on taking the noise from the weakest components.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> noise = 3 * np.random.default_rng(0).standard_normal((128, 128))
    >>> flow = np.full((128, 128, 2), (8.0, 2.0))
    >>> bool(2.5 < unsmear.noise.estimate_noise(noise, flow) < 3.3)
    True
    """
    if not (np.isfinite(exposure) and exposure > 0):
        raise ValueError(f"exposure must be finite and positive, got {exposure}")
    channels = Channels(image, channel_axis)
    return channels.scale * noise_of(channels, channels.flow(flow), float(exposure))
