"""Every deblurring method on known motions, in one table, with rivals in the same run.

    python benches/deblur_table.py [--quick] [--output docs]

Blurs pictures that ship inside scikit-image by the motions of
``unsmear.synthetic.blur_cases`` (8 bit, several noise levels and seeds), removes the
blur with the true velocity at mid-exposure, and writes ``deblur_table.md`` and
``.json``. A figure is the gain in PSNR over the blurred picture, dB, with a border of
24 px left out. Our methods are those ``unsmear.deblur`` knows, with their defaults, and
are told neither noise nor anything else; rivals (`deblur_rivals`) pick their settings
by the truth.
"""

from __future__ import annotations

import argparse
import datetime as dt
import inspect
import json
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import unsmear
from deblur_rivals import RIVALS, SETTINGS, SLOW, Problem, path_problem_matrix
from numpy.typing import NDArray
from skimage import color, data
from speed import processor
from unsmear import metrics, synthetic
from unsmear.synthetic import BlurCase

# Not exported by the package: what the installed version knows.
METHODS = sys.modules["unsmear.deblur"].METHODS
KNOWS_ACCELERATION = "acceleration" in inspect.signature(unsmear.deblur).parameters
# Those that take the blur for that of a steady field.
STRAIGHT = ("wiener", "thesis")

PICTURES = ("astronaut", "camera", "coffee", "chelsea")
BEHIND = "camera"  # of the two layers; for itself the first picture
NOISES = (0.0, 1.0, 5.0)  # grey levels
SEEDS = (1, 2)
SLOW_PICTURES = 2  # how many of the first pictures slow methods get, with one seed
SIZE, QUICK_SIZE = 240, 144  # px
QUICK_CASES = ("T7", "R12", "SHa", "2L")
BORDER = 24  # px
# What the mean of the table is over: motions a correct model explains in full.
IN_THE_MEAN = ("T7", "T11", "T22", "Z", "R5", "R12", "SH")
INNER = np.s_[BORDER:-BORDER, BORDER:-BORDER]


def grey(name: str) -> NDArray[np.float64]:
    """Return a picture as grey, 0..1."""
    picture = getattr(data, name)()
    return color.rgb2gray(picture) if picture.ndim == 3 else picture / 255


def ours(method: str) -> Callable[[BlurCase], NDArray[Any]]:
    """Return a method of ours, with what the case tells."""

    def work(case: BlurCase) -> NDArray[Any]:
        if KNOWS_ACCELERATION and method not in STRAIGHT:
            more = {"acceleration": case.acceleration}
        else:
            more = {}
        return unsmear.deblur(case.blurred, case.velocity, method=method, **more).image

    return work


def quality(picture: NDArray[Any], case: BlurCase) -> dict[str, float]:
    """Return PSNR and SSIM against the truth, without the border."""
    shown = np.clip(np.asarray(picture, np.float64), 0, 255)[INNER]
    truth = case.sharp[INNER].astype(np.float64)
    return {
        "psnr": metrics.psnr(shown, truth, data_range=255.0),
        "ssim": metrics.ssim(shown, truth, data_range=255.0),
    }


def blurred_cases(
    names: list[str], pictures: list[str], size: int
) -> Iterator[tuple[str, str, BlurCase, Any]]:
    """Yield each motion of each picture, with what makes the motion's matrix."""
    for case_name in names:
        matrix = None
        for n, picture in enumerate(pictures):
            options: dict[str, Any] = {"direction": 30 + 97 * n}
            if case_name == "2L":
                other = BEHIND if picture != BEHIND else pictures[n - 1]
                options["behind"] = grey(other)
            case = synthetic.blur_case(
                case_name, grey(picture), shape=(size, size), noise=0.0, **options
            )
            # Only translations and shakes have a direction that differs by picture.
            if matrix is None or case_name[0] in "TS2":
                path = case.velocity.astype(float), case.acceleration.astype(float)
                matrix = cache(partial(path_problem_matrix, *path))
            yield case_name, picture, case, matrix


def measure(given: argparse.Namespace) -> None:
    """Run everything; write what there is after each picture of each case."""
    records: list[dict[str, Any]] = []
    for name, picture, clean, matrix in blurred_cases(
        given.cases, given.pictures, given.size
    ):
        for noise in given.noises:
            for seed in given.seeds:
                case = clean.with_noise(noise, seed)
                about = {"case": name, "picture": picture, "noise": noise, "seed": seed}
                before = quality(case.blurred, case)
                problem = Problem(
                    case.blurred.astype(float),
                    case.velocity.astype(float),
                    case.acceleration.astype(float),
                    noise,
                    case.sharp.astype(float),
                    matrix,
                )
                for method, work in contenders(given, about, case, problem).items():
                    start = time.process_time()
                    restored = work()
                    seconds = time.process_time() - start
                    seconds /= SETTINGS.get(method, 1)
                    after = quality(restored, case)
                    records.append(
                        about
                        | {"method": method, "seconds": seconds, "before": before}
                        | after
                        | {"gain": after["psnr"] - before["psnr"]}
                    )
        print(name, picture, summary(records, name, picture), flush=True)
        write(given, records)


