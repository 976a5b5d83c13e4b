"""How far flow is from the truth and pictures from each other.

Maps have one value per pixel and are NaN wherever the estimate or the truth is unknown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_floating, as_flow, as_real_array
from unsmear.reblur import reblur_error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "angular_error",
    "direction_error",
    "endpoint_error",
    "flow_errors",
    "magnitude_error",
    "psnr",
    "reblur_error",
    "sparsification",
    "ssim",
]

_PERCENTILES = (50, 90, 95, 99)
# Fl of the KITTI benchmark (Menze & Geiger 2015, doi:10.1109/CVPR.2015.7298925): an
# outlier is off by more than 3 px and by more than 5 % of the true speed.
_OUTLIER_PIXELS, _OUTLIER_SHARE = 3.0, 0.05
_SSIM_WINDOW = 11  # px, Wang et al. 2004
_DENSITIES = (1.0, 0.9, 0.7, 0.5, 0.3)


def _map(name: str, flow: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    estimate, reference = as_flow(flow), as_flow(truth, "truth")
    if estimate.shape != reference.shape:
        msg = (
            f"truth must have the shape of flow {estimate.shape}, got {reference.shape}"
        )
        raise ValueError(msg)
    return _unsmear.error_map(
        name, estimate.astype(np.float64), reference.astype(np.float64)
    )


def angular_error(flow: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return the angle between ``(u, v, 1)`` and the truth's, degrees, (H, W).

    The 3-D angle of Barron, Fleet & Beauchemin (doi:10.1007/BF01420984), in [0, 180].

    Parameters
    ----------
    flow, truth : array_like of shape (H, W, 2)
        px/frame; NaN = unknown.

    Returns
    -------
    ndarray of shape (H, W), float64
        NaN where flow or truth is unknown.

    Raises
    ------
    ValueError
        Shapes that differ or are not (H, W, 2).
    """
    return _map("angular", flow, truth)


