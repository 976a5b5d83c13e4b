r"""What stands still in a clip, though flow says that it moves.

Around a thing that moves before a ground at rest, smooth flow carries its motion on to
the ground, some 30 px where the thing is blurred; restored along it the ground rings.
The frames themselves know better. With v the velocity of frame i, a place is still
where one of the frames next to it, n = +-1, says

.. math:: G * (I_{i+n}(p) - I_i(p))^2 < 0.15 \; G * (I_{i+n}(p + n v(p)) - I_i(p))^2,

G a Gaussian of 2 px: rest explains it far better than the motion does. One is enough,
since the thing may hide the place in the other. Without texture both sides are noise
and the velocity stays: blur along it changes nothing there. Where things do move rest
explains nothing, unless the velocity is altogether wrong.

On nine photographs' patches in front of others at rest, the ground near the patch lost
.3 to 8 dB by restoration and loses less than .2, and the rim of the patch gains up to
1.5 dB. A share of .25 takes more of the rim, and smooth parts of the patch with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from unsmear.restoration.sampling import pulled, smoothed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Plane = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["still"]

SMOOTHING = 2.0
BETTER = 0.15
LEAST_MOTION = 0.3
"""px, below which there is nothing to decide."""


def still(own: Plane, others: list[tuple[Plane, Field]]) -> NDArray[np.bool_]:
    """Return where rest explains a frame's neighbours far better than its motion.

    Parameters
    ----------
    own : ndarray of shape (H, W), float32
        Luma of the frame; NaN = unknown.
    others : list of (ndarray like ``own``, ndarray of shape (H, W, 2))
        Each neighbour, and the displacement to it that the motion says, px; NaN =
        unknown, and never still.
    """
    found = np.zeros(own.shape, bool)
    for other, way in others:
        moved = pulled(other, way)
        # Compared where both can be: a place that leaves the picture says nothing.
        known = np.isfinite(moved) & np.isfinite(other) & np.isfinite(own)
        rest, motion = (
            smoothed(
                np.where(known, (there - own.astype(np.float64)) ** 2, 0), SMOOTHING
            )
            for there in (other, moved)
        )
        moves = np.linalg.norm(way, axis=-1) > LEAST_MOTION  # false for NaN
        found |= moves & known & (rest < BETTER * motion)
    return found
