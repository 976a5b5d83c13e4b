"""Flow fields as pictures: colour coding, legend, arrows, panels side by side.

Colour coding (Baker et al. 2011). Direction becomes hue on a wheel of six segments,
red-yellow 15 steps, yellow-green 6, green-cyan 4, cyan-blue 11, blue-magenta 13,
magenta-red 6; 55 colours, finer where the eye tells hues apart better. With the
angle a = atan2(-v, -u) / pi in [-1, 1] and y down, the place on the wheel is
k = (a + 1) / 2 * 55, interpolated linearly between neighbours. With the relative
speed r = |(u, v)| / max_flow, the colour is 1 - r (1 - wheel(k)): white at rest, full
at max_flow. Faster pixels keep the full colour. Unknown pixels (NaN) are black, which
the coding itself never produces.

The authors' program has 54 in place of 55: there the last colour and the first meet at
one angle, and motion to the right flickers between two hues with the sign of v. Here
the wheel closes; hues differ from theirs by at most one of the 55 steps.

`legend` draws the wheel. All functions return (H, W, 3) uint8 arrays; speeds are in
px/frame.

Reference
---------
S. Baker et al., "A database and evaluation methodology for optical flow", Int. J.
Comput. Vis. 92 (2011) 1-31, doi:10.1007/s11263-010-0390-2.
"""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._arrays import as_picture_array
from unsmear._colour_wheel import colour_wheel
from unsmear._drawing import WHITE, as_display, draw_arrows, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Picture = NDArray[np.uint8]

__all__ = ["arrows", "flow_figure", "flow_to_color", "legend", "side_by_side"]

_ROBUST_PERCENTILE = 99  # a few wild pixels shall not turn the rest white
_INK = 40  # grey level of rim and cross
_SMALLEST_LEGEND, _LARGEST_LEGEND = 112, 220  # px; below, text is hard to read
_GAP, _LABEL_ROWS = 8, 22  # px between panels, px of a label's strip
_CELLS, _LEAST_STEP = 30, 15  # arrows along the longer side; px


def flow_to_color(flow: ArrayLike, *, max_flow: float | None = None) -> Picture:
    """Colour-code a flow field.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v) in px/frame, u right, v down; NaN = unknown.
    max_flow : float, optional
        Speed in px/frame shown in full colour. By default the 99th percentile of the
        known speeds, so that single wild pixels do not wash out the rest.

    Returns
    -------
    ndarray of shape (H, W, 3), uint8
        White = at rest, black = unknown, hue = direction, saturation = speed.

    Raises
    ------
    ValueError
        If the shape is wrong or ``max_flow`` is not a positive finite number.
    TypeError
        If ``flow`` does not hold real numbers.

    Notes
    -----
    The equations stand at the head of this module.
    """
    field = _as_field(flow)
    top = _top_speed(field, max_flow)
    known = _known(field)
    u, v = np.moveaxis(np.where(known[..., None], field, 0.0), -1, 0)
    wheel = colour_wheel()
    colours = len(wheel)
    place = (np.arctan2(-v, -u) / np.pi + 1) / 2 * colours
    low = np.floor(place).astype(np.intp)
    share = (place - low)[..., None]
    hue = (1 - share) * wheel[low % colours] + share * wheel[(low + 1) % colours]
    relative = np.minimum(np.hypot(u, v) / top, 1)[..., None]
    colour = 255 * (1 - relative * (1 - hue))
    colour[~known] = 0
    return np.asarray(np.rint(colour), dtype=np.uint8)


