"""Every deblurring method on known motions, in one table, with rivals in the same run.

    python benches/deblur_table.py [--quick] [--output docs]

Blurs pictures that ship inside scikit-image by the motions of
``unsmear.synthetic.blur_cases`` (8 bit, several noise levels and seeds), removes the
blur with the true velocity at mid-exposure, and writes ``deblur_table.md`` and
``.json``. A figure is the gain in PSNR over the blurred picture, dB, with a border of
24 px left out. Runs of some pictures, seeds or methods are joined by `join_reports`.
Our methods are those ``unsmear.deblur`` knows, with their defaults, and
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
from deblur_table_page import BORDER, markdown
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
SLOW_PICTURES = PICTURES[:2]  # what slow methods get, with one seed
SIZE, QUICK_SIZE = 240, 144  # px
QUICK_CASES = ("T7", "R12", "SHa", "2L")
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
        for picture in pictures:
            # By the picture's own place, so that a slice of the pictures gives the
            # same cases as all of them.
            n = PICTURES.index(picture) if picture in PICTURES else len(PICTURES)
            options: dict[str, Any] = {"direction": 30 + 97 * n}
            if case_name == "2L":
                other = BEHIND if picture != BEHIND else PICTURES[0]
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
        method: lambda m=method: ours(m)(case) for method in given.methods
    }
    runs |= {name: lambda n=name: RIVALS[n](problem) for name in given.rivals}
    slow_too = about["picture"] in SLOW_PICTURES and about["seed"] == SEEDS[0]
    return {name: run for name, run in runs.items() if slow_too or name not in SLOW}


def summary(records: list[dict[str, Any]], case: str, picture: str) -> dict[str, float]:
    """Return mean gains of one picture, to be watched."""
    own = [r for r in records if (r["case"], r["picture"]) == (case, picture)]
    methods = dict.fromkeys(r["method"] for r in own)
    return {
        m: round(float(np.mean([r["gain"] for r in own if r["method"] == m])), 2)
        for m in methods
    }


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small, few cases")
    parser.add_argument("--output", type=Path, default=Path("docs"))
    parser.add_argument("--pictures", nargs="+", default=list(PICTURES))
    parser.add_argument("--cases", nargs="+", default=list(synthetic.BLUR_CASES))
    parser.add_argument("--noises", nargs="+", type=float, default=list(NOISES))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--methods", nargs="*", default=list(METHODS))
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
