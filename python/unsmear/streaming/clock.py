"""When the frames of a clip are shown.

A clip whose time stamps are, to one unit, those of a constant rate r has that rate,
whatever its container rounds them to: frame n is shown at t_0 + n / r. Any other keeps
the stamps it came with.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

__all__ = ["Clock", "clock_of"]

DEFAULT_RATE = Fraction(25)
"""Frames per second of what has no clock: a common camera rate."""
LARGEST_DENOMINATOR = 1001
"""Holds the 30000/1001 of NTSC exactly."""


@dataclass(frozen=True)
class Clock:
    """Times of frames.

    Attributes
    ----------
    rate : fractions.Fraction
        Frames per second, the mean if they vary.
    base : fractions.Fraction
        Seconds per unit of `stamps`.
    stamps : tuple of int or None
        Of every frame, where the rate is not constant.
    start : fractions.Fraction
        Time of the first frame, s.
    """

    rate: Fraction
    base: Fraction
    stamps: tuple[int, ...] | None = None
    start: Fraction = Fraction(0)

    def ticks(self, count: int) -> tuple[Fraction, list[int]]:
        """Return the unit (s) and the time of every frame in it."""
        if self.stamps is not None:
            return self.base, list(self.stamps)
        unit = Fraction(1, self.rate.numerator)
        first = round(self.start / unit)
        return unit, [first + n * self.rate.denominator for n in range(count)]

    def delays(self, count: int, unit: Fraction) -> list[int]:
        """Return for how many units (s) each frame is shown; errors do not add up."""
        base, ticks = self.ticks(count)
        last = ticks[-1] + round(1 / (self.rate * base))
        edges = [round((tick - ticks[0]) * base / unit) for tick in [*ticks, last]]
        return [after - before for before, after in pairwise(edges)]


def clock_of(
    stamps: list[int | None], base: Fraction | None, rate: Fraction | None
) -> Clock:
    """Return the clock of frames with ``stamps`` in units of ``base`` seconds.

    ``rate`` is what the container says; without it and without stamps the rate is
    `DEFAULT_RATE`.
    """
    told = [stamp for stamp in stamps if stamp is not None]
    rising = all(a < b for a, b in pairwise(told))
    if base is None or len(told) < len(stamps) or not rising:
        fallback = rate or DEFAULT_RATE
        return Clock(fallback, 1 / fallback)
    start = told[0] * base
    if len(told) == 1:
        return Clock(rate or DEFAULT_RATE, base, start=start)
    mean = (len(told) - 1) / ((told[-1] - told[0]) * base)
    for guess in (rate, mean.limit_denominator(LARGEST_DENOMINATOR)):
        if guess is not None and _constant(told, base, guess):
            return Clock(guess, base, start=start)
    return Clock(mean, base, tuple(told), start)


def _constant(stamps: list[int], base: Fraction, rate: Fraction) -> bool:
    step = 1 / (rate * base)
    return all(abs(t - stamps[0] - n * step) <= 1 for n, t in enumerate(stamps))
