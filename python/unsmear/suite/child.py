"""One contender on one sequence: the process that `measure` starts.

Reads a job from standard input (JSON: contender, frames, index, runs, result), writes
the flow to the file ``result`` and the cost to standard output as JSON. An exit status
other than 0 means that the contender failed; the reason is the last line on standard
error.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from unsmear import _unsmear
from unsmear.sequences import read_frames
from unsmear.suite.contenders import contender

_WARM_UP_SIDE = 32  # px: what it leaves allocated is small beside a picture
_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_RESET_PEAK = "5"
_KIB = 1024


def _resident(entry: str) -> int | None:
    """Bytes in memory now (VmRSS) or at most since the last reset (VmHWM)."""
    if not _STATUS.exists():
        return None
    for line in _STATUS.read_text("ascii").splitlines():
        if line.startswith(f"{entry}:"):
            return int(line.split()[1]) * _KIB
    return None


def _reset_peak() -> bool:
    try:
        _CLEAR.write_text(_RESET_PEAK, "ascii")
    except OSError:
        return False
    return True


def _run(job: dict[str, Any]) -> dict[str, float | None]:
    """Do a job; return its cost."""
    _unsmear.set_num_threads(1)
    who, index = contender(job["contender"]), job["index"]
    frames = read_frames(job["frames"])
    height, width = frames.shape[1:3]
    # Libraries are loaded, threads started and tables made before anything is measured.
    with suppress(ValueError):  # which the whole frames raise again, with their shape
        who.flow(frames[:, :_WARM_UP_SIDE, :_WARM_UP_SIDE].copy(), index)
    known = _reset_peak()
    before = _resident("VmRSS")
    seconds, peak, flow = [], None, None
    for turn in range(job["runs"]):
        start = time.process_time()
        flow = who.flow(frames, index)
        seconds.append(time.process_time() - start)
        if turn == 0:
            peak = _resident("VmHWM")
    np.save(job["result"], np.asarray(flow, np.float32))
    memory = None
    if known and peak is not None and before is not None:
        memory = (peak - before) / (height * width)
    return {"seconds": min(seconds), "bytes_per_pixel": memory}


if __name__ == "__main__":
    try:
        print(json.dumps(_run(json.load(sys.stdin))))
    except Exception as error:
        sys.exit(" ".join(f"{error}".split()) or type(error).__name__)
