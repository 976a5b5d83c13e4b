"""What a result depends on beside its frames and parameters.

The kernels give the same bits whatever the processor. NumPy's functions and the Fourier
transforms choose their algorithm by its vector instructions and agree to rounding, the
mathematical library comes with the compiler; an iteration may carry a last bit farther.
On one machine, and for any number of threads, the bytes are the same.
"""

from __future__ import annotations

import platform
from typing import Any

import numpy as np

from unsmear import _unsmear


def versions() -> dict[str, str]:
    """Return the versions of all that computes, by name, as plain text.

    ``core`` is what the compiled part was built with and for, ``vectors`` which copy of
    its loops this processor runs: "avx512", "avx2" or "baseline", the target's own.
    """
    build = dict(_unsmear.build_info())
    how = "optimised" if _unsmear.optimized else "built without optimisation"
    return {
        "unsmear": _unsmear.__version__,
        "core": f"{how}, {build['rustc']}, {build['target']} with {build['features']}",
        "vectors": build["vectors"],
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "numpy": " ".join([np.__version__, *_numpy_extensions()]),
        "machine": f"{platform.machine()}, {platform.system()}",
    }


def _numpy_extensions() -> list[str]:
    """Return the vector extensions that NumPy found: its sums depend on them."""
    found: dict[str, Any] = dict(np.show_config(mode="dicts") or {})
    extensions = found.get("SIMD Extensions", {})
    return [*extensions.get("baseline", ()), *extensions.get("found", ())]
