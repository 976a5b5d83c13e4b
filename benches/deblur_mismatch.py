"""What a wrong velocity costs each deblurring method, and what "auto" repairs.

    python benches/deblur_mismatch.py [--quick] [--output docs]

The cases of `deblur_table`, but the velocity passed on is longer, shorter or turned,
with the exposure told and with the one ``exposure="auto"`` finds; turned ones also with
``turn=0``, which takes them as they are.
Writes ``deblur_mismatch.md`` and ``.json``: gains in PSNR over the blurred picture, dB,
how many results are worse than it by more than 0.2 dB, and what "auto" costs against
the true length. Runs of some pictures or noises are joined by `join_reports`.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import math
import sys
from collections.abc import Iterable
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
AUTO = ", auto"
AS_IT_IS = ", turn=0"
TOLERATED = -0.2  # dB
WITHIN = 0.5  # dB
# The founding method is slow and loses with the true velocity already.
QUICK_METHODS = [name for name in METHODS if name != "thesis"]

# Gain, what was wrong, record.
Results = list[tuple[float, str, dict[str, Any]]]


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


def attempts(
    case: synthetic.BlurCase, methods: list[str], find: bool
) -> tuple[dict[str, dict[str, float]], dict[str, Any]]:
    """Return gains by method and by what was wrong, and the exposures found.

    With ``find`` also gains with the exposure that "auto" finds; it does not depend on
    the method, so that it is found once for all of them.
    """
    gains: dict[str, dict[str, float]] = {method: {} for method in methods}
    reports = {}
    for name, wrong in (WRONG | WRONG_LENGTHS).items():
        flow = distorted(case.velocity, *wrong)
        motions: dict[str, dict[str, Any]] = {name: {"exposure": 1.0}}
        if find:
            found = unsmear.estimate_exposure(case.blurred, flow)
            motions[name + AUTO] = {"exposure": found.value, "turn": found.turn}
            reports[name] = found.report()
        if wrong[1]:
            motions[name + AS_IT_IS] = {"exposure": 1.0, "turn": 0.0}
        for title, motion in motions.items():
            for method in methods:
                result = unsmear.deblur(case.blurred, flow, method=method, **motion)
                gains[method][title] = gain(case, result.image)
    return gains, reports


def measure(given: argparse.Namespace) -> list[dict[str, Any]]:
    """Return one record per case, picture, noise and method."""
    records = []
    for name, picture, clean, _ in blurred_cases(
        given.cases, given.pictures, given.size
    ):
        for noise in given.noises:
            case = clean.with_noise(noise, given.seed)
            about = {"case": name, "picture": picture, "noise": noise}
            about["seed"] = given.seed
            gains, found = attempts(case, given.methods, not given.told)
            about["exposures"] = found
            records += [about | {"method": m, "gains": g} for m, g in gains.items()]
        print(name, picture, flush=True)
    return records


def markdown(report: dict[str, Any]) -> str:
    """Return a table per noise and method, after what they come to."""
    records = report["records"]
    groups = {
        (noise, method): [
            r for r in records if (r["noise"], r["method"]) == (noise, method)
        ]
        for noise in sorted({r["noise"] for r in records})
        for method in dict.fromkeys(r["method"] for r in records)
    }
    groups = {key: own for key, own in groups.items() if own}
    seeds = sorted({r["seed"] for r in records})
    lines = [
        "# Deblurring with a wrong velocity",
        "",
        f"{report['date']}, {report['processor']}, one thread. Gains in PSNR (dB) over "
        "the blurred picture, the velocity passed on being longer, shorter or turned. "
        f"Pictures: {', '.join(report['pictures'])}, noise seed "
        f'{", ".join(map(str, seeds))}; no acceleration is told. "auto": the exposure '
        'is found too, else it is told; so is the direction, but for "turn=0". Made by '
        "`benches/deblur_mismatch.py`.",
        "",
        *(
            f"- {case}: {synthetic.BLUR_CASES[case]}"
            for case in dict.fromkeys(r["case"] for r in records)
        ),
        "",
        f"Mismatch: {', '.join(WRONG)}. Its worst result is meant to be {TOLERATED} dB "
        'or better. Lengths times 0.5 to 1.5 with "auto" are meant to stay within '
        f"{WITHIN} dB of the true length with the exposure told. {certainty(records)}",
        "",
        "| noise | method | worst of the mismatch | below "
        f'{TOLERATED} dB | the same with "auto" | below {TOLERATED} dB '
        f'| most lost with "auto" | more than {WITHIN} dB |',
        "|---" * 8 + "|",
        *(outcome(noise, method, own) for (noise, method), own in groups.items()),
    ]
    for (noise, method), own in groups.items():
        cases = list(dict.fromkeys(r["case"] for r in own))
        lines += ["", f"## {method}, noise of {noise:g} grey levels", ""]
        lines += ["Mean gain; in brackets how many results lose more than "]
        lines[-1] += f"{-TOLERATED} dB.\n"
        lines += ["| velocity | " + " | ".join(cases) + " | all | worst |"]
        lines += ["|---" * (len(cases) + 3) + "|"]
        for wrong in own[0]["gains"]:
            gains = {
                c: [r["gains"][wrong] for r in own if r["case"] == c] for c in cases
            }
            every = [g for some in gains.values() for g in some]
            cells = [cell(some) for some in (*gains.values(), every)]
            lines.append(f"| {wrong} | {' | '.join(cells)} | {min(every):+.1f} |")
    return "\n".join(lines) + "\n"


def certainty(records: list[dict[str, Any]]) -> str:
    """Return how often the exposure that was found was said to be sure."""
    first = records[0]["method"]
    found = [
        (wrong, report["status"] == "ok")
        for record in records
        if record["method"] == first
        for wrong, report in record["exposures"].items()
    ]
    turned = [sure for wrong, sure in found if WRONG.get(wrong, (1, 0))[1] != 0]
    lengths = [sure for wrong, sure in found if WRONG.get(wrong, (1, 0))[1] == 0]
    if not turned or not lengths:
        return ""
    return (
        'The exposure "auto" finds was said to be sure for '
        f"{sum(lengths)} of {len(lengths)} velocities of right direction, and for "
        f"{sum(turned)} of {len(turned)} turned ones."
    )


def outcome(noise: float, method: str, own: list[dict[str, Any]]) -> str:
    """Return the line that says how far the aims are met."""
    cells = [f"{noise:g}", method]
    for suffix in ("", AUTO):
        gains = results(own, WRONG, suffix)
        cells += extreme(gains, sum(g[0] < TOLERATED for g in gains))
    lost = [
        (gained - record["gains"]["true"], wrong, record)
        for gained, wrong, record in results(own, ["true", *WRONG_LENGTHS], AUTO)
    ]
    cells += extreme(lost, sum(loss[0] < -WITHIN for loss in lost))
    return "| " + " | ".join(cells) + " |"


def results(own: list[dict[str, Any]], wrongs: Iterable[str], suffix: str) -> Results:
    """Return gains with what was wrong, where that was measured."""
    return [
        (record["gains"][wrong + suffix], wrong, record)
        for record in own
        for wrong in wrongs
        if wrong + suffix in record["gains"]
    ]


def extreme(found: Results, failures: int) -> list[str]:
    """Return two cells: the least of the results, and how many fail."""
    if not found:
        return ["", ""]
    least, wrong, record = min(found, key=lambda result: result[0])
    about = f"{record['case']}, {record['picture']}, {wrong}"
    return [f"{least:+.2f} ({about})", f"{failures} of {len(found)}"]


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
    parser.add_argument("--told", action="store_true", help='leave "auto" out')
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
