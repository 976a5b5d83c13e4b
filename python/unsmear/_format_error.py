"""The one exception of the file decoders: what a format demands, what was found.

Decoders work on bytes and know no path. They say what they expected and what came;
the reader that knows the path turns this into its public exception.
"""

from __future__ import annotations


class FormatError(ValueError):
    """Bytes that break the rules of their file format.

    Parameters
    ----------
    expected : str
        What the format demands at this place.
    got : str
        What the bytes hold instead.
    """

    def __init__(self, expected: str, got: str) -> None:
        super().__init__(f"expected {expected}, got {got}")
        self.expected = expected
        self.got = got
