"""The recorded arrays of the founding method, and how they are compared.

The recordings keep (row, column, frame, filter); the library and its oracles keep
(filter, frame, row, column). Their contents are listed beside them, in
``tests/data/golden/README.md``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

GOLDEN = Path(__file__).resolve().parent.parent / "data" / "golden"


def golden(name: str) -> dict[str, Array]:
    """Return every array of one file."""
    with np.load(GOLDEN / f"{name}.npz") as stored:
        return {key: stored[key] for key in stored.files}


def ours(stored: Array) -> Array:
    """Turn (row, column, frame[, filter]) into ([filter,] frame, row, column)."""
    return np.moveaxis(stored, range(2, stored.ndim), range(stored.ndim - 3, -1, -1))


def assert_close(actual: Array, expected: Array, tolerance: float) -> None:
    """Hold ``actual`` to ``tolerance`` times the largest magnitude of ``expected``.

    Both must be unknown (NaN) at the same places.
    """
    assert actual.shape == expected.shape
    np.testing.assert_array_equal(np.isnan(actual), np.isnan(expected))
    scale = float(np.nanmax(np.abs(expected)))
    assert np.nanmax(np.abs(actual - expected)) <= tolerance * scale
