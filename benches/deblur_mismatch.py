"""What a wrong velocity costs each deblurring method, and what "auto" repairs.

    python benches/deblur_mismatch.py [--quick] [--output docs]

The cases of `deblur_table`, but the velocity passed on is longer, shorter or turned;
for lengths the exposure is also left to ``exposure="auto"`` where a method knows it.
Writes ``deblur_mismatch.md`` and ``.json``: gains in PSNR over the blurred picture, dB,
and how many results are worse than it by more than 0.2 dB.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import unsmear
from deblur_table import METHODS, PICTURES, SIZE, blurred_cases, quality
from numpy.typing import NDArray
from speed import processor
from unsmear import synthetic

CASES = ("T7", "T11", "T22", "Z", "R5", "SH", "2L")
# Name -> factor of the length, turn in degrees.
WRONG = {"true": (1.0, 0.0), "-15 %": (0.85, 0.0), "+15 %": (1.15, 0.0)}
WRONG |= {"-10 deg": (1.0, -10.0), "+10 deg": (1.0, 10.0)}
WRONG_LENGTHS = {f"x {f:g}": (f, 0.0) for f in (0.5, 0.75, 1.25, 1.5)}
TOLERATED = -0.2  # dB
# The founding method is slow and loses with the true velocity already.
QUICK_METHODS = [name for name in METHODS if name != "thesis"]


def distorted(
    velocity: NDArray[np.float32], factor: float, degrees: float
) -> NDArray[np.float32]:
    """Return the velocity, longer by a factor and turned from right to down."""
    angle = math.radians(degrees)
    cos, sin = factor * math.cos(angle), factor * math.sin(angle)
    u, v = velocity[..., 0], velocity[..., 1]
    turned = np.stack([cos * u - sin * v, sin * u + cos * v], axis=-1)
    return turned.astype(np.float32)


def gain(case: synthetic.BlurCase, restored: NDArray[Any]) -> float:
    """Return the gain over the blurred picture, dB."""
    return quality(restored, case)["psnr"] - quality(case.blurred, case)["psnr"]


def attempts(case: synthetic.BlurCase, method: str) -> dict[str, float]:
    """Return gains by what was wrong, with the exposure given and left open."""
    found = {}
    for name, wrong in (WRONG | WRONG_LENGTHS).items():
        flow = distorted(case.velocity, *wrong)
        found[name] = gain(
            case, unsmear.deblur(case.blurred, flow, method=method).image
        )
        if wrong[1] == 0:
            try:
                result = unsmear.deblur(
                    case.blurred, flow, method=method, exposure="auto"
                )
            except (TypeError, ValueError):
                continue  # a method that must be told
            found[f"{name}, auto"] = gain(case, result.image)
    return found


def measure(given: argparse.Namespace) -> list[dict[str, Any]]:
    """Return one record per case, picture, noise and method."""
    records = []
    for name, picture, clean, _ in blurred_cases(
        given.cases, given.pictures, given.size
    ):
        for noise in given.noises:
            case = clean.with_noise(noise, given.seed)
            about = {"case": name, "picture": picture, "noise": noise}
            for method in given.methods:
                gains = attempts(case, method)
                records.append(about | {"method": method, "gains": gains})
        print(name, picture, flush=True)
    return records


def markdown(report: dict[str, Any]) -> str:
    """Return a table per noise and method."""
    records = report["records"]
    lines = [
        "# Deblurring with a wrong velocity",
        "",
        f"{report['date']}, {report['processor']}, one thread. Mean gain in PSNR (dB) "
        f"over {', '.join(report['pictures'])}; in brackets how many results lose more "
        f"than {-TOLERATED} dB. Made by `benches/deblur_mismatch.py`.",
    ]
    for noise in report["noises"]:
        for method in dict.fromkeys(r["method"] for r in records):
            own = [r for r in records if (r["noise"], r["method"]) == (noise, method)]
            wrongs = list(own[0]["gains"])
            lines += ["", f"## {method}, noise of {noise:g} grey levels", ""]
            lines += ["| case | " + " | ".join(wrongs) + " |"]
            lines += ["|---" * (len(wrongs) + 1) + "|"]
            for case in (*dict.fromkeys(r["case"] for r in own), "all"):
                shown = [r["gains"] for r in own if case in (r["case"], "all")]
                cells = [cell([g[w] for g in shown]) for w in wrongs]
                lines.append(f"| {case} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def cell(gains: list[float]) -> str:
    """Return mean and number of losses."""
    losses = sum(g < TOLERATED for g in gains)
    return f"{np.mean(gains):+.1f}" + (f" ({losses})" if losses else "")


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one small picture")
    parser.add_argument("--output", type=Path, default=Path("docs"))
    parser.add_argument("--pictures", nargs="+", default=list(PICTURES))
    parser.add_argument("--cases", nargs="+", default=list(CASES))
    parser.add_argument("--noises", nargs="+", type=float, default=[0.0, 1.0, 5.0])
    parser.add_argument("--methods", nargs="+", default=list(QUICK_METHODS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=int, default=SIZE)
    given = parser.parse_args()
    if given.quick:
        given.pictures, given.noises, given.size = given.pictures[:1], [1.0], 144
    unsmear.set_num_threads(1)
    report = {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "processor": processor(),
        "version": unsmear.__version__,
        "pictures": given.pictures,
        "noises": given.noises,
        "seed": given.seed,
        "records": measure(given),
    }
    given.output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=1)
    (given.output / "deblur_mismatch.json").write_text(text + "\n", "utf-8")
    (given.output / "deblur_mismatch.md").write_text(markdown(report), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
