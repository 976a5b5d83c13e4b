"""``unsmear demo``: the whole job on the bundled clip, measured against the truth."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import metrics, plot
from unsmear._atomic import write_bytes_atomic
from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.deblur import deblur
from unsmear.demo_clip import DemoClip, demo_clip
from unsmear.flow import FlowResult, optical_flow
from unsmear.images import write_image
from unsmear.sequences import write_frames
from unsmear.velocity import velocity_of_frame

if TYPE_CHECKING:
    import argparse

    from numpy.typing import NDArray

SUMMARY = "the whole job on a bundled clip: flow, deblurred frames, errors"
EXAMPLE = "unsmear demo -o unsmear_demo"


# What deblurs: a velocity that is soft at motion boundaries, across which no single
# path explains the blur, rings less there than the exact one. The clip moves up to
# 5.3 px/frame, within half a wavelength of this frequency.
_VELOCITY: dict[str, Any] = {
    "method": "least-squares",
    "tuning_frequency": 0.09,
    "neighbourhood": 3.0,
}


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.add_argument(
        "-o",
        "--output",
        default="unsmear_demo",
        metavar="DIR",
        help="default %(default)s",
    )


def run(options: argparse.Namespace) -> None:
    """Measure, restore, compare, write."""
    started = time.perf_counter()
    clip = demo_clip()
    with ProgressBar("demo") as bar:
        restored = _restore(clip, bar)
    middle = len(clip.blurred) // 2
    flow = optical_flow(clip.blurred, index=middle, channel_axis=3)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    write_frames(folder / "deblurred", restored)
    truth = clip.flow[middle]
    top = float(np.percentile(np.hypot(truth[..., 0], truth[..., 1]), 99))
    write_image(
        folder / "flow.png",
        plot.side_by_side(
            [
                plot.flow_figure(flow.flow, max_flow=top),
                plot.flow_figure(truth, max_flow=top),
            ],
            labels=["measured flow", "true flow"],
        ),
    )
    write_image(
        folder / "side_by_side.png",
        plot.side_by_side(
            [clip.blurred[middle], restored[middle], clip.sharp[middle]],
            labels=["blurred", "deblurred", "truth"],
        ),
    )
    result = _errors(clip, flow, restored, middle)
    result["seconds"] = time.perf_counter() - started
    report = {**result, "flow": flow.report}
    text = json.dumps(report, indent=2, allow_nan=False)
    write_bytes_atomic(folder / "report.json", text.encode())
    result["written"] = [
        str(folder / name)
        for name in ("deblurred", "flow.png", "side_by_side.png", "report.json")
    ]
    _common.show_result(result, as_json=options.json)


def _restore(clip: DemoClip, bar: ProgressBar) -> NDArray[Any]:
    restored = []
    for index, frame in enumerate(clip.blurred):
        velocity, _ = velocity_of_frame(
            clip.blurred, index, channel_axis=3, **_VELOCITY
        )
        result = deblur(frame, velocity, exposure=clip.exposure, channel_axis=2)
        restored.append(result.image)
        bar((index + 1) / len(clip.blurred))
    return np.stack(restored)


def _errors(
    clip: DemoClip, flow: FlowResult, restored: NDArray[Any], middle: int
) -> dict[str, Any]:
    pairs = list(zip(clip.sharp, clip.blurred, restored, strict=True))
    before = [metrics.psnr(blurred, sharp) for sharp, blurred, _ in pairs]
    after = [metrics.psnr(image, sharp) for sharp, _, image in pairs]
    errors = metrics.flow_errors(flow.flow, clip.flow[middle])
    return {
        "PSNR blurred (dB)": float(np.mean(before)),
        "PSNR deblurred (dB)": float(np.mean(after)),
        "PSNR gain (dB)": float(np.mean(after) - np.mean(before)),
        "worst frame's gain (dB)": float(np.min(np.subtract(after, before))),
        "flow endpoint error (px)": errors["epe"],
        "flow angular error (deg)": errors["aae"],
        "flow density": errors["density"],
    }
