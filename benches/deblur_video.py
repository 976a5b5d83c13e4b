"""Blurred clips restored without any parameter: gains over the blurred frames.

    python benches/deblur_video.py [--data DIR] [--joint 3] [--pictures camera]

Synthetic clips: photographs of scikit-image under every kind of motion, exposures 1 and
0.5, noise of one grey level, 8 bits, 5 frames; the middle frame counts, without a
border of 24 px. Recorded clips, if DIR has them (barron/, slowmotion/avg_blur/,
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
    parser.add_argument("--joint", type=int, choices=(1, 3), default=1)
    parser.add_argument("--pictures", nargs="+", default=["camera", "astronaut"])
    parser.add_argument("--motions", nargs="+", default=MOTIONS, choices=MOTIONS)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "deblur_video")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    cases = itertools.product(
        options.motions, EXPOSURES, options.pictures, range(options.seeds)
    )
    for motion, exposure, name, seed in cases:
        made = clip(motion, name, exposure, seed)
        title = f"{motion}, exposure {exposure}, {name}, seed {seed}"
        rows.append(row(title, made.blurred, made.sharp, [2], [2], options.joint))
        mean = float(np.mean([line["gain"] for line in rows]))
        # What there is so far: a long run may be cut short.
        write(options.output, rows, mean, options.joint)
    if options.data:
        write(
            options.output,
            rows + recorded(options.data, options.joint),
            mean,
            options.joint,
        )


def write(path: Path, rows: list[dict[str, Any]], mean: float, joint: int) -> None:
    """Write the rows as markdown and JSON."""
    about = {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "machine": f"{platform.machine()}, {platform.python_implementation()} "
        f"{platform.python_version()}, {unsmear.get_num_threads()} threads",
        "version": unsmear.__version__,
        "joint": joint,
        "synthetic_mean_gain": round(mean, 2),
    }
    names = list(rows[0])
    lines = [
        "# Blurred clips restored without any parameter",
        "",
        f"Gains in dB over the blurred frames; frames restored together: {joint}; mean "
        f"of the synthetic clips {mean:+.2f} dB. Version {about['version']}, "
        f"{about['date']}, {about['machine']}. Made by `benches/deblur_video.py`.",
        "",
        "| " + " | ".join(names) + " |",
        "|" + "---|" * len(names),
        *("| " + " | ".join(str(line[name]) for name in names) + " |" for line in rows),
        "",
    ]
    path.parent.mkdir(exist_ok=True)
    path.with_suffix(".md").write_text("\n".join(lines), encoding="utf-8")
    path.with_suffix(".json").write_text(
        json.dumps({"about": about, "rows": rows}, indent=2) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
