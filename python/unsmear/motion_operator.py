"""Motion blur as a linear operator, with its exact transpose."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_flow

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class MotionOperator:
    r"""Blur along the path of every pixel, without a matrix, and its transpose.

    For solvers of one's own: ``forward`` takes an unknown sharp picture that is larger
    than the data by ``pad`` pixels on every side, because what moved in from beyond
    the edge is unknown too; ``adjoint`` is its exact transpose.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        Velocity ``(u, v)`` at mid-exposure, px/frame, x to the right, y downwards. A
        pixel of unknown (NaN) motion copies itself: give its datum no weight.
    exposure : float, default 1.0
        Fraction of the frame interval the shutter is open, centred on the frame; > 0.
        The default is a shutter that never closes.
    acceleration : array_like of shape (H, W, 2), optional
        Change of velocity at a fixed pixel, px/frame^2. Default, and where it is NaN: a
        steady field.
    offset : array_like of shape (H, W, 2), optional
        Offset of each pixel's whole path, px, such as the registration to another
        frame; finite. Default: zero.
    taps : {"cubic", "linear"}, default "cubic"
        Interpolation. The cubic is far more accurate; the linear one has no negative
        weight, which methods of ratios (Richardson-Lucy) need.
    pad : int, optional
        Pixels of the unknown beyond the data. Default: the least for which every path
        stays inside; with fewer, paths read the edge.

    Attributes
    ----------
    data_shape : tuple of 2 int
        (H, W).
    unknown_shape : tuple of 2 int
        (H + 2 pad, W + 2 pad).
    shape : tuple of 2 int
        Of the matrix: number of data, number of unknowns.
    pad : int
        Data pixel (r, c) lies at (r + pad, c + pad) of the unknown.

    Raises
    ------
    ValueError
        If shapes do not match, ``exposure`` is not positive, ``taps`` is not one of the
        two, ``offset`` is not finite, ``pad`` is negative or motion exceeds 4096 px
        within the exposure.
    TypeError
        If an array is not of real numbers.

    Notes
    -----
    With :math:`V = e\,v` and :math:`q = e^2 [(v \cdot \nabla) v - a]`,

    .. math:: b(p) = \int_{-1/2}^{1/2} x(p + D(t))\,dt,
              \qquad D(t) = d - t V + \tfrac{t^2}{2} q.

    A constant stays constant, and where nothing moves the picture is copied bit for
    bit. Single precision; finite pictures. The same bytes for any number of threads.

    References
    ----------
    J. Bardsley, S. Jefferies, J. Nagy, R. Plemmons, Opt. Express 14 (2006) 1767-1782,
    doi:10.1364/OE.14.001767; R. G. Keys, IEEE Trans. ASSP 29 (1981) 1153-1160,
    doi:10.1109/TASSP.1981.1163711.

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> operator = unsmear.MotionOperator(np.full((5, 6, 2), (4.0, 0.0)))
    >>> x = np.ones(operator.unknown_shape)
    >>> operator.forward(x).round(3)[0]
    array([1., 1., 1., 1., 1., 1.], dtype=float32)
    >>> float(operator.adjoint(np.ones((5, 6))).sum().round(3))
    30.0
    """

    def __init__(
        self,
        flow: ArrayLike,
        *,
        exposure: float = 1.0,
        acceleration: ArrayLike | None = None,
        offset: ArrayLike | None = None,
        taps: Literal["cubic", "linear"] = "cubic",
        pad: int | None = None,
    ) -> None:
        if pad is not None and pad < 0:
            msg = f"pad must be an integer >= 0, got {pad}"
            raise ValueError(msg)
        self._core = _unsmear.MotionOperator(
            as_flow(flow),
            float(exposure),
            None if acceleration is None else as_flow(acceleration, "acceleration"),
            None if offset is None else as_flow(offset, "offset"),
            taps,
            pad,
        )
        self.data_shape = self._core.data_shape
        self.unknown_shape = self._core.unknown_shape
        self.pad = self._core.pad
        (height, width), (rows, columns) = self.data_shape, self.unknown_shape
        self.shape = (height * width, rows * columns)

    def forward(self, x: ArrayLike) -> NDArray[np.float32]:
        """Blur the unknown picture.

        Parameters
        ----------
        x : array_like of shape ``unknown_shape``
            Sharp picture, finite, in any unit.

        Returns
        -------
        ndarray of shape ``data_shape``, float32
            A x, in the same unit.

        Raises
        ------
        ValueError
            If the shape is another.

        Notes
        -----
        The mean of ``x`` along each pixel's path; see `MotionOperator`.

        References
        ----------
        See `MotionOperator`.

        Examples
        --------
        >>> import numpy as np, unsmear
        >>> operator = unsmear.MotionOperator(np.zeros((1, 3, 2)), pad=0)
        >>> operator.forward([[1.0, 2.0, 3.0]])
        array([[1., 2., 3.]], dtype=float32)
        """
        return self._core.forward(np.asarray(x, dtype=np.float32))

    def adjoint(self, b: ArrayLike) -> NDArray[np.float32]:
        """Spread data back over the unknown picture.

        Parameters
        ----------
        b : array_like of shape ``data_shape``
            Data or residuals, finite, in any unit.

        Returns
        -------
        ndarray of shape ``unknown_shape``, float32
            A^T b, in the same unit.

        Raises
        ------
        ValueError
            If the shape is another.

        Notes
        -----
        The transpose: the sum of ``forward(x) * b`` is that of ``x * adjoint(b)``.

        References
        ----------
        See `MotionOperator`.

        Examples
        --------
        >>> import numpy as np, unsmear
        >>> operator = unsmear.MotionOperator(np.zeros((1, 2, 2)), pad=1)
        >>> operator.adjoint([[5.0, 6.0]])[1]
        array([0., 5., 6., 0.], dtype=float32)
        """
        return self._core.adjoint(np.asarray(b, dtype=np.float32))
