"""Time and memory of the default flow as ratios measured in one run.

    python benches/flow_speed.py [--runs N] [--frames FIRST SECOND] [--json] [--strict]

On one pair of 640 x 480 pictures:

* one thread: "balanced" takes at most 0.3 of the time of OpenCV's DeepFlow, "fast" at
  most 0.08;
* two threads are at least 1.6 times as fast as one;
* the peak of memory is at most 250 bytes per pixel beyond the frames.

With one thread times are processor seconds, so what others do on the machine stays out
but for the share of caches and clock; with two threads they are seconds of the wall and
mean little on a busy machine. Rivals take turns. Of each ratio that of the least times
is judged, and the median of the ratios turn by turn is shown beside it: where the two
lie far apart the machine was restless. Memory is measured in a process of its own.

Exit status 0; with --strict 1 when a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import unsmear
from numpy.typing import NDArray
from unsmear.suite import RIVALS, SuiteSequence, contender, measure, processor

Array = NDArray[Any]

# Read once, when NumPy's libraries are loaded.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
SIZE = (480, 640)
RIVAL = "OpenCV DeepFlow"
BARS = {"balanced": 0.3, "fast": 0.08}
STRETCH = {"balanced": 0.18, "fast": 0.05}
THREADS_BAR = 1.6
MEMORY_BAR = 250.0


def pair_of_scene() -> Array:
    """Two colour frames (2, H, W, 3), uint8: three objects before a background."""
    make = unsmear.synthetic
    height, width = SIZE
    around = (height + 64, width + 64)

    def paint(seed: int) -> Array:
        return np.stack([make.texture(around, seed=seed + c) for c in range(3)], -1)

    y, x = np.mgrid[: around[0], : around[1]].astype(float)
    layers = [make.Layer(paint(0), make.translating((1.7, -0.6)))]
    for number, (cx, cy, radius, velocity) in enumerate(
        [
            (180, 170, 90, (-3.1, 1.2)),
            (430, 320, 120, (4.6, 2.3)),
            (560, 120, 70, (0.4, -5.2)),
        ]
    ):
        inside = np.hypot(x - cx, y - cy) < radius
        motion = make.translating(velocity)
        layers.append(make.Layer(paint(10 + 3 * number), motion, inside))
    scene = make.Scene(tuple(layers), SIZE)
    return make.record(scene, n_frames=2, noise=1.0, bits=8).blurred


def turns(
    contenders: dict[str, Callable[[], object]], clock: Callable[[], float], runs: int
) -> dict[str, list[float]]:
    """Return the seconds of each in every turn, after one that does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(runs + 1):
        for name, work in contenders.items():
            start = clock()
            work()
            if turn:
                seconds[name].append(clock() - start)
    return seconds


def ratios(above: list[float], below: list[float]) -> tuple[float, float]:
    """Return the ratio of the least times and the median of the ratios by turns."""
    by_turns = [a / b for a, b in zip(above, below, strict=True)]
    return min(above) / min(below), statistics.median(by_turns)


def against_rival(frames: Array, runs: int) -> list[dict[str, Any]]:
    """Race with one thread."""
    unsmear.set_num_threads(1)
    work: dict[str, Callable[[], object]] = {
        RIVAL: lambda: RIVALS[RIVAL](frames[0], frames[1])
    }
    for method in BARS:
        who = contender(method)
        work[method] = lambda who=who: who.flow(frames, 0)
    seconds = turns(work, time.process_time, runs)
    rows = []
    for method, bar in BARS.items():
        least, median = ratios(seconds[method], seconds[RIVAL])
        rows.append(
            {
                "claim": f"{method} / {RIVAL}, one thread",
                "bar": f"<= {bar:g} (stretch {STRETCH[method]:g})",
                "found": least,
                "median": median,
                "least_seconds": [min(seconds[method]), min(seconds[RIVAL])],
                "held": least <= bar,
            }
        )
    return rows


def of_two_threads(frames: Array, runs: int) -> list[dict[str, Any]]:
    """Race one thread against two."""

    def with_threads(method: str, count: int) -> Callable[[], object]:
        who = contender(method)

        def work() -> None:
            unsmear.set_num_threads(count)
            who.flow(frames, 0)

        return work

    rows = []
    for method in BARS:
        work = {str(n): with_threads(method, n) for n in (1, 2)}
        seconds = turns(work, time.perf_counter, runs)
        least, median = ratios(seconds["1"], seconds["2"])
        rows.append(
            {
                "claim": f"{method}, one thread / two threads, wall",
                "bar": f">= {THREADS_BAR:g}",
                "found": least,
                "median": median,
                "least_seconds": [min(seconds["1"]), min(seconds["2"])],
                "held": least >= THREADS_BAR,
            }
        )
    return rows


def of_memory(frames: Array) -> list[dict[str, Any]]:
    """Measure the peaks, each in a process of its own."""
    rows = []
    with TemporaryDirectory() as folder:
        unsmear.write_frames(folder, frames)
        files = tuple(sorted(Path(folder).iterdir()))
        pair = SuiteSequence("pair", files, 0, files[0])
        for method in BARS:
            peak = measure(contender(method), pair, runs=1)[1]["bytes_per_pixel"]
            rows.append(
                {
                    "claim": f"{method}, peak memory beyond the frames, bytes/px",
                    "bar": f"<= {MEMORY_BAR:g}",
                    "found": float("nan") if peak is None else peak,
                    "median": None,
                    "least_seconds": [],
                    # Where the system does not tell, nothing is held.
                    "held": peak is not None and peak <= MEMORY_BAR,
                }
            )
    return rows


def show(rows: list[dict[str, Any]], runs: int) -> None:
    """Print a Markdown table."""
    print("| claim | bar | found | median | least seconds | held |")
    print("|---|---|---|---|---|---|")
    for row in rows:
        median = "" if row["median"] is None else f"{row['median']:.3g}"
        seconds = " / ".join(f"{s:.3f}" for s in row["least_seconds"])
        held = "yes" if row["held"] else "NO"
        print(
            f"| {row['claim']} | {row['bar']} | {row['found']:.3g} | {median} "
            f"| {seconds} | {held} |"
        )
    cores = os.cpu_count()
    print(f"\n{processor()}, {cores} cores; {runs} turns.")


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=7, help="turns of each (default 7)")
    parser.add_argument("--frames", nargs=2, metavar=("FIRST", "SECOND"))
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--strict", action="store_true", help="exit 1 on a missed bar")
    options = parser.parse_args()
    if ONE_THREAD.items() - os.environ.items():
        again = [sys.executable, __file__, *sys.argv[1:]]
        return subprocess.run(
            again, env=os.environ | ONE_THREAD, check=False
        ).returncode
    given = options.frames
    frames = unsmear.read_frames(given) if given else pair_of_scene()
    rows = against_rival(frames, options.runs)
    rows += of_two_threads(frames, options.runs)
    rows += of_memory(frames)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        show(rows, options.runs)
    return int(options.strict and not all(row["held"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
