"""Shapes and text drawn into pictures with soft edges.

A shape covers a share c of each pixel, and the pixel becomes (1 - c) below + c colour.
The coverage is estimated on a grid of 4 x 4 samples per pixel with Pillow's polygon
fill, band by band of rows, so that memory does not grow with the picture's area.
Text uses the font that ships inside Pillow, which is the same on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from unsmear._arrays import as_picture_array, scale_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    Picture = NDArray[np.uint8]

WHITE = 255
_BLACK = 0
_OVERSAMPLING = 4  # samples per pixel side: 17 levels of coverage
_BAND_ROWS = 256
_SHORTEST = 1.5  # px; a shorter arrow is drawn as a dot
_LONGEST = 1.2  # cells
_SHAFT = 0.075  # cells
_OUTLINE = 0.7  # px around arrows over a photograph
_LARGEST_FONT, _SMALLEST_FONT = 16, 8  # px


def as_display(image: ArrayLike, argument: str) -> Picture:
    """Return a picture as (H, W, 3) uint8 for the eye.

    Integers are scaled by their range; floats in [0, 1] by 255, other floats from
    their least to their greatest value; NaN becomes black.
    """
    array = np.asanyarray(image)
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * np.uint8(255)
    array = as_picture_array(array, argument)
    grey = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 1)
    if array.size == 0 or not (grey or (array.ndim == 3 and array.shape[2] == 3)):
        raise ValueError(
            f"{argument} must have shape (H, W) or (H, W, 3) and hold at least one "
            f"pixel, got {array.shape}"
        )
    if grey:
        array = np.broadcast_to(
            array.reshape(*array.shape[:2], 1), (*array.shape[:2], 3)
        )
    if array.dtype == np.uint8:
        return np.array(array)
    values = array.astype(np.float64) / scale_of(array.dtype)
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    if low < 0 or high > 1:
        values = (values - low) / (high - low or 1.0)
    shown = np.where(np.isfinite(values), values, 0.0)
    return np.asarray(np.rint(255 * shown), dtype=np.uint8)


def write_text(strip: NDArray[np.uint8], text: str) -> None:
    """Write one line centred into ``strip`` (H, W, 3), in place.

    The size follows the strip's height; a line that is too long is made smaller and at
    last cut.
    """
    height, width = strip.shape[:2]
    picture = Image.fromarray(np.ascontiguousarray(strip))
    draw = ImageDraw.Draw(picture)
    size = int(np.clip(0.75 * height, _SMALLEST_FONT, _LARGEST_FONT))
    font = ImageFont.load_default(size)
    while draw.textlength(text, font) > width and size > _SMALLEST_FONT:
        size -= 1
        font = ImageFont.load_default(size)
    if draw.textlength(text, font) > width:
        while text and draw.textlength(f"{text}…", font) > width:
            text = text[:-1]
        text = f"{text}…" if text else ""
    draw.text((width / 2, height / 2), text, fill=(0, 0, 0), font=font, anchor="mm")
    strip[...] = np.asarray(picture)


def draw_arrows(
    base: NDArray[np.float64],
    field: NDArray[np.float64],
    step: int,
    top_speed: float,
    *,
    outlined: bool,
) -> Picture:
    """Draw one arrow per cell of ``step`` pixels onto ``base`` (H, W, 3).

    An arrow of ``top_speed`` and above is 1.2 cells long, others in proportion. White
    with a black outline, or plain black.
    """
    longest = _LONGEST * step
    shapes = [
        _arrow(x, y, u, v, longest / top_speed, longest, max(1.0, _SHAFT * step))
        for x, y, u, v in _sampled(field, step)
    ]
    result = np.array(base)
    # A shape reaches this far from its pixel; rows drawn beyond the band keep the
    # rasteriser from rounding differently on both sides of a border between bands.
    margin = int(np.ceil(longest + _OUTLINE)) + 2
    for top in range(0, len(base), _BAND_ROWS):
        rows = result[top : top + _BAND_ROWS]
        near = [
            shape + np.array([0, margin - top])
            for shape in shapes
            if top - margin < shape[0, 1] < top + len(rows) + margin
        ]
        if outlined:
            _blend(rows, near, margin, _BLACK, _OUTLINE)
            _blend(rows, near, margin, WHITE, 0.0)
        else:
            _blend(rows, near, margin, _BLACK, 0.0)
    return np.asarray(np.rint(result), dtype=np.uint8)


def _sampled(
    field: NDArray[np.float64], step: int
) -> Iterator[tuple[float, float, float, float]]:
    """Yield x, y, u, v at the known pixel nearest to the centre of each cell."""
    height, width = field.shape[:2]
    known = np.asarray(np.isfinite(field).all(axis=-1))
    for top in range(0, height, step):
        for left in range(0, width, step):
            cell = known[top : top + step, left : left + step]
            y, x = np.nonzero(cell)
            if not len(y):
                continue
            rows, columns = cell.shape
            away = (y - (rows - 1) / 2) ** 2 + (x - (columns - 1) / 2) ** 2
            nearest = int(away.argmin())
            row, column = top + int(y[nearest]), left + int(x[nearest])
            u, v = field[row, column]
            yield column + 0.5, row + 0.5, float(u), float(v)


def _arrow(
    x: float, y: float, u: float, v: float, scale: float, longest: float, width: float
) -> NDArray[np.float64]:
    """Build the outline of one arrow, corners (n, 2) in px with x to the right."""
    speed = np.hypot(u, v)
    length = min(speed * scale, longest)
    if length < _SHORTEST:
        turn = np.linspace(0, 2 * np.pi, 8, endpoint=False)
        return np.stack(
            [x + 0.8 * width * np.cos(turn), y + 0.8 * width * np.sin(turn)], axis=-1
        )
    along = np.array([u, v]) / speed
    across = np.array([-along[1], along[0]])
    head = min(0.5 * length, 5 * width)
    half, wing = width / 2, max(0.45 * head, 0.8 * width)
    # From the tail, along one side to the tip and back along the other.
    lengthwise = [
        0,
        length - head,
        length - head,
        length,
        length - head,
        length - head,
        0,
    ]
    sideways = [half, half, wing, 0, -wing, -half, -half]
    return np.array([x, y]) + np.outer(lengthwise, along) + np.outer(sideways, across)


def _blend(
    rows: NDArray[np.float64],
    shapes: list[NDArray[Any]],
    margin: int,
    grey: int,
    growth: float,
) -> None:
    """Lay shapes, grown by ``growth`` px, over ``rows`` (h, W, 3), in place.

    The shapes' y counts from ``margin`` pixels above the first row.
    """
    height, width = rows.shape[0] + 2 * margin, rows.shape[1]
    sampled = Image.new("L", (width * _OVERSAMPLING, height * _OVERSAMPLING))
    draw = ImageDraw.Draw(sampled)
    for shape in shapes:
        # A sample's centre lies half a sample from its corner.
        corners = [tuple(p) for p in (shape * _OVERSAMPLING - 0.5).tolist()]
        draw.polygon(corners, fill=255)
        if growth:
            edge = round(2 * growth * _OVERSAMPLING)
            draw.line([*corners, corners[0], corners[1]], 255, edge, joint="curve")
    coverage = np.asarray(sampled.reduce(_OVERSAMPLING), dtype=np.float64) / 255
    rows[...] += coverage[margin : height - margin, :, None] * (grey - rows)
