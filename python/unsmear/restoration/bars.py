"""Black bars around the picture, which are no part of the scene.

Films shown in another format than their own, and clips that were turned or stabilised,
carry rows or columns of black at their edges. They stand still while the scene moves
beneath, so that flow next to them is pulled towards zero and a restoration that takes
them for recorded light rings there. Samples in bars are therefore unknown (NaN).

A bar is a run of whole rows (or columns between the rows found) from an edge of the
frame, each darker than `DARKEST` and even within `EVENNESS`, in grey levels of 0..255:
noise of one level alone makes a row of a few hundred samples more uneven than that. The
lines next to it, mixed with it by resampling or coding, count as bar too: at least
`SOFT_EDGE`, and up to `WIDEST_EDGE`, half a block of a codec, until most of a line is
something else than black. Around a bright thing before a black ground there are no
bars: that it is black there is worth knowing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Bars", "bars"]

DARKEST = 24.0
EVENNESS = 4.0
SOFT_EDGE, WIDEST_EDGE = 2, 9
LEAST_STEP = 8.0
LEAST_SHARE = 0.5
"""Samples of the first line of the picture that differ from the bar by a step."""
LEAST_PICTURE = 32
"""Rows and columns that must be left; else the frame is dark, not framed."""


class Bars(NamedTuple):
    """Rows and columns that are no picture, px."""

    top: int = 0
    bottom: int = 0
    left: int = 0
    right: int = 0

    def hide(self, planes: NDArray[Any]) -> None:
        """Make the bars of channels (C, H, W) unknown, in place."""
        height, width = planes.shape[1:]
        planes[:, : self.top] = np.nan
        planes[:, height - self.bottom :] = np.nan
        planes[:, :, : self.left] = np.nan
        planes[:, :, width - self.right :] = np.nan


def bars(planes: NDArray[np.float32]) -> Bars:
    """Return the bars of a frame's channels (C, H, W), grey levels."""
    height, width = planes.shape[1:]
    top, bottom = _lines(planes), _lines(planes[:, ::-1])
    if height - top - bottom < LEAST_PICTURE:
        return Bars()
    between = planes[:, top : height - bottom].swapaxes(1, 2)
    left, right = _lines(between), _lines(between[:, ::-1])
    if width - left - right < LEAST_PICTURE:
        return Bars()
    return Bars(top, bottom, left, right)


def _lines(planes: NDArray[np.float32]) -> int:
    """Return how many first lines of channels (C, lines, samples) are bar."""
    lines = np.moveaxis(planes, 1, 0)
    count = 0
    for line in lines:
        # Unknown samples compare to nothing: a line that has any is no bar.
        if not (line.max() <= DARKEST and (np.ptp(line, axis=1) <= EVENNESS).all()):
            break
        count += 1
    if count > 0:
        for first in range(count + SOFT_EDGE, min(count + WIDEST_EDGE, len(lines))):
            step = np.abs(lines[first] - lines[0]).max(axis=0)
            if (step > LEAST_STEP).mean() >= LEAST_SHARE:
                return first
    return 0
