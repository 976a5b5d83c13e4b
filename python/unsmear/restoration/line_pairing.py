r"""Lines of interlaced frames that lie closer in pairs than they should.

A camera that scans in two fields writes first the even lines, then the odd ones. Where
the second scan starts a little too high or too low, odd lines show the scene `offset`
px from their place between the even ones, in all of the frame alike: *line pairing*,
usual in recordings of tube cameras and in digitised tapes. Edges then move in steps of
two lines, and the smooth motion that a restoration follows explains neither of them.

It shows in the phase between the two fields. With E and O the transforms of the even
and the odd lines of a frame down its columns, f in cycles per line, O is seen 1 + d
lines later, and each frequency f of a field carries f and f - 1/2 of the scene, of
power S and S',

.. math::
    e^{2 \pi i f} \langle E O^* \rangle
        = S e^{-2 \pi i f d} - S' e^{2 \pi i (1/2 - f) d},
    \qquad \langle |E|^2 \rangle = \langle |O|^2 \rangle = S + S'.

Evenly spaced lines make it real, whatever the scene is and however it was blurred. The
real parts give S and S' for each d, the imaginary parts d: least squares, weighted by
their variance, <|E|^2>^2 less the square of the real part.

The frame itself is not resampled. The restoration lives on evenly spaced lines, its
operator reads it where the recorded ones lie, and so is it shown: every sample where it
was. Verdicts compare on evenly spaced lines the frame as it came, too: it is off there
by its lines, as the flow that was measured on such frames is, which carries the twins
(compared on the recorded lines, nasa loses .2 of 1.6 dB, ten clips of photographs
nothing). Fields of two moments of a picture that rises or sinks as a whole look the
same, and are mended the same way.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from unsmear.restoration.looks import cropped
from unsmear.restoration.sampling import pulled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.restoration.memo import Memo
    from unsmear.restoration.source import Source

    Plane = NDArray[np.float32]
    Planes = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["LinePairing", "Pairing", "as_recorded", "line_offsets", "measured"]

LEAST_OFFSET, GREATEST_OFFSET = 0.1, 0.4
"""px. Photographs and films that were never interlaced measure 0 to .06 (35 looked at),
enlarged ones more, but down and across alike. Lines shown twice measure .5, the most
that is looked for."""
LEAST_EXPLAINED = 0.8
"""Of the imaginary parts: .88 to .99 where lines are paired, seldom above .7 else."""
GREATEST_DEVIATION = 0.3
ACROSS = 0.34
"""Deviation, and offset of odd columns, as shares of the offset of odd lines."""
BAND = (0.02, 0.24)
"""Cycles per line: slower waves hold the frame's edges, faster ones say nothing of d
that noise would not."""
LEAST_LINES = 32
"""And columns. So many lines have seven frequencies in the band."""
BLOCKS = 8
"""Of columns, of which one at a time is left out to find the deviation."""
TURNS = 4
"""Of the fit: the second changes an offset of .3 px by a hundredth, the fourth by
a hundred-thousandth."""
WINDOW = 2
"""Frames on each side that are heard: frames of nasa differ by .03 px, five of them
in the median by .01."""


class Pairing(NamedTuple):
    """What the lines of one picture say."""

    offset: float = 0.0
    """Of odd lines from their place, downward, px."""
    deviation: float = np.inf
    """Of the offset, px."""
    explained: float = 0.0
    """Share of the phase between the fields that it explains."""


class LinePairing:
    """Offsets of the odd lines of a clip's frames, each found when it is asked for.

    Parameters
    ----------
    source : Source
        The clip.
    memo : Memo
        Keeps what was computed.
    """

    def __init__(self, source: Source, memo: Memo) -> None:
        self._source = source
        self._memo = memo

    def offset(self, index: int) -> float:
        """Return the offset for a frame, px; 0 unless most frames around it agree."""
        first = max(0, index - WINDOW)
        last = min(self._source.count - 1, index + WINDOW)
        near = [self._paired(other) for other in range(first, last + 1)]
        found = [offset for offset in near if offset]
        if 2 * len(found) <= len(near) or min(found) < 0 < max(found):
            return 0.0
        return float(np.median(found))

    def field(self, index: int) -> Field | None:
        """Return `line_offsets` of a frame."""
        return line_offsets(self._source.frame(index).shape[:2], self.offset(index))

    def _paired(self, index: int) -> float:
        def find() -> float:
            return _believed(self._source.luma(index))

        return self._memo.get("pairing", index, find)


def _believed(plane: Plane) -> float:
    """Return the offset of odd lines if it is beyond doubt, else 0."""
    lines = measured(plane)
    size = abs(lines.offset)
    if not LEAST_OFFSET <= size <= GREATEST_OFFSET:
        return 0.0
    sure = lines.deviation <= GREATEST_DEVIATION * size
    if not sure or lines.explained < LEAST_EXPLAINED:
        return 0.0
    across = abs(measured(plane.T).offset)
    return lines.offset if across <= ACROSS * size else 0.0


def measured(plane: NDArray[np.floating]) -> Pairing:
    """Return what the lines of a picture (H, W) say; columns with NaN are left out."""
    rows = np.flatnonzero(np.isfinite(plane).any(axis=1))
    first, count = (rows[0], np.ptp(rows) + 1) if rows.size else (0, 0)
    known = np.asarray(plane[first : first + count // 2 * 2], np.float64)
    known = known[:, np.isfinite(known).all(axis=0)]
    height, width = known.shape
    if height < LEAST_LINES or width < LEAST_LINES:
        return Pairing()
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(height) + 0.5) / height)
    lines = (known - known.mean(axis=0)) * window[:, np.newaxis]
    even, odd = (np.fft.rfft(lines[start::2], axis=0) for start in (0, 1))
    frequency = np.arange(len(even)) / height
    band = (frequency > BAND[0]) & (frequency < BAND[1])
    frequency, even, odd = frequency[band], even[band], odd[band]
    cross = even * odd.conj() * np.exp(2j * np.pi * frequency)[:, np.newaxis]
    power = 0.5 * (np.abs(even) ** 2 + np.abs(odd) ** 2)
    edges = np.linspace(0, width, BLOCKS + 1).astype(int)
    blocks = [
        (power[:, a:b].sum(axis=1), cross[:, a:b].sum(axis=1))
        for a, b in itertools.pairwise(edges)
    ]
    powers, crosses = (np.array(each) for each in zip(*blocks, strict=True))
    if not powers.sum() > 0:
        return Pairing()
    offset, explained = _fit(frequency, powers.sum(axis=0), crosses.sum(axis=0))
    others = np.array(
        [
            _fit(frequency, powers.sum(axis=0) - p, crosses.sum(axis=0) - c)[0]
            for p, c in zip(powers, crosses, strict=True)
        ]
    )
    deviation = float(np.sqrt((BLOCKS - 1) * others.var()))
    return Pairing(-offset if first % 2 else offset, deviation, explained)


def _fit(
    frequency: NDArray[np.float64],
    power: NDArray[np.float64],
    cross: NDArray[np.complex128],
) -> tuple[float, float]:
    """Return d and the share of the imaginary parts that it explains."""
    power = np.maximum(power, 1e-12 * power.max() + 1e-300)
    real, imaginary = np.clip(cross.real, -power, power), cross.imag
    weight = 1 / np.maximum(power**2 - real**2, 1e-3 * power**2)
    slow, fast = 2 * np.pi * frequency, 2 * np.pi * (0.5 - frequency)

    def parts(offset: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the imaginary parts to expect, and what they fall by per px."""
        near, far = np.cos(slow * offset), np.cos(fast * offset)
        own = (real + power * far) / (near + far)
        expected = -own * np.sin(slow * offset) - (power - own) * np.sin(fast * offset)
        return expected, slow * own * near + fast * (power - own) * far

    offset = 0.0
    for _ in range(TURNS):
        expected, slope = parts(offset)
        step = np.sum(weight * slope * (imaginary - expected))
        offset -= step / max(float(np.sum(weight * slope**2)), 1e-300)
        offset = float(np.clip(offset, -0.5, 0.5))
    left = np.sum(weight * (imaginary - parts(offset)[0]) ** 2)
    return offset, float(1 - left / max(float(np.sum(weight * imaginary**2)), 1e-300))


def line_offsets(shape: tuple[int, int], offset: float) -> Field | None:
    """Return where the lines of a frame lie, (H, W, 2) px from their own place.

    None where ``offset`` is 0. Even lines share the burden, so that the whole does not
    move.
    """
    if offset == 0.0:
        return None
    field = np.zeros((*shape, 2), np.float32)
    field[0::2, :, 1] = -0.5 * offset
    field[1::2, :, 1] = 0.5 * offset
    return field


def as_recorded(picture: Planes, pad: int, offset: float) -> Planes:
    """Return a padded restoration (C, H + 2 pad, W + 2 pad) read where lines lie."""
    inner = cropped(picture, pad)
    lines = line_offsets((inner.shape[1], inner.shape[2]), offset)
    if lines is None:
        return inner
    more = ((pad, pad), (pad, pad), (0, 0))
    read = [pulled(plane, np.pad(lines, more)) for plane in picture]
    there = cropped(np.stack(read), pad)
    return np.where(np.isfinite(there), there, inner)
