"""``unsmear flow``: the motion of one frame, to a flow file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from unsmear import plot
from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.flow import optical_flow
from unsmear.flow_files import write_flow
from unsmear.images import write_image

if TYPE_CHECKING:
    import argparse

SUMMARY = "measure the motion of every pixel of one frame"
EXAMPLE = "unsmear flow clip.mp4 -o flow.flo --index 12 --plot flow.png"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _common.add_frames(verb)
    verb.add_argument(
        "-o", "--output", required=True, metavar="FLOW", help=".flo .pfm .png .npy .npz"
    )
    _common.add_flow_method(verb, "--method", "balanced")
    verb.add_argument("--index", type=int, help="frame to measure; default the middle")
    verb.add_argument("--plot", metavar="PNG", help="draw the flow with its legend")


def run(options: argparse.Namespace) -> None:
    """Measure and write."""
    frames = _common.frames_of(options)
    with ProgressBar("flow") as progress:
        result = optical_flow(
            frames,
            index=options.index,
            method=options.method,
            channel_axis=_common.channel_axis_of(frames),
            progress=progress,
            **_common.parameters_of(options),
        )
    write_flow(options.output, result.flow)
    if options.plot:
        write_image(options.plot, plot.flow_figure(result.flow))
    written = {"flow": options.output} | (
        {"plot": options.plot} if options.plot else {}
    )
    _common.show_result(result.report | {"written": written}, as_json=options.json)