def direction_error(flow: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return the plain angle between ``(u, v)`` and the truth's, degrees, (H, W).

    In [0, 180]; NaN also where either vector is 0 and has no direction. Parameters,
    unknown pixels and errors as `angular_error`.
    """
    return _map("direction", flow, truth)


def endpoint_error(flow: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return ``hypot(u - u_true, v - v_true)``, px/frame, (H, W).

    Parameters, unknown pixels and errors as `angular_error`.
    """
    return _map("endpoint", flow, truth)


def magnitude_error(flow: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return the absolute difference of the speeds, px/frame, (H, W).

    Parameters, unknown pixels and errors as `angular_error`.
    """
    return _map("magnitude", flow, truth)


def flow_errors(
    flow: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None
) -> dict[str, Any]:
    """Summarise the errors of a flow field.

    Parameters
    ----------
    flow, truth : array_like of shape (H, W, 2)
        px/frame; NaN = unknown. Pixels of unknown truth do not count.
    mask : array_like of shape (H, W), optional
        Pixels that count: where it is not 0.

    Returns
    -------
    dict
        ``aae`` (mean 3-D angular error, degrees), ``direction`` (mean 2-D angle,
        degrees), ``epe`` and ``magnitude`` (means, px/frame), ``density`` (share of the
        counting pixels whose flow is known), ``pixels`` (number of counting pixels),
        ``percentiles`` of the endpoint error, px/frame, and ``outliers`` (Fl: share of
        known pixels off by more than 3 px and 5 %). Means are NaN when nothing is
        known.

    Raises
    ------
    ValueError
        Shapes that do not agree.
    """
    reference = as_flow(truth, "truth")
    counts = ~np.isnan(reference).any(axis=-1) & _as_mask(mask, reference.shape[:2])
    epe = endpoint_error(flow, truth)
    known = counts & ~np.isnan(epe)
    speed = np.hypot(reference[..., 0], reference[..., 1])
    outlier = (epe > _OUTLIER_PIXELS) & (epe > _OUTLIER_SHARE * speed)
    pixels = int(counts.sum())
    known_epe = epe[known]
    return {
        "aae": _mean(angular_error(flow, truth)[known]),
        "direction": _mean(direction_error(flow, truth)[known]),
        "epe": _mean(known_epe),
        "magnitude": _mean(magnitude_error(flow, truth)[known]),
        "density": float(known.sum() / pixels) if pixels else 0.0,
        "pixels": pixels,
        "percentiles": {
            str(p): float(np.percentile(known_epe, p)) if known_epe.size else np.nan
            for p in _PERCENTILES
        },
        "outliers": _mean(outlier[known].astype(np.float64)),
    }


def sparsification(
    flow: ArrayLike,
    confidence: ArrayLike,
    truth: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    densities: ArrayLike = _DENSITIES,
) -> dict[str, list[float]]:
    """Return the errors of the most confident pixels, per density.

    Parameters
    ----------
    flow, truth : array_like of shape (H, W, 2)
        px/frame; NaN = unknown.
    confidence : array_like of shape (H, W)
        Higher is better; ties keep the order of pixels.
    mask : array_like of shape (H, W), optional
        Pixels that count.
    densities : array_like, optional
        Shares of the counting pixels to keep, in (0, 1].

    Returns
    -------
    dict
        ``density`` (as reached: unknown flow cannot be kept), ``aae`` (degrees) and
        ``epe`` (px/frame), one value per density asked for.

    Raises
    ------
    ValueError
        Shapes that do not agree, or a density outside (0, 1].
    """
    reference = as_flow(truth, "truth")
    order_by = as_floating(confidence, "confidence", np.float64)
    if order_by.shape != reference.shape[:2]:
        msg = f"confidence must have shape {reference.shape[:2]}, got {order_by.shape}"
        raise ValueError(msg)
    counts = ~np.isnan(reference).any(axis=-1) & _as_mask(mask, reference.shape[:2])
    aae, epe = angular_error(flow, truth), endpoint_error(flow, truth)
    known = counts & ~np.isnan(epe)
    order = np.argsort(-order_by[known], kind="stable")
    aae, epe = aae[known][order], epe[known][order]
    result: dict[str, list[float]] = {"density": [], "aae": [], "epe": []}
    for density in np.asarray(densities, dtype=np.float64).ravel():
        if not 0 < density <= 1:
            msg = f"densities must be in (0, 1], got {density}"
            raise ValueError(msg)
        kept = min(round(density * counts.sum()), len(epe))
        result["density"].append(kept / counts.sum() if counts.any() else 0.0)
        result["aae"].append(_mean(aae[:kept]))
        result["epe"].append(_mean(epe[:kept]))
    return result


def psnr(
    image: ArrayLike, reference: ArrayLike, *, data_range: float | None = None
) -> float:
    """Return the peak signal-to-noise ratio in dB, ``10 log10(range^2 / mse)``.

    Parameters
    ----------
    image, reference : array_like of one shape, (H, W) or (H, W, C)
        Of one type, or floats.
    data_range : float, optional
        Distance from black to white; default the largest value of an integer type, 1
        for floats.

    Returns
    -------
    float
        Infinite for equal pictures; NaN when a pixel of either is NaN.

    Raises
    ------
    ValueError
        Shapes that differ or are empty, or a range that is not positive.
    """
    a, b, scale = _pair(image, reference, data_range)
    return _unsmear.psnr(a.reshape(a.shape[0], -1), b.reshape(b.shape[0], -1), scale)


def ssim(
    image: ArrayLike, reference: ArrayLike, *, data_range: float | None = None
) -> float:
    """Return the mean structural similarity, at most 1.

    Gaussian window of deviation 1.5 (11 x 11), K1 = .01, K2 = .03, as Wang et al. 2004
    (doi:10.1109/TIP.2003.819861); the mean over channels for (H, W, C). Parameters and
    errors as `psnr`, with at least 11 x 11 pixels.
    """
    a, b, scale = _pair(image, reference, data_range)
    if min(a.shape[:2]) < _SSIM_WINDOW:
        msg = (
            f"image must have shape (H >= {_SSIM_WINDOW}, W >= {_SSIM_WINDOW}) to hold "
            f"one window, got {a.shape}"
        )
        raise ValueError(msg)
    if a.ndim == 2:
        a, b = a[..., None], b[..., None]
    channels = range(a.shape[2])
    return float(
        np.mean(
            [
                _unsmear.ssim(
                    np.ascontiguousarray(a[..., c]),
                    np.ascontiguousarray(b[..., c]),
                    scale,
                )
                for c in channels
            ]
        )
    )


def _pair(
    image: ArrayLike, reference: ArrayLike, data_range: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    a, white = as_real_array(image, "image")
    b, white_of_reference = as_real_array(reference, "reference")
    if a.shape != b.shape or a.ndim not in (2, 3) or a.size == 0:
        msg = (
            "image and reference must have one shape (H, W) or (H, W, C), "
            f"got {a.shape} and {b.shape}"
        )
        raise ValueError(msg)
    if data_range is not None:
        return a.astype(np.float64), b.astype(np.float64), float(data_range)
    if white != white_of_reference:
        types = f"{np.asanyarray(image).dtype} and {np.asanyarray(reference).dtype}"
        msg = (
            "image and reference must be of one integer type or both floats unless "
            f"data_range is given, got {types}"
        )
        raise ValueError(msg)
    return a.astype(np.float64), b.astype(np.float64), white


def _as_mask(mask: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    if mask is None:
        return np.ones(shape, dtype=bool)
    array = np.asarray(mask)
    if array.shape != shape:
        msg = f"mask must have shape {shape}, got {array.shape}"
        raise ValueError(msg)
    return np.asarray(array != 0)


def _mean(values: NDArray[np.float64]) -> float:
    finite = values[~np.isnan(values)]
    return float(finite.mean()) if finite.size else float("nan")
