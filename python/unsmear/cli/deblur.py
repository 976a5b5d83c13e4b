"""``unsmear deblur``: blurred frames in, restored frames out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.deblur import METHODS, deblur
from unsmear.flow_files import read_flow
from unsmear.sequences import write_frames
from unsmear.velocity import velocity_of_frame

if TYPE_CHECKING:
    import argparse

    from numpy.typing import NDArray

SUMMARY = "remove the motion blur of every frame"
EXAMPLE = "unsmear deblur clip.mp4 -o sharp/ --exposure 0.5"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _common.add_frames(verb)
    verb.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="folder, .tif or video"
    )
    verb.add_argument(
        "--exposure",
        type=float,
        default=1.0,
        help="share of the frame interval the shutter was open; default 1",
    )
    verb.add_argument("--method", choices=METHODS, default="tv", help="default tv")
    verb.add_argument(
        "--noise", type=float, help="standard deviation; default measured"
    )
    verb.add_argument("--flow", help="flow file to use for all frames, not measured")
    _common.add_flow_method(verb, "--flow-method", "balanced")


def run(options: argparse.Namespace) -> None:
    """Measure, restore and write."""
    frames = _common.frames_of(options)
    restored, reports = [], []
    with ProgressBar("deblur") as bar:
        for index, frame in enumerate(frames):
            flow = _flow_of(options, frames, index)
            result = deblur(
                frame,
                flow,
                exposure=options.exposure,
                method=options.method,
                noise=options.noise,
                channel_axis=2 if frames.ndim == 4 else None,
            )
            restored.append(result.image)
            reports.append(result.report)
            bar((index + 1) / len(frames))
    write_frames(options.output, np.stack(restored))
    result_of_all: dict[str, Any] = {
        "frames": len(frames),
        "method": options.method,
        "exposure": options.exposure,
        "warnings": sorted({text for report in reports for text in report["warnings"]}),
        "written": options.output,
    }
    if options.json:
        result_of_all["reports"] = reports
    _common.show_result(result_of_all, as_json=options.json)


def _flow_of(
    options: argparse.Namespace, frames: NDArray[Any], index: int
) -> NDArray[np.float32]:
    if options.flow:
        return read_flow(options.flow)
    if len(frames) < 2:
        msg = "one frame alone shows no motion: give more frames, or --flow"
        raise ValueError(msg)
    velocity, _ = velocity_of_frame(
        frames,
        index,
        method=options.flow_method,
        channel_axis=_common.channel_axis_of(frames),
        **_common.parameters_of(options),
    )
    return velocity