def write(given: argparse.Namespace, records: list[dict[str, Any]]) -> None:
    """Write the table and its numbers."""
    report = {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "processor": processor(),
        "version": unsmear.__version__,
        "pictures": given.pictures,
        "size": given.size,
        "noises": given.noises,
        "seeds": given.seeds,
        "records": records,
    }
    given.output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=1)
    (given.output / "deblur_table.json").write_text(text + "\n", "utf-8")
    (given.output / "deblur_table.md").write_text(markdown(report), "utf-8")


def contenders(
    given: argparse.Namespace, about: dict[str, Any], case: BlurCase, problem: Problem
) -> dict[str, Callable[[], NDArray[Any]]]:
    """Return who runs on this picture."""
    runs: dict[str, Callable[[], NDArray[Any]]] = {
        method: lambda m=method: ours(m)(case) for method in METHODS
    }
    runs |= {name: lambda n=name: RIVALS[n](problem) for name in given.rivals}
    slow_too = about["picture"] in given.pictures[:SLOW_PICTURES]
    slow_too &= about["seed"] == given.seeds[0]
    return {name: run for name, run in runs.items() if slow_too or name not in SLOW}


def summary(records: list[dict[str, Any]], case: str, picture: str) -> dict[str, float]:
    """Return mean gains of one picture, to be watched."""
    own = [r for r in records if (r["case"], r["picture"]) == (case, picture)]
    methods = dict.fromkeys(r["method"] for r in own)
    return {
        m: round(float(np.mean([r["gain"] for r in own if r["method"] == m])), 2)
        for m in methods
    }


def markdown(report: dict[str, Any]) -> str:
    """Return the tables: one per noise, the worst single results, and the times."""
    records = report["records"]
    methods = list(dict.fromkeys(r["method"] for r in records))
    cases = list(dict.fromkeys(r["case"] for r in records))
    lines = [
        "# Deblurring known motion",
        "",
        f"{report['date']}, {report['processor']}, one thread. Gain in PSNR (dB) over "
        f"the blurred picture / SSIM; means over {', '.join(report['pictures'])} "
        f"({report['size']} x {report['size']} px of each) and {len(report['seeds'])} "
        f"noise seeds; border of {BORDER} px left out. True velocity at mid-exposure; "
        "noise not told. "
        + (
            "True acceleration where a method takes one. "
            if KNOWS_ACCELERATION
            else "No acceleration. "
        )
        + "Rivals choose their settings by the truth, and those with one kernel get "
        f"the mean one; {' and '.join(SLOW)} ran on the first "
        f"{SLOW_PICTURES} pictures with one seed. Made by "
        "`benches/deblur_table.py`.",
        "",
    ]
    lines += [f"- {case}: {synthetic.BLUR_CASES[case]}" for case in cases]
    head = "| case | blurred | " + " | ".join(methods) + " |"
    rule = "|---" * (len(methods) + 2) + "|"
    for noise in report["noises"]:
        lines += ["", f"## Noise of {noise:g} grey levels", "", head, rule]
        for case in cases:
            own = [r for r in records if (r["case"], r["noise"]) == (case, noise)]
            lines.append(row(case, own, methods))
        own = [r for r in records if r["case"] in IN_THE_MEAN and r["noise"] == noise]
        counted = [case for case in cases if case in IN_THE_MEAN]
        lines.append(row("mean of " + " ".join(counted), own, methods))
        all_cases = [r for r in records if r["noise"] == noise]
        worst = [
            f"{min(r['gain'] for r in all_cases if r['method'] == m):+.1f}"
            for m in methods
        ]
        lines.append("| worst single result | | " + " | ".join(worst) + " |")
    times = [
        f"{np.mean([r['seconds'] for r in records if r['method'] == m]):.2f}"
        for m in methods
    ]
    lines += ["", "Mean processor seconds of one setting:", ""]
    lines += [head.replace("| case | blurred", "| | "), rule]
    lines.append("| seconds | | " + " | ".join(times) + " |")
    return "\n".join(lines) + "\n"


def row(name: str, own: list[dict[str, Any]], methods: list[str]) -> str:
    """Return one line of a table."""
    if not own:
        return f"| {name} |" + " |" * (len(methods) + 1)
    before = [
        np.mean([r["before"][k] for r in own if r["method"] == methods[0]])
        for k in ("psnr", "ssim")
    ]
    cells = [f"{before[0]:.1f}/{before[1]:.2f}"]
    for m in methods:
        gain, ssim = (
            np.mean([r[k] for r in own if r["method"] == m]) for k in ("gain", "ssim")
        )
        cells.append(f"{gain:+.1f}/{ssim:.2f}")
    return f"| {name} | " + " | ".join(cells) + " |"


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small, few cases")
    parser.add_argument("--output", type=Path, default=Path("docs"))
    parser.add_argument("--pictures", nargs="+", default=list(PICTURES))
    parser.add_argument("--cases", nargs="+", default=list(synthetic.BLUR_CASES))
    parser.add_argument("--noises", nargs="+", type=float, default=list(NOISES))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--rivals", nargs="*", default=list(RIVALS))
    parser.add_argument("--size", type=int, default=SIZE)
    given = parser.parse_args()
    if given.quick:
        given.pictures, given.seeds = given.pictures[:1], given.seeds[:1]
        given.noises, given.cases = [1.0], list(QUICK_CASES)
        given.size = QUICK_SIZE
    return given


def main() -> int:
    """Measure and write."""
    given = arguments()
    unsmear.set_num_threads(1)
    measure(given)
    return 0


if __name__ == "__main__":
    sys.exit(main())
