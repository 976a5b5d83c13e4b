"""One large picture, tile by tile, each with the halo that makes it exact (`halos`).

The other methods of `unsmear.deblur` are not local: Richardson-Lucy stops by the
residual of the whole picture, total variation and Tikhonov solve by conjugate
gradients, whose scalar products are sums over it, and all measure their grey levels
on it. Component velocities are compared with the largest amplitude of the whole
picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import dask.array as da
import numpy as np
from dask import delayed
from dask.base import tokenize

from unsmear import _unsmear
from unsmear.blur import blur as blur_whole
from unsmear.dask.cores import share_cores
from unsmear.dask.halos import blur_halo, wiener_halo
from unsmear.dask.parts import as_lazy, block, channels_last, clipped, ranges_of
from unsmear.deblur import deblur as deblur_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Range = tuple[int, int]

__all__ = ["blur", "wiener"]


def blur(
    image: Any,
    flow: Any,
    *,
    exposure: float = 1.0,
    longest: float | None = None,
    channel_axis: int | None = None,
) -> Any:
    """Blur a large sharp picture by its motion, tile by tile.

    Parameters
    ----------
    image : dask array of shape (H, W), or colour with ``channel_axis``
        Its chunks are the tiles.
    flow : dask array or array_like of shape (H, W, 2)
        Velocity at mid-exposure, px/frame; NaN = unknown, copied.
    exposure : float, default 1.0
        Fraction of the frame interval the shutter is open; > 0.
    longest : float, optional
        Longest blur, exposure times speed, px: it decides the halo. Default: that of
        ``flow`` if it is in memory; needed if not. A longer one in a tile is an error
        when that is computed.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: grey.

    Returns
    -------
    dask array
        `unsmear.blur` of the whole, bit for bit; like ``image`` in shape, type and
        tiles.

    Raises
    ------
    TypeError
        If ``image`` is no dask array of real numbers.
    ValueError
        If shapes do not match, a parameter is out of range, or ``longest`` is needed.

    Notes
    -----
    How well a restoration explains a blurred picture is a difference of two such
    arrays: ``unsmear.dask.blur(restored, flow, ...) - blurred``.

    References
    ----------
    See `unsmear.blur`.

    Examples
    --------
    >>> import dask.array as da, numpy as np, unsmear, unsmear.dask
    >>> sharp = unsmear.synthetic.texture((90, 70), seed=1)
    >>> flow = np.full((90, 70, 2), (4.0, 2.0))
    >>> lazy = unsmear.dask.blur(da.from_array(sharp, chunks=32), flow)
    >>> bool((lazy.compute() == unsmear.blur(sharp, flow)).all())
    True
    """
    _positive("exposure", exposure)
    most = _longest(flow, exposure, longest)
    options = {"exposure": float(exposure)}
    return _tiled(
        blurred_tile, image, flow, blur_halo(most), most, options, channel_axis
    )


def wiener(
    image: Any,
    flow: Any,
    *,
    exposure: float = 1.0,
    noise: float | None = None,
    regularization: float | None = None,
    longest: float | None = None,
    channel_axis: int | None = None,
) -> Any:
    """Remove known motion blur from a large picture, tile by tile.

    Parameters
    ----------
    image, flow, exposure, longest, channel_axis
        As for `unsmear.dask.blur`.
    noise : float, optional
        Standard deviation of the noise in the units of ``image``. In memory it is
        measured in the whole picture; here it must be given, unless
        ``regularization`` is: `unsmear.noise.estimate_noise` finds it in a part.
    regularization : float, optional
        As for `unsmear.deblur`.

    Returns
    -------
    dask array
        The picture of ``unsmear.deblur(method="wiener", turn=0)`` of the whole, bit
        for bit (a tile alone cannot tell the whole picture's direction); like
        ``image`` in shape, type and tiles.

    Raises
    ------
    TypeError
        If ``image`` is no dask array of real numbers.
    ValueError
        As `unsmear.dask.blur`, or if neither ``noise`` nor ``regularization`` is given.

    Notes
    -----
    The halo is that of the worst field of motion whose blur is nowhere longer than
    ``longest``: 85 px for 10 px. Tiles of 1000 px and more waste little.

    References
    ----------
    See `unsmear.deblur`.

    Examples
    --------
    >>> import dask.array as da, numpy as np, unsmear, unsmear.dask
    >>> flow = np.full((120, 90, 2), (4.0, 2.0))
    >>> blurred = unsmear.blur(unsmear.synthetic.texture((120, 90), seed=1), flow)
    >>> lazy = unsmear.dask.wiener(da.from_array(blurred, chunks=64), flow, noise=0.5)
    >>> told = {"method": "wiener", "noise": 0.5, "turn": 0}
    >>> whole = unsmear.deblur(blurred, flow, **told).image
    >>> bool((lazy.compute() == whole).all())
    True
    """
    _positive("exposure", exposure)
    if noise is None and regularization is None:
        raise ValueError(
            "noise must be given (it would be measured in the whole picture), or "
            "regularization; got neither"
        )
    most = _longest(flow, exposure, longest)
    options = {
        "exposure": float(exposure),
        "noise": noise,
        "regularization": regularization,
        "turn": 0.0,
    }
    halo = wiener_halo(most, float(exposure))
    return _tiled(restored_tile, image, flow, halo, most, options, channel_axis)


def _positive(argument: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{argument} must be finite and positive, got {value}")


def _longest(flow: Any, exposure: float, longest: float | None) -> float:
    if longest is not None:
        _positive("longest", longest)
        return float(longest)
    if isinstance(flow, da.Array):
        raise ValueError(
            "longest must be given for a flow that is not in memory: the longest blur, "
            "px, which decides how much of its surroundings a tile needs"
        )
    return blur_length(flow, exposure)


def blur_length(flow: ArrayLike, exposure: float) -> float:
    """Return the longest blur of a field, px; 0 where nothing is known."""
    speed = np.linalg.norm(np.asarray(flow, np.float64), axis=-1)
    return exposure * float(np.fmax.reduce(speed, axis=None, initial=0.0))


def _tiled(
    function: Callable[..., NDArray[Any]],
    image: Any,
    flow: Any,
    halo: int,
    longest: float,
    options: dict[str, Any],
    channel_axis: int | None,
) -> Any:
    """Return ``function`` of every tile and its halo, cut to the tile."""
    if channel_axis is None:
        shape = "(H, W) (or say which channel_axis is colour)"
        picture = as_lazy(image, "image", (2,), shape)
    else:
        picture = as_lazy(image, "image", (3,), "(H, W, C) in any order of axes")
        picture = channels_last(picture, channel_axis, "image")
    height, width = picture.shape[:2]
    field = flow
    if not isinstance(flow, da.Array):
        chunks = (*picture.chunks[:2], -1)
        field = np.asarray(flow)
        if field.shape == (height, width, 2):
            field = da.from_array(field, chunks=chunks)
    if field.shape != (height, width, 2):
        expected = f"({height}, {width}, 2) like image"
        raise ValueError(f"flow must have shape {expected}, got {field.shape}")
    version = _unsmear.__version__
    token = tokenize(function, picture.name, field.name, options, longest, version)
    dtype = picture.dtype.newbyteorder("=")
    rows = []
    for down in ranges_of(picture.chunks[0]):
        row = []
        for across in ranges_of(picture.chunks[1]):
            seen = (
                clipped(down, halo, halo, height),
                clipped(across, halo, halo, width),
            )
            inner = tuple(
                (start - first, stop - first)
                for (start, stop), (first, _) in zip((down, across), seen, strict=True)
            )
            tile = delayed(function, pure=True)(
                block(picture, *seen),
                block(field, *seen),
                inner,
                longest,
                options,
                dask_key_name=f"tile-{token}-{down[0]}-{across[0]}",
            )
            size = (down[1] - down[0], across[1] - across[0], *picture.shape[2:])
            row.append(da.from_delayed(tile, size, dtype, name=f"part-{tile.key}"))
        rows.append(da.concatenate(row, axis=1))
    whole = da.concatenate(rows, axis=0)
    return whole if channel_axis is None else da.moveaxis(whole, -1, channel_axis)


def blurred_tile(
    image: NDArray[Any],
    flow: NDArray[Any],
    inner: tuple[Range, Range],
    longest: float,
    options: dict[str, Any],
) -> NDArray[Any]:
    """Return the blurred tile without its halo."""
    _check(flow, longest, options["exposure"])
    axis = 2 if image.ndim == 3 else None
    return _cut(blur_whole(image, flow, channel_axis=axis, **options), inner)


def restored_tile(
    image: NDArray[Any],
    flow: NDArray[Any],
    inner: tuple[Range, Range],
    longest: float,
    options: dict[str, Any],
) -> NDArray[Any]:
    """Return the restored tile without its halo."""
    _check(flow, longest, options["exposure"])
    axis = 2 if image.ndim == 3 else None
    result = deblur_whole(image, flow, method="wiener", channel_axis=axis, **options)
    return _cut(result.image, inner)


def _check(flow: NDArray[Any], longest: float, exposure: float) -> None:
    share_cores()
    found = blur_length(flow, exposure)
    if found > longest:
        raise ValueError(
            f"longest must be at least the longest blur, {found:.6g} px in a tile, "
            f"got {longest:.6g}"
        )


def _cut(picture: NDArray[Any], inner: tuple[Range, Range]) -> NDArray[Any]:
    """Return a copy of a part, so that the halo's memory is freed."""
    return picture[tuple(slice(*one) for one in inner)].copy()
