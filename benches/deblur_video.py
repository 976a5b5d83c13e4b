"""Blurred clips restored without any parameter: gains over the blurred frames.

    python benches/deblur_video.py [--data DIR] [--joint 1] [--pictures camera]

Synthetic clips: photographs of scikit-image under every kind of motion, exposures 1 and
0.5, noise of one grey level, 8 bits, 5 frames; the middle frame counts, without a
border of 24 px. Runs of some motions or pictures are joined by `join_reports`.
Recorded clips, if DIR has them (barron/, slowmotion/avg_blur/,
slowmotion/blur_video/): the mean over the frames that have a truth. Writes
docs/deblur_video.md and .json.
"""

from __future__ import annotations

import argparse
import datetime as dt
import itertools
import json
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np
import unsmear
from skimage import color, data
from unsmear import synthetic

BORDER = 24
SHAPE = (240, 240)
EXPOSURES = (1.0, 0.5)
ROOT = Path(__file__).resolve().parent.parent


def texture(name: str) -> np.ndarray:
    """Return a photograph in grey, in [0, 1]."""
    picture = getattr(data, name)()
    if picture.ndim == 3:
        return color.rgb2gray(picture[..., :3])
    return picture / 255.0


def clip(motion: str, name: str, exposure: float, seed: int) -> synthetic.Sequence:
    """Return five blurred frames with their truth."""
    picture = texture(name)
    options: dict[str, Any] = {
        "shape": SHAPE,
        "n_frames": 5,
        "exposure": exposure,
        "noise": 1.0,
        "bits": 8,
        "seed": seed,
    }
    if motion == "translation 9 px":
        return synthetic.translation(picture, (8.5, 3.0), **options)
    if motion == "translation 14 px":
        return synthetic.translation(picture, (-9.0, 10.7), **options)
    if motion == "zoom 10 %":
        return synthetic.zoom(picture, 0.1, **options)
    if motion == "rotation 7 degrees":
        return synthetic.rotation(picture, 7.0, **options)
    if motion == "shake":
        return synthetic.shake(picture, 7.0, period=8.0, motion_seed=3, **options)
    background = texture("coffee" if name != "coffee" else "camera")
    height, width = picture.shape
    y, x = np.mgrid[:height, :width]
    disc = (y - height / 2) ** 2 + (x - width / 2) ** 2 < 70**2
    return synthetic.layers(
        background,
        picture,
        disc,
        background_motion=synthetic.translating((3.0, -2.0)),
        foreground_motion=synthetic.translating((-9.0, 4.0)),
        **options,
    )


MOTIONS = (
    "translation 9 px",
    "translation 14 px",
    "zoom 10 %",
    "rotation 7 degrees",
    "shake",
    "two layers",
)


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    """Return the PSNR in dB without the border."""
    inner = (slice(BORDER, -BORDER),) * 2
    return unsmear.metrics.psnr(picture[inner], truth[inner])


