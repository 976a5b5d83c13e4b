"""``unsmear demo``: the whole job on the bundled clip, measured against the truth."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import metrics, plot
from unsmear._atomic import write_bytes_atomic
from unsmear._plain_data import plain_data
from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.demo_clip import DemoClip, demo_clip
from unsmear.flow import FlowResult, optical_flow
from unsmear.images import write_image
from unsmear.sequence import SequenceResult, deblur_sequence
from unsmear.sequences import write_frames

if TYPE_CHECKING:
    import argparse

    from numpy.typing import NDArray

SUMMARY = "the whole job on a bundled clip: flow, deblurred frames, errors"
EXAMPLE = "unsmear demo -o unsmear_demo"

_WRITTEN = ("deblurred", "flow.png", "side_by_side.png", "report.json", "report.html")


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
        whole = deblur_sequence(clip.blurred, channel_axis=3, progress=bar)
    restored = whole.frames
    middle = len(clip.blurred) // 2
    measured = [
        optical_flow(clip.blurred, index=index, channel_axis=3)
        for index in range(len(clip.blurred) - 1)
    ]
    flow = measured[middle]
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
    report = plain_data({**result, "flow": flow.report, "frames": whole.reports})
    text = json.dumps(report, indent=2, allow_nan=False)
    write_bytes_atomic(folder / "report.json", text.encode())
    page = folder / "report.html"
    _write_page(page, clip, measured, whole, report, options.command)
    result["written"] = [str(folder / name) for name in _WRITTEN]
    _common.show_result(result, as_json=options.json)


def _write_page(
    path: Path,
    clip: DemoClip,
    measured: list[FlowResult],
    whole: SequenceResult,
    report: dict[str, Any],
    command: str,
) -> None:
    # The last frame has no next one to move to.
    plot.report(
        path,
        clip.blurred,
        restored=whole.frames,
        flows=[*(each.flow for each in measured), None],
        confidences=[*(each.confidence for each in measured), None],
        sharp=clip.sharp,
        true_flows=list(clip.flow),
        exposure=clip.exposure,
        verdicts=sorted({str(frame["verdict"]) for frame in whole.reports}),
        parameters=report,
        command=command,
        title="unsmear demo",
    )


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
