"""Three exposures restored as one: gain over the middle one restored alone.

    python benches/deblur_joint.py [--pictures camera ...] [--noises 1] [--seeds 2]

Photographs of scikit-image seen by three exposures of `unsmear.synthetic`'s
`exposure_series`: blurred in different directions, in one direction, by different
lengths, and with a nearly sharp neighbour. Each exposure's own velocity is given; the
displacement between exposures is the true one, or found (flow between the singly
restored exposures, then registration inside the joint restoration). PSNR, 8 bits,
without a border of 24 px. Writes docs/deblur_joint.md and .json.
"""

from __future__ import annotations

import argparse
import datetime as dt
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import unsmear
from skimage import color, data
from unsmear.restoration.clip_motion import Motion
from unsmear.restoration.joint import Neighbour, restore_jointly
from unsmear.restoration.looks import Look, cropped, look
from unsmear.restoration.neighbours import seen_in
from unsmear.restoration.registration import settled
from unsmear.restoration.sampling import inside
from unsmear.synthetic import ExposureSeries, exposure_series

BORDER = 24
SHAPE = (240, 240)
ROOT = Path(__file__).resolve().parent.parent
WHITE = 254.5  # grey level from which a sample is clipped
TV_SHARE = 1.4  # lambda of the sharper prior over that of total variation
CASES: dict[str, dict[str, Any]] = {
    "three directions": {"directions": (0, 60, 120), "lengths": 15},
    "one direction": {"directions": (30, 30, 30), "lengths": 15},
    "three lengths": {"directions": (30, 30, 30), "lengths": (8, 11.6, 15)},
    "a sharp neighbour": {"directions": (30, 30, 30), "lengths": (2, 15, 13)},
}


def texture(name: str) -> np.ndarray:
    """Return a photograph in grey, in [0, 1]."""
    picture = getattr(data, name)()
    return color.rgb2gray(picture) if picture.ndim == 3 else picture / 255.0


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    """Return the PSNR in dB without the border."""
    inner = (slice(BORDER, -BORDER),) * 2
    shown = np.clip(np.asarray(picture, float), 0, 255)[inner]
    return unsmear.metrics.psnr(shown, truth[inner].astype(float), data_range=255.0)


def own_look(series: ExposureSeries, k: int) -> Look:
    """Return what the solver is told of one exposure."""
    picture = series.blurred[k].astype(np.float32)
    velocity = series.velocity[k]
    everywhere = np.ones(picture.shape, np.float32)
    still = np.zeros_like(velocity)
    return look(picture[np.newaxis], velocity, still, 1.0, everywhere, ceiling=WHITE)


def neighbour(
    series: ExposureSeries, k: int, alone: list[np.ndarray], *, true: bool
) -> tuple[Neighbour, float]:
    """Return an exposure as a neighbour of the middle one, and the error of flow."""
    middle = len(alone) // 2
    velocity = series.velocity[k]
    if true:
        offset, seen = series.offset[k], inside(series.offset[k]).astype(np.float32)
        way = offset
    else:
        pair = np.stack([alone[k], alone[middle]])
        way = unsmear.optical_flow(pair, index=0).flow
        back = unsmear.optical_flow(pair[::-1], index=0).flow
        seen = seen_in(way, back, np.ones(velocity.shape[:2], np.float32))
        offset = settled(alone[k], alone[middle], way, seen)
    steady = velocity, np.zeros_like(velocity)
    motion = Motion(*steady, steady, None, None)
    planes = series.blurred[k].astype(np.float32)[np.newaxis]
    made = Neighbour(planes, motion, 1.0, offset, seen, WHITE)
    return made, error(way, series.offset[k])


def error(offset: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean distance in px without the border."""
    inner = (slice(BORDER, -BORDER),) * 2
    return float(np.nanmean(np.linalg.norm(offset - truth, axis=-1)[inner]))


def row(case: str, series: ExposureSeries, about: dict[str, Any]) -> dict[str, Any]:
    """Restore the middle exposure alone and jointly."""
    results = [
        unsmear.deblur(picture, velocity)
        for picture, velocity in zip(series.blurred, series.velocity, strict=True)
    ]
    alone = [result.image.astype(np.float32) for result in results]
    middle = len(alone) // 2
    report, truth = results[middle].report, series.sharp[middle]
    single = psnr(results[middle].image, truth)
    line: dict[str, Any] = {
        "case": case,
        **about,
        "blurred": round(psnr(series.blurred[middle], truth), 2),
        "alone": round(single, 2),
    }
    others = [k for k in range(len(alone)) if k != middle]
    for name in ("true", "found"):
        made = [neighbour(series, k, alone, true=name == "true") for k in others]
        neighbours = [one for one, _ in made]
        joint = restore_jointly(
            own_look(series, middle),
            neighbours,
            alone[middle][np.newaxis],
            0,
            strength=report["regularization"] / TV_SHARE,
            noise=max(report["noise"], 0.3),
        )
        picture = cropped(joint.picture, joint.pad)[0]
        line[f"gain, {name} registration"] = round(psnr(picture, truth) - single, 2)
        line["weight"] = round(joint.weight, 2)
    after = [
        error(one.offset, series.offset[k])
        for one, k in zip(neighbours, others, strict=True)
    ]
    line["error of flow"] = round(float(np.mean([wrong for _, wrong in made])), 3)
    line["error at last"] = round(float(np.mean(after)), 3)
    print(line, flush=True)
    return line


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write the rows as JSON, and means over pictures and seeds as markdown."""
    groups: dict[tuple[str, float], list[dict[str, Any]]] = {}
    for line in rows:
        groups.setdefault((line["case"], line["noise"]), []).append(line)
    names = [n for n in rows[0] if n not in ("case", "noise", "picture", "seed")]
    lines = [
        "# Three exposures restored as one",
        "",
        "Means over pictures and seeds; PSNR in dB, gains over the middle exposure "
        "restored alone, errors of registration in px. "
        f"Version {unsmear.__version__}, {dt.datetime.now(tz=dt.UTC).date()}. Made by "
        "`benches/deblur_joint.py`.",
        "",
        "| case | noise | runs | " + " | ".join(names) + " |",
        "|" + "---|" * (len(names) + 3),
    ]
    for (case, noise), group in groups.items():
        means = [f"{np.mean([line[n] for line in group]):.2f}" for n in names]
        lines.append(f"| {case} | {noise} | {len(group)} | " + " | ".join(means) + " |")
    path.parent.mkdir(exist_ok=True)
    path.with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    path.with_suffix(".json").write_text(
        json.dumps({"rows": rows}, indent=2) + "\n", encoding="utf-8"
    )


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    pictures = ["astronaut", "camera", "coffee", "chelsea"]
    parser.add_argument("--pictures", nargs="+", default=pictures)
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES)
    parser.add_argument("--noises", nargs="+", type=float, default=[1.0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "deblur_joint")
    parser.add_argument("--add", action="store_true", help="keep the rows of OUTPUT")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    if given.add:
        rows += json.loads(given.output.with_suffix(".json").read_text())["rows"]
    for case, name in itertools.product(given.cases, given.pictures):
        options = dict(CASES[case])
        turn = 97 * pictures.index(name) if name in pictures else 0
        options["directions"] = [d + turn for d in options["directions"]]
        clean = exposure_series(texture(name), shape=SHAPE, noise=0.0, **options)
        for noise, seed in itertools.product(given.noises, range(given.seeds)):
            about = {"noise": noise, "picture": name, "seed": seed}
            rows.append(row(case, clean.with_noise(noise, seed), about))
            write(given.output, rows)


if __name__ == "__main__":
    main()
