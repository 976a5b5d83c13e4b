r"""Flow fields in the conventions of scikit-image and OpenCV, there and back.

Here a flow field is ``f`` of shape (H, W, 2), ``f[y, x] = (u, v)``: u along columns, to
the right, and v along rows, down, px/frame, float32, NaN = unknown.

=============  ===========  ==========  =============================================
library        shape        order       unknown
=============  ===========  ==========  =============================================
scikit-image   (2, H, W)    (v, u)      has no sign for it; NaN passes through
OpenCV         (H, W, 2)    (u, v)      of no function; its files: beyond 1e9
=============  ===========  ==========  =============================================

In all three the flow leads from a pixel of the reference frame to the place in the next
frame that shows the same thing, so no sign changes: what
``skimage.registration.optical_flow_ilk(reference, moving)`` and
``cv2.calcOpticalFlowFarneback(reference, moving, ...)`` return is what
`unsmear.optical_flow` returns for ``[reference, moving]``. Round trips are
exact, bit for bit, NaN included.

Pictures differ too: scikit-image has R, G, B on the last axis, as here; OpenCV reads
and writes B, G, R, so ``picture[..., ::-1]`` goes either way.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear._arrays import as_flow, as_real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["from_opencv", "from_skimage", "to_opencv", "to_skimage"]

_OPENCV_UNKNOWN = 1e9  # its reader and writer of .flo take larger values for unknown


def to_skimage(flow: ArrayLike) -> NDArray[np.float32]:
    """Return the flow as scikit-image has it.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v), px/frame; NaN = unknown.

    Returns
    -------
    ndarray of shape (2, H, W), float32
        (v, u): displacement along rows, then along columns. NaN stays NaN;
        ``skimage.transform.warp`` shows such pixels as its ``cval``.

    Raises
    ------
    ValueError
        If the shape is not (H, W, 2).
    TypeError
        If the values are not real numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from unsmear import convert
    >>> convert.to_skimage(np.full((3, 4, 2), (2.0, -1.0)))[:, 0, 0].tolist()
    [-1.0, 2.0]
    """
    field = as_flow(flow)
    return np.ascontiguousarray(np.moveaxis(field[..., ::-1], -1, 0))


def from_skimage(flow: ArrayLike) -> NDArray[np.float32]:
    """Return a flow of scikit-image as unsmear has it.

    Parameters
    ----------
    flow : array_like of shape (2, H, W)
        (v, u), as ``skimage.registration`` returns it for a pair of pictures.

    Returns
    -------
    ndarray of shape (H, W, 2), float32
        (u, v), px/frame.

    Raises
    ------
    ValueError
        If the shape is not (2, H, W).
    TypeError
        If the values are not real numbers.
    """
    field, _ = as_real_array(flow, "flow")
    if field.ndim != 3 or field.shape[0] != 2:
        msg = f"flow must have shape (2, H, W), got {field.shape}"
        raise ValueError(msg)
    return np.ascontiguousarray(np.moveaxis(field[::-1], 0, -1), dtype=np.float32)


def to_opencv(flow: ArrayLike, *, unknown: float = math.nan) -> NDArray[np.float32]:
    """Return the flow as OpenCV has it.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v), px/frame; NaN = unknown.
    unknown : float, default NaN
        What both components of unknown pixels become. OpenCV's functions do not know
        NaN: give 0 for them, and 1e10 for its writers of files.

    Returns
    -------
    ndarray of shape (H, W, 2), float32
        Packed, a copy.

    Raises
    ------
    ValueError
        If the shape is not (H, W, 2).
    TypeError
        If the values are not real numbers.
    """
    field = np.array(as_flow(flow), order="C", copy=True)
    if not math.isnan(unknown):
        field[np.isnan(field).any(axis=-1)] = unknown
    return field


def from_opencv(flow: ArrayLike) -> NDArray[np.float32]:
    """Return a flow of OpenCV as unsmear has it.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v), as ``cv2.calcOpticalFlow...`` and ``cv2.readOpticalFlow`` return it.

    Returns
    -------
    ndarray of shape (H, W, 2), float32
        A copy; NaN where a component is beyond 1e9 in size, which is OpenCV's sign for
        unknown.

    Raises
    ------
    ValueError
        If the shape is not (H, W, 2).
    TypeError
        If the values are not real numbers.
    """
    field = np.array(as_flow(flow), order="C", copy=True)
    field[(np.abs(field) > _OPENCV_UNKNOWN).any(axis=-1)] = np.nan
    return field