def legend(size: int = 160, *, max_flow: float | None = None) -> Picture:
    """Draw the colour wheel: which colour means which direction and speed.

    Parameters
    ----------
    size : int, default 160
        Width of the square picture in pixels, at least 32. The wheel fills it up to a
        line of text below.
    max_flow : float, optional
        Speed at the rim in px/frame, written below the wheel; no text by default.

    Returns
    -------
    ndarray of shape (size, size, 3), uint8
    """
    _check_integer(size, "size", 32)
    side = int(size)
    top = None if max_flow is None else _check_speed(max_flow)
    text = "" if top is None else f"rim: {top:.3g} px/frame"
    strip = 0 if top is None else max(16, side // 8)
    centre_x, centre_y = (side - 1) / 2, (side - strip - 1) / 2
    radius = (side - strip) / 2 - 2
    y, x = np.mgrid[:side, :side].astype(np.float64)
    u, v = (x - centre_x) / radius, (y - centre_y) / radius
    distance = np.hypot(u, v)
    disc = flow_to_color(np.stack([u, v], axis=-1), max_flow=1.0).astype(np.float64)
    # Coverage of the disc's edge and of hair lines, one pixel wide.
    rim = np.clip(1 - np.abs(distance - 1) * radius, 0, 1)
    lines = np.clip(1 - np.minimum(np.abs(u), np.abs(v)) * radius, 0, 1) * 0.25
    ink = np.where(distance < 1, np.maximum(rim, lines), rim)[..., None]
    inside = np.clip((1 - distance) * radius + 0.5, 0, 1)[..., None]
    shown = inside * disc + (1 - inside) * WHITE
    shown = (1 - ink) * shown + ink * _INK
    picture = np.asarray(np.rint(shown), dtype=np.uint8)
    if strip:
        write_text(picture[side - strip :], text)
    return picture


def arrows(
    flow: ArrayLike,
    image: ArrayLike | None = None,
    *,
    step: int | None = None,
    max_flow: float | None = None,
) -> Picture:
    """Draw the flow as arrows over a picture or over its own colour coding.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v) in px/frame; NaN = unknown, where no arrow starts.
    image : array_like of shape (H, W) or (H, W, 3), optional
        The picture below: integers, or floats in [0, 1] (floats beyond that are
        stretched from their least to their greatest value). By default the flow's
        colour coding, paled so that the arrows stand out.
    step : int, optional
        Side in pixels of the square cells that get one arrow each, by default about
        a 30th of the longer side and at least 15. The arrow starts at the cell's known
        pixel nearest to its centre and shows the flow of that pixel.
    max_flow : float, optional
        Speed in px/frame whose arrow is 1.2 cells long; by default the 99th percentile
        of the known speeds. Faster arrows are shortened to that length; arrows shorter
        than 1.5 px become a dot.

    Returns
    -------
    ndarray of shape (H, W, 3), uint8

    Raises
    ------
    ValueError
        If shapes do not match, or ``step`` or ``max_flow`` is not positive.
    """
    field = _as_field(flow)
    height, width = field.shape[:2]
    if step is None:
        step = max(_LEAST_STEP, round(max(height, width) / _CELLS))
    _check_integer(step, "step", 1)
    top = _top_speed(field, max_flow)
    if image is None:
        base = 255 - (255 - flow_to_color(field, max_flow=top).astype(np.float64)) / 2
        base[~_known(field)] = 0
    else:
        base = as_display(image, "image").astype(np.float64)
    if base.shape[:2] != (height, width):
        raise ValueError(
            f"image must have the height and width of flow, {(height, width)}, "
            f"got {base.shape[:2]}"
        )
    return draw_arrows(base, field, int(step), top, outlined=image is not None)


def side_by_side(
    images: Sequence[ArrayLike], *, labels: Sequence[str] | None = None
) -> Picture:
    """Put pictures next to each other, with labels above.

    Parameters
    ----------
    images : sequence of array_like, each of shape (H, W) or (H, W, 3)
        Integers or floats as `arrows` takes them; sizes may differ, lower pictures are
        filled up with white below.
    labels : sequence of str, optional
        One line per picture, made smaller and at last cut where it is too long.

    Returns
    -------
    ndarray of shape (H', W', 3), uint8

    Raises
    ------
    ValueError
        If there is no picture or the labels are not as many as the pictures.
    """
    panels = [as_display(image, f"images[{i}]") for i, image in enumerate(images)]
    if not panels:
        raise ValueError("images must hold at least one picture, got none")
    if labels is not None and len(labels) != len(panels):
        raise ValueError(
            f"labels must be as many as images ({len(panels)}), got {len(labels)}"
        )
    strip = 0 if labels is None else _LABEL_ROWS
    height = strip + max(panel.shape[0] for panel in panels)
    width = sum(panel.shape[1] + _GAP for panel in panels) - _GAP
    canvas = np.full((height, width, 3), WHITE, np.uint8)
    left = 0
    for i, panel in enumerate(panels):
        right = left + panel.shape[1]
        canvas[strip : strip + panel.shape[0], left:right] = panel
        if labels is not None:
            write_text(canvas[:strip, left:right], labels[i])
        left = right + _GAP
    return canvas


def flow_figure(flow: ArrayLike, *, max_flow: float | None = None) -> Picture:
    """Compose the colour-coded flow with its legend on the right.

    Parameters
    ----------
    flow : array_like of shape (H, W, 2)
        (u, v) in px/frame; NaN = unknown.
    max_flow : float, optional
        Speed in px/frame shown in full colour; by default the 99th percentile of the
        known speeds. The legend names it, and the share of unknown pixels if any.

    Returns
    -------
    ndarray of shape (H', W', 3), uint8
        H' >= H, W' > W; the flow itself at full size in the upper left corner.
    """
    field = _as_field(flow)
    top = _top_speed(field, max_flow)
    coded = flow_to_color(field, max_flow=top)
    size = int(np.clip(0.4 * len(coded), _SMALLEST_LEGEND, _LARGEST_LEGEND))
    key = legend(size, max_flow=top)
    unknown = 1 - _known(field).mean()
    if unknown > 0:
        note = np.full((_LABEL_ROWS, size, 3), WHITE, np.uint8)
        share = f"{100 * unknown:.1f}" if unknown >= 0.0005 else "< 0.1"
        write_text(note, f"black: unknown, {share} %")
        key = np.concatenate([key, note])
    return side_by_side([coded, key])


def _as_field(flow: ArrayLike) -> NDArray[np.float64]:
    array: NDArray[Any] = np.ma.asanyarray(flow)
    if array.dtype.kind in "ui":  # pixels, not grey levels: never scaled
        array = array.astype(np.float64)
    array = as_picture_array(array, "flow")
    if array.ndim != 3 or array.shape[2] != 2 or array.size == 0:
        raise ValueError(
            f"flow must have shape (H, W, 2) with H, W >= 1, got {array.shape}"
        )
    return np.asarray(array, dtype=np.float64)


def _known(field: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(field).all(axis=-1))


def _top_speed(field: NDArray[np.float64], max_flow: float | None) -> float:
    # Without any motion the scale does not matter; 1 keeps it finite.
    if max_flow is not None:
        return _check_speed(max_flow)
    speeds = np.hypot(*field[_known(field)].T)
    if not len(speeds):
        return 1.0
    robust = float(np.percentile(speeds, _ROBUST_PERCENTILE))
    return robust or float(speeds.max()) or 1.0


def _check_integer(value: int, argument: str, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{argument} must be an integer, got {type(value).__name__}")
    if value < least:
        raise ValueError(f"{argument} must be at least {least}, got {value}")


def _check_speed(max_flow: float) -> float:
    if isinstance(max_flow, bool) or not isinstance(max_flow, int | float | np.number):
        raise TypeError(f"max_flow must be a number, got {type(max_flow).__name__}")
    if not (isfinite(max_flow) and max_flow > 0):
        raise ValueError(f"max_flow must be positive and finite, got {max_flow}")
    return float(max_flow)