def row(
    name: str,
    blurred: np.ndarray,
    sharp: np.ndarray,
    indices: list[int],
    truths: list[int],
    joint: int,
) -> dict[str, Any]:
    """Restore ``indices`` and compare with ``sharp[truths]``."""
    started = time.perf_counter()
    result = unsmear.deblur_sequence(
        blurred,
        indices=indices,
        joint=joint,
        channel_axis=3 if blurred.ndim == 4 else None,
    )
    seconds = (time.perf_counter() - started) / len(indices)
    before = [psnr(blurred[i], sharp[t]) for i, t in zip(indices, truths, strict=True)]
    after = [
        psnr(frame, sharp[t]) for frame, t in zip(result.frames, truths, strict=True)
    ]
    report = result.reports[len(indices) // 2]
    line = {
        "clip": name,
        "blurred": round(float(np.mean(before)), 2),
        "gain": round(float(np.mean(np.subtract(after, before))), 2),
        "worst": round(float(np.min(np.subtract(after, before))), 2),
        "exposure": round(report["exposure"], 3),
        "status": report["exposure_status"],
        "ratio": report.get("ratio") and round(report["ratio"], 3),
        "passes": report["passes"],
        "verdict": report["verdict"],
        "seconds": round(seconds, 1),
    }
    print(line, flush=True)
    return line


def averaged(
    frames: np.ndarray, centre: np.ndarray, length: int
) -> tuple[np.ndarray, int]:
    """Return means of ``length`` frames around ``centre``, and which is its own.

    Windows lie side by side where the clip is long enough, else they overlap.
    """
    error = [np.abs(frame.astype(float) - centre).max() for frame in frames]
    middle, half = int(np.argmin(error)), length // 2
    step = min(length, middle - half, len(frames) - 1 - half - middle)
    first = middle
    while first - step - half >= 0:
        first -= step
    middles = range(first, len(frames) - half, step)
    blurred = [frames[m - half : m + half + 1].mean(axis=0) for m in middles]
    return np.rint(np.stack(blurred)).astype(np.uint8), list(middles).index(middle)


def recorded(folder: Path, joint: int) -> list[dict[str, Any]]:
    """Return the rows of real clips with a truth."""
    rows = []
    for path in sorted((folder / "slowmotion" / "avg_blur").glob("*_N*")):
        name, length = path.name.split("_N")
        frames = unsmear.read_frames(folder / "barron" / name)
        centre = unsmear.read_frames(path / "sharp_centre.png")[0]
        blurred, own = averaged(frames, centre, int(length))
        title = f"avg_blur/{path.name}"
        rows.append(row(title, blurred, centre[np.newaxis], [own], [0], joint))
    path = folder / "slowmotion" / "blur_video" / "nasa"
    if path.exists():
        blurred = unsmear.read_frames(sorted(path.glob("blur_*.png")))
        sharp = unsmear.read_frames(sorted(path.glob("sharp_*.png")))
        every = list(range(len(blurred)))
        rows.append(row("blur_video/nasa", blurred, sharp, every, every, joint))
    return rows


def main() -> None:
    """Measure and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder of recorded clips")
    parser.add_argument("--joint", type=int, choices=(1, 3), default=3)
    parser.add_argument("--pictures", nargs="*", default=["camera", "astronaut"])
    parser.add_argument("--motions", nargs="+", default=MOTIONS, choices=MOTIONS)
    parser.add_argument("--exposures", nargs="+", type=float, default=EXPOSURES)
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--threads", type=int, help="default: all processors")
    parser.add_argument("--output", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    if options.threads:
        unsmear.set_num_threads(options.threads)
    rows: list[dict[str, Any]] = []
    cases = itertools.product(
        options.motions, options.exposures, options.pictures, options.seeds
    )
    for motion, exposure, name, seed in cases:
        made = clip(motion, name, exposure, seed)
        title = f"{motion}, exposure {exposure}, {name}, seed {seed}"
        line = row(title, made.blurred, made.sharp, [2], [2], options.joint)
        rows.append(line | {"source": f"{name}, seed {seed}"})
        # What there is so far: a long run may be cut short.
        write(options.output, rows, options.joint)
    if options.data:
        rows += recorded(options.data, options.joint)
        write(options.output, rows, options.joint)


def markdown(report: dict[str, Any]) -> str:
    """Return the table, after what the synthetic clips come to."""
    rows = report["records"]
    names = [name for name in rows[0] if name != "source"]
    made: dict[str, list[float]] = {}
    for line in rows:
        if "source" in line:
            made.setdefault(line["source"], []).append(line["gain"])
    lines = [
        "# Blurred clips restored without any parameter",
        "",
        "Gains in dB over the blurred frames; frames restored together: "
        f"{report['joint']}. Version {report['version']}, {report['date']}, "
        f"{report['machine']}. Made by `benches/deblur_video.py`.",
        "",
    ]
    if made:
        every = [gain for gains in made.values() for gain in gains]
        lines += [
            "| synthetic clips | number | mean gain | worst |",
            "|---|---|---|---|",
        ]
        for source, gains in (made | {"all": every}).items():
            mean, worst = np.mean(gains), min(gains)
            lines.append(f"| {source} | {len(gains)} | {mean:+.2f} | {worst:+.2f} |")
        lines.append("")
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    for line in sorted(rows, key=lambda line: "source" not in line):
        lines.append("| " + " | ".join(str(line[name]) for name in names) + " |")
    return "\n".join([*lines, ""])


def write(folder: Path, rows: list[dict[str, Any]], joint: int) -> None:
    """Write the rows as markdown and JSON."""
    report = {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "machine": f"{platform.machine()}, {platform.python_implementation()} "
        f"{platform.python_version()}, {unsmear.get_num_threads()} threads",
        "version": unsmear.__version__,
        "joint": joint,
        "records": rows,
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "deblur_video.md").write_text(markdown(report), encoding="utf-8")
    (folder / "deblur_video.json").write_text(
        json.dumps(report, indent=2) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
