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

Labelled arrays of xarray pass as they are wherever arrays do, taken in the order of
their axes; `from_xarray` puts named axes in order, `to_xarray` names those of a flow.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import as_flow, as_real_array

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "from_opencv",
    "from_skimage",
    "from_xarray",
    "to_opencv",
    "to_skimage",
    "to_xarray",
]

_AXES = {"t": 0, "y": 1, "x": 2, "c": 3, "component": 3}  # name: place
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


def to_xarray(flow: ArrayLike, like: xarray.DataArray | None = None) -> Any:
    """Return the flow as a labelled array of xarray.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2) or (T, H, W, 2)
        (u, v), px/frame; NaN = unknown. Several fields as in
        ``deblur_sequence(frames).flows``.
    like : xarray.DataArray, optional
        The frames the flow was measured on, axes named as in `from_xarray`: what
        labels their axes t (of as many fields), y and x labels those of the flow.

    Returns
    -------
    xarray.DataArray
        Axes ([t,] y, x, component), float32, a copy; ``component`` is labelled "u" (to
        the right) and "v" (down), the attribute ``units`` is "px/frame". Values stay
        in px even where ``like`` labels pixels otherwise.

    Raises
    ------
    ImportError
        If xarray is not installed.
    ValueError
        If the shape is another, or ``like`` has other numbers of pixels.
    TypeError
        If the values are not real numbers.

    Examples
    --------
    Restored frames get the labels of the given ones by xarray's own means::

        frames = xarray.open_dataarray("clip.nc").transpose("t", "y", "x")
        made = unsmear.deblur_sequence(frames)
        restored = frames.copy(data=made.frames)
        flows = unsmear.convert.to_xarray(made.flows, like=frames)
    """
    try:
        import xarray
    except ImportError as error:
        msg = "convert.to_xarray needs xarray: pip install xarray"
        raise ImportError(msg) from error
    field, _ = as_real_array(flow, "flow")
    if field.ndim not in (3, 4) or field.shape[-1] != 2:
        msg = f"flow must have shape (H, W, 2) or (T, H, W, 2), got {field.shape}"
        raise ValueError(msg)
    axes = ("t", "y", "x")[4 - field.ndim :]
    labels: dict[str, Any] = {"component": ["u", "v"]}
    for axis, size in zip(axes, field.shape, strict=False):
        if like is None or axis not in like.dims:
            continue
        if like.sizes[axis] != size:
            msg = f"like must have {size} along {axis}, got {like.sizes[axis]}"
            raise ValueError(msg)
        if axis in like.coords:
            labels[axis] = like.coords[axis]
    return xarray.DataArray(
        np.array(field, np.float32),
        dims=(*axes, "component"),
        coords=labels,
        name="flow",
        attrs={"units": "px/frame"},
    )


def from_xarray(array: xarray.DataArray) -> NDArray[Any]:
    """Return frames, a picture or a flow with axes in the order used here.

    Parameters
    ----------
    array : xarray.DataArray
        Axes named t (frames), y (rows), x (columns), c (channels) or component (of a
        flow: "u", "v"), in any order; y and x must be there. Others are to be renamed:
        ``array.rename(time="t")``.

    Returns
    -------
    ndarray of shape ([T,] H, W[, C])
        A view where the order is this already; samples are as they came.

    Raises
    ------
    TypeError
        If ``array`` has no named axes.
    ValueError
        If axes have other names, or y or x is missing.
    """
    names = getattr(array, "dims", None)
    if names is None:
        msg = f"array must be an xarray.DataArray, got {type(array).__name__}"
        raise TypeError(msg)
    places = [_AXES.get(name) for name in names]
    if None in places or len({*places}) < len(places) or not {1, 2} <= {*places}:
        expected = "y, x and at most t and one of c, component"
        msg = f"array must have axes named {expected}, got {', '.join(map(str, names))}"
        raise ValueError(msg)
    return np.asarray(array.transpose(*sorted(names, key=_AXES.__getitem__)))
