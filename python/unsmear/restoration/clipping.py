r"""Whether what is clipped was brighter than white, or white.

A sensor clips the light it has gathered: a sample at the ceiling says "this bright or
brighter". Frames that are means of clipped frames, as most clips made to have a sharp
truth, were clipped before they were blurred: there it says what it says, and the
freedom to be brighter lets the restoration ring next to white edges (-2.3 dB where .2
can be gained, 4.4 dB instead of 5.4). Taking bright lights for white costs 2 to 8 dB.

A restoration x with that freedom tells: over the clipped samples C whose blur reaches
others too,

.. math:: \operatorname{mean}_{p \in C} \max((A x)(p) - \text{ceiling}, 0)

is 0 to 2 grey levels for recorded means and for photographs with white lights, and 11
to 45 with lights of 1.2 to 2 times white (noise 1, blur of 2.5 to 9 px). A mean of
clipped frames with many small lights of twice white reaches 11 too: when in doubt light
may be brighter.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from unsmear import _unsmear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.looks import Look

__all__ = ["brighter_than_white"]

EXCESS = 7.0
"""Grey levels, between the two."""
LEAST_BLUR = 2.0
"""Blur, px, that tells: less is explained by both."""
LEAST_SAMPLES = 32
GREATEST = 100.0
"""Excess, grey levels, that one sample counts for at most."""


def brighter_than_white(look: Look, picture: NDArray[np.float32], pad: int) -> bool:
    """Return whether a restoration uses the freedom that clipped samples leave.

    True where it cannot be told.

    Parameters
    ----------
    look : Look
        One channel, with a ceiling.
    picture : ndarray of shape (1, H + 2 pad, W + 2 pad)
        What was restored from it, grey levels.
    pad : int
        Of ``picture``.
    """
    ceiling = look["ceiling"]
    if ceiling is None:
        return False
    recorded = look["planes"][0]
    clipped = recorded >= ceiling
    blur = look["exposure"] * np.linalg.norm(look["velocity"], axis=-1)
    told = clipped & (blur >= LEAST_BLUR) & (look["weights"] > 0)
    if told.sum() < LEAST_SAMPLES:
        return True
    reach = math.ceil(float(np.percentile(blur[told], 95)) / 2) + 1
    told &= _unsmear.dilated(recorded < ceiling, reach)
    if told.sum() < LEAST_SAMPLES:
        return True
    predicted = _unsmear.record_look(look, picture, pad)[0]
    excess = np.clip(predicted[told] - ceiling, 0.0, GREATEST)
    return bool(excess.mean() > EXCESS)
