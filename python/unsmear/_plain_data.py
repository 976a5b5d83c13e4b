"""Results as plain data that JSON can say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def plain_data(value: Any) -> Any:
    """Return dicts, lists, text and numbers only; NaN and infinity become None."""
    if isinstance(value, dict):
        return {str(name): plain_data(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_data(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_data(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
