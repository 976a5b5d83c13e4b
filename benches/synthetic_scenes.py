"""Every flow method on the nine scenes of the founding work, made anew.

    python benches/synthetic_scenes.py [--quick] [--output docs]

Records the scenes of ``unsmear.synthetic.thesis_scenes`` (exact truth, no noise), runs
every method with its default parameters on the frames around the middle one, and writes
``synthetic_scenes.md`` and ``.json``, with a picture of the scenes (``scenes.png``):
frame, true flow, and the flow of the default method. Errors count every pixel that
stays visible in the next frame, and those where a method answers; density says how
many.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import unsmear
from numpy.typing import NDArray
from speed import processor
from unsmear import metrics, plot, synthetic

METHODS = ("fast", "balanced", "accurate", "steady")
METHODS += ("least-squares", "fleet-jepson", "thesis")
SHOWN = "balanced"
# Frames given to a method; the others get all that are recorded.
FRAMES_OF = {"thesis": 3}
# The founding work left out what hardly moves: directions of nothing have no meaning.
MOVING = 0.1  # px/frame


def middle(frames: NDArray[Any], count: int) -> tuple[NDArray[Any], int]:
    """Return ``count`` frames around the middle one, and where that is among them."""
    centre = (len(frames) - 1) // 2
    first = max(0, centre - (count - 1) // 2)
    return frames[first : first + count], centre - first


def errors_of(flow: NDArray[Any], sequence: synthetic.Sequence) -> dict[str, float]:
    """Return errors over the visible pixels, and the thesis' direction error."""
    centre = (len(sequence.flow) - 1) // 2
    truth, visible = sequence.flow[centre], sequence.visible[centre]
    known = visible & np.isfinite(truth).all(axis=-1)
    found = metrics.flow_errors(flow, truth, mask=known)
    moving = known & (np.linalg.norm(truth, axis=-1) > MOVING)
    direction = metrics.direction_error(flow, truth)[moving]
    return {
        "aae": found["aae"],
        "epe": found["epe"],
        "density": found["density"],
        "direction": float(np.nanmean(direction))
        if np.isfinite(direction).any()
        else float("nan"),
    }


def measure(shape: tuple[int, int], n_frames: int) -> tuple[dict[str, Any], list[Any]]:
    """Return results by scene and method, and rows of pictures."""
    results: dict[str, Any] = {}
    pictures = []
    for name in synthetic.THESIS_SCENES:
        sequence = synthetic.thesis_scene(name, shape=shape, n_frames=n_frames)
        frames = np.rint(255 * np.clip(sequence.sharp, 0, 1)).astype(np.uint8)
        results[name] = {}
        for method in METHODS:
            given, index = middle(frames, FRAMES_OF.get(method, n_frames))
            start = time.process_time()
            flow = unsmear.optical_flow(given, index=index, method=method).flow
            seconds = time.process_time() - start
            results[name][method] = errors_of(flow, sequence) | {"seconds": seconds}
            if method == SHOWN:
                pictures.append(row(frames, sequence, flow))
        print(name, {m: round(r["epe"], 3) for m, r in results[name].items()})
    return results, pictures


def row(
    frames: NDArray[Any], sequence: synthetic.Sequence, flow: NDArray[Any]
) -> NDArray[np.uint8]:
    """Return frame, truth and estimate side by side, in one colour scale."""
    centre = (len(frames) - 1) // 2
    truth = sequence.flow[centre]
    fastest = float(np.nanmax(np.linalg.norm(truth, axis=-1)))
    shown = [plot.flow_to_color(f, max_flow=fastest)[..., :3] for f in (truth, flow)]
    grey = np.repeat(frames[centre][..., None], 3, axis=-1)
    return np.hstack([grey, *shown])


def sheet(pictures: list[Any]) -> NDArray[np.uint8]:
    """Return the rows in three columns, with white gaps."""
    framed = [
        np.pad(p, ((4, 4), (4, 4), (0, 0)), constant_values=255) for p in pictures
    ]
    columns = [np.vstack(framed[start::3]) for start in range(3)]
    return np.hstack(columns)


def markdown(report: dict[str, Any]) -> str:
    """Return the tables."""
    lines = [
        "# Nine synthetic scenes",
        "",
        f"{report['date']}, {report['processor']}, one thread. Scenes of "
        f"`unsmear.synthetic.thesis_scenes`, {report['shape'][1]} x "
        f"{report['shape'][0]} px, {report['frames']} frames, 8 bit, no noise; every "
        "method with its defaults (thesis: the three middle frames). Pixels that stay "
        "visible, without any border cut off; means of a method that leaves pixels out "
        "count those it answers. Where a surface has no texture the truth "
        "is still its motion, which nobody can see: read rows, not single cells. "
        "Made by `benches/synthetic_scenes.py`.",
        "",
        "![frame, true flow, flow of the default method](scenes.png)",
    ]
    titles = {
        "epe": "Endpoint error, px (density in % where below 100)",
        "aae": "Angular error (3-D), degrees",
        "direction": f"Direction error (2-D), degrees, where |v| > {MOVING} px",
        "seconds": "Processor seconds",
    }
    for key, title in titles.items():
        lines += ["", f"## {title}", "", "| scene | " + " | ".join(METHODS) + " |"]
        lines += ["|---" * (len(METHODS) + 1) + "|"]
        for scene, by_method in report["results"].items():
            cells = [cell(by_method[m], key) for m in METHODS]
            lines.append(f"| {scene} | " + " | ".join(cells) + " |")
        means = (
            np.mean([r[m][key] for r in report["results"].values()]) for m in METHODS
        )
        lines.append("| mean | " + " | ".join(f"{v:.2f}" for v in means) + " |")
    return "\n".join(lines) + "\n"


def cell(result: dict[str, float], key: str) -> str:
    """Return one figure."""
    text = f"{result[key]:.3f}" if key == "epe" else f"{result[key]:.2f}"
    density = round(100 * result["density"])
    return f"{text} ({density})" if key == "epe" and density < 100 else text


def main() -> int:
    """Record, measure, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small, fewer frames")
    parser.add_argument("--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    unsmear.set_num_threads(1)
    shape, n_frames = ((96, 128), 7) if given.quick else ((192, 256), 15)
    results, pictures = measure(shape, n_frames)
    report = {
        "date": dt.datetime.now(tz=dt.UTC).date().isoformat(),
        "processor": processor(),
        "version": unsmear.__version__,
        "shape": shape,
        "frames": n_frames,
        "results": results,
    }
    given.output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=1)
    (given.output / "synthetic_scenes.json").write_text(text + "\n", "utf-8")
    (given.output / "synthetic_scenes.md").write_text(markdown(report), "utf-8")
    unsmear.write_image(given.output / "scenes.png", sheet(pictures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
