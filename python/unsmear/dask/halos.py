r"""How much of its surroundings a tile needs to be exact.

What a pixel of these functions depends on lies along its streamline, which is walked in
a bounded number of strides, and around each point of it, where the cut spline reads
`SPLINE` px. With B the longest blur of the picture (px, exposure times speed), a tile
needs around it

.. math:: \lceil B / 2 \rceil + 13 + 1

pixels to be blurred: half the blur to either side. To be restored by "wiener" a pixel
of blur L takes n = ceil(L) + 4 strides, each of two steps of its own length; where the
field speeds up, by at most max(1 px/frame, L / 5) a stride, they grow, so that it looks

.. math:: D(L) = \sum_{k=1}^n \frac2L \min(B, L + k \max(e, L / 5))

px far, e the exposure, and the halo is the greatest D for L between 1/2 px, below which
nothing is restored, and B; at least 19 px, over which detail is measured. Both are
bounds: tiles equal the picture bit for bit, as the tests show. Offsets are kept
relative to the pixel, so that no rounding knows where the tile begins.
"""

from __future__ import annotations

import numpy as np

__all__ = ["blur_halo", "wiener_halo"]

SPLINE = 13
"""Pixels on each side that an interpolated value depends on."""
DETAIL = 19
"""Pixels on each side over which the strength of detail is measured."""
STILL = 0.5
"""Blur up to which nothing is restored, px."""
LONGEST = 200.0
"""Blur beyond which nothing is restored, px."""
LONGEST_MOTION = 4096.0
"""Blur beyond which nothing can be blurred, px."""
MORE_STRIDES = 4
JUMP, RELATIVE_JUMP = 1.0, 0.2
"""Change of the motion that a stride follows, px/frame, and as a share of the speed."""
SCAN = 1 / 64
"""Step in which lengths of blur are looked through, px."""


def blur_halo(longest: float) -> int:
    """Return the halo of a tile to be blurred by up to ``longest`` px, px."""
    # No motion is longer than that, or the tile says so.
    return int(np.ceil(min(longest, LONGEST_MOTION) / 2)) + SPLINE + 1


def wiener_halo(longest: float, exposure: float) -> int:
    """Return the halo of a tile of blur up to ``longest`` px to be restored, px."""
    most = min(longest, LONGEST)
    if most <= STILL:
        return DETAIL
    low = np.arange(STILL, most, SCAN)
    high = np.minimum(low + SCAN, most)
    # Kernels are made for lengths in steps of 1/4 px, the nearest of which may be more.
    strides = np.ceil(high + 0.125) + MORE_STRIDES
    jump = np.maximum(JUMP * exposure, RELATIVE_JUMP * high)
    way = np.zeros_like(low)
    for k in range(1, int(strides.max()) + 1):
        step = 2 * np.minimum(longest, high + k * jump) / low
        way += np.where(k <= strides, step, 0.0)
    return max(DETAIL, int(np.ceil(way.max())) + SPLINE + 1)
