"""All methods on all sequences of a folder: errors, density, time and memory.

`find_sequences` (`folder`) finds the sequences, `Contender` (`contenders`) names what
is compared, `measure` runs one of them on one sequence in a process of its own, and
`markdown` (`table`) writes the result for people; the result itself is plain data.
"""

from __future__ import annotations

import datetime as dt
import os
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Any

from unsmear import metrics
from unsmear._parameters import PARAMETERS
from unsmear.suite.contenders import RIVALS, Contender, contender, versions
from unsmear.suite.folder import SuiteSequence, find_sequences
from unsmear.suite.measure import MeasurementError, measure
from unsmear.suite.table import markdown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

__all__ = [
    "RIVALS",
    "Contender",
    "MeasurementError",
    "SuiteSequence",
    "contender",
    "evaluate_suite",
    "find_sequences",
    "markdown",
    "measure",
    "processor",
]

_FIGURES = ("aae", "epe", "density", "outliers")


def evaluate_suite(
    folder: str | os.PathLike[str],
    *,
    methods: Sequence[str] | None = None,
    rivals: bool = False,
    runs: int = 2,
    report: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Measure methods on every sequence with truth in a folder.

    Each method has one set of parameters for all sequences. Errors count every pixel
    of known truth whose flow the method tells: no border is cropped, and ``density``
    is the share it tells.

    Parameters
    ----------
    folder : path-like
        Sequences, found as `folder.find_sequences` says.
    methods : sequence of str, optional
        Methods of `optical_flow` or names of ``RIVALS``, each with its defaults or as
        ``"NAME:parameter=value,..."``; default all methods of `optical_flow`. Methods
        of two frames get the frame of the truth and the next, "thesis" the one before
        them too, the others all frames.
    rivals : bool, default False
        Add all of ``RIVALS``.
    runs : int, default 2
        Times that each is run; the shortest counts.
    report : callable, optional
        Called with a line of text before each measurement.

    Returns
    -------
    dict
        Plain data that ``json.dumps`` takes. ``date``, ``machine``, ``versions``;
        ``sequences``: per name, size and number of frames; ``results``: per method and
        sequence ``aae`` (degrees), ``epe`` (px), ``density``, ``outliers``, the same
        for ``parts`` of the picture, ``seconds`` of one processor, and
        ``bytes_per_pixel`` (peak beyond the frames) - or ``error``, why there is none.

    Raises
    ------
    FileNotFoundError, ValueError
        No such folder, no sequence in it, an unknown method, ``runs`` below 1.
    ImportError
        Rivals were asked for and their libraries are missing.
    """
    if runs < 1:
        msg = f"runs must be >= 1, got {runs}"
        raise ValueError(msg)
    names = list(PARAMETERS if methods is None else methods)
    names += [name for name in RIVALS if rivals and name not in names]
    contenders = [contender(name) for name in names]
    any_rival = any(who.method in RIVALS for who in contenders)
    about = versions(rivals=any_rival)
    sequences = find_sequences(folder)
    results: dict[str, dict[str, Any]] = {name: {} for name in names}
    described = {}
    for sequence in sequences:
        truth = sequence.read_truth()
        height, width = truth.shape[:2]
        described[sequence.name] = {
            "width": width,
            "height": height,
            "frames": len(sequence.frames),
        }
        parts = sequence.subsets((height, width))
        for who in contenders:
            if report is not None:
                report(f"{sequence.name}: {who.name}")
            results[who.name][sequence.name] = _judged(
                who, sequence, truth, parts, runs
            )
    return {
        "date": dt.datetime.now(dt.UTC).date().isoformat(),
        "machine": {"processor": processor(), "cores": os.cpu_count(), "threads": 1},
        "versions": about | {"python": platform.python_version()},
        "runs": runs,
        "sequences": described,
        "results": results,
    }


def _judged(
    who: Contender,
    sequence: SuiteSequence,
    truth: NDArray[Any],
    parts: dict[str, NDArray[Any]],
    runs: int,
) -> dict[str, Any]:
    try:
        flow, cost = measure(who, sequence, runs=runs)
    except MeasurementError as error:
        return {"error": str(error)}

    def figures(mask: NDArray[Any] | None) -> dict[str, float]:
        errors = metrics.flow_errors(flow, truth, mask)
        return {name: errors[name] for name in _FIGURES}

    judged: dict[str, Any] = {**figures(None), **cost}
    if parts:
        judged["parts"] = {name: figures(mask) for name, mask in parts.items()}
    return judged


def processor() -> str:
    """Return the processor's name, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
