"""Time and memory of one contender on one sequence, in a process of its own.

A process of its own, because memory once given back to the allocator is not seen to be
taken again, and because a library that crashes must not end the others' race.
Everything runs with one thread. Time is processor seconds, system calls included: on a
busy machine that is what an idle one would take; the least of several runs counts.
Memory is the peak of the first run above what the process held when the frames were
read and one tiny picture had been through. The process runs `child`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from unsmear.suite.contenders import Contender
    from unsmear.suite.folder import SuiteSequence

__all__ = ["MeasurementError", "measure"]

# Read once, when the libraries are loaded.
_ONE_THREAD = dict.fromkeys(
    (
        "UNSMEAR_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
    ),
    "1",
)


class MeasurementError(RuntimeError):
    """The contender cannot do this sequence; the text says why."""


def measure(
    who: Contender, sequence: SuiteSequence, *, runs: int = 2
) -> tuple[NDArray[np.float32], dict[str, float | None]]:
    """Run a contender on a sequence.

    Parameters
    ----------
    who : Contender
        The method.
    sequence : SuiteSequence
        The frames.
    runs : int, default 2
        The first also measures the memory, and pays for fresh pages.

    Returns
    -------
    flow : ndarray of shape (H, W, 2), float32
        px/frame.
    cost : dict
        ``seconds`` (processor), and ``bytes_per_pixel`` beyond the frames, None where
        the system does not tell.

    Raises
    ------
    MeasurementError
        The method failed; the message is its own.
    """
    part, index = who.frames_of(len(sequence.frames), sequence.index)
    with TemporaryDirectory() as folder:
        result = Path(folder) / "flow.npy"
        job = {
            "contender": who.name,
            "frames": [str(path) for path in sequence.frames[part]],
            "index": index,
            "runs": runs,
            "result": str(result),
        }
        done = subprocess.run(
            [sys.executable, "-m", "unsmear.suite.child"],
            input=json.dumps(job),
            capture_output=True,
            text=True,
            env=os.environ | _ONE_THREAD,
            check=False,
        )
        if done.returncode:
            lines = done.stderr.strip().splitlines()
            reason = lines[-1] if lines else f"exit status {done.returncode}"
            raise MeasurementError(reason)
        return np.load(result, allow_pickle=False), json.loads(done.stdout)
