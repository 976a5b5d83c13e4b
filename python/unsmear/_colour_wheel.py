"""The colour wheel of the optical flow literature, from its six segments.

Six primaries stand on the wheel; between neighbours the colour runs linearly, in 15
steps from red to yellow, 6 to green, 4 to cyan, 11 to blue, 13 to magenta and 6 back
to red. That is 55 colours, more of them where the eye tells hues apart better.

Source: S. Baker et al., "A database and evaluation methodology for optical flow", Int.
J. Comput. Vis. 92 (2011) 1-31, doi:10.1007/s11263-010-0390-2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEPS = (15, 6, 4, 11, 13, 6)
_PRIMARIES = ((1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1), (1, 0, 1))


def colour_wheel() -> NDArray[np.float64]:
    """Build the 55 colours, (55, 3) RGB in [0, 1], from red by way of yellow."""
    colours = np.array([*_PRIMARIES, _PRIMARIES[0]], dtype=np.float64)
    parts = [
        start + (end - start) * np.arange(steps)[:, None] / steps
        for start, end, steps in zip(colours[:-1], colours[1:], _STEPS, strict=True)
    ]
    return np.concatenate(parts)
