"""Point spread functions of motion: the exact sub-pixel path, and MATLAB's line.

The mathematics stands at the head of ``crates/unsmear/src/psf.rs``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from unsmear import _unsmear

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def motion_psf(
    u: float, v: float, *, acceleration: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.float64]:
    r"""Return the exact point spread function of a displacement.

    Parameters
    ----------
    u, v : float
        Displacement during the exposure, px; x to the right, y downwards.
    acceleration : tuple of 2 float, default (0, 0)
        Change of velocity ``(a_x, a_y)`` over the exposure, px per exposure squared:
        the point's velocity grows from ``V - A/2`` to ``V + A/2``.

    Returns
    -------
    ndarray of shape (odd, odd), float64
        Non-negative, sum 1, centre where the point is at mid-exposure. Without
        acceleration it is symmetric about the centre; with it the centroid is
        ``A / 24``. No motion gives ``[[1.0]]``.

    Raises
    ------
    ValueError
        If a value is not finite or exceeds 4096 px.

    Notes
    -----
    A point travels :math:`s(t) = t V + \frac{t^2}{2} A`, and the blurred picture is
    the convolution :math:`b(p) = \int_{-1/2}^{1/2} x(p - s(t))\,dt`, each instant
    spread bilinearly over four pixels:

    .. math:: w(y, x) = \int_{-1/2}^{1/2} L(x - s_x(t))\,L(y - s_y(t))\,dt,
              \qquad L(z) = \max(0, 1 - |z|).

    Straight paths are integrated in closed form; curved ones are chords within
    1e-4 px of the path.

    References
    ----------
    P. C. Hansen, J. G. Nagy, D. P. O'Leary, "Deblurring Images", SIAM 2006,
    doi:10.1137/1.9780898718874, section 3.2.

    Examples
    --------
    >>> import unsmear
    >>> unsmear.motion_psf(2, 0)
    array([[0.25, 0.5 , 0.25]])
    """
    a_x, a_y = acceleration
    return _unsmear.motion_psf((float(u), float(v)), (float(a_x), float(a_y)))


def fspecial_motion(length: float, angle: float) -> NDArray[np.float64]:
    """Return the kernel of MATLAB's ``fspecial('motion', length, angle)``.

    Kept for the founding method and for comparison with other programs; the weights
    are distances to a line, not times. Prefer `motion_psf`.

    Parameters
    ----------
    length : float
        Pixels, 0 to 4096; below 1 counts as 1.
    angle : float
        Degrees, counter-clockwise with y up; modulo 180.

    Returns
    -------
    ndarray of shape (odd, odd), float64
        Non-negative, sum 1, symmetric about its centre.

    Raises
    ------
    ValueError
        If ``length`` is out of range or ``angle`` is not finite.

    Notes
    -----
    A pixel at distance d from the segment of that length through the centre weighs
    max(0, 1 - d), divided by the sum.

    References
    ----------
    C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT MEng thesis,
    2007, chapter 4.

    Examples
    --------
    >>> import unsmear
    >>> unsmear.fspecial_motion(3, 0).round(3)
    array([[0.333, 0.333, 0.333]])
    """
    return _unsmear.fspecial_motion(float(length), float(angle))
