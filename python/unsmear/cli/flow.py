"""``unsmear flow``: the motion of one frame, to a flow file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from unsmear import plot
from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.flow import optical_flow, reference_frame
from unsmear.flow_files import write_flow
from unsmear.images import write_image
from unsmear.streaming.clip import open_clip
from unsmear.streaming.restorers import POOLING, frames_for_flow

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
    parameters = _common.parameters_of(options)
    with open_clip(_common.source_of(options)) as clip:
        index = reference_frame(options.index, len(clip))
        if index == len(clip) - 1 and options.method not in POOLING:
            msg = (
                f"--index must be before the last of {len(clip)} frames, whose motion "
                f"to the next is not in them; got {index}"
            )
            raise ValueError(msg)
        # Only what the method looks at, but all where it pools all.
        first, end = frames_for_flow(
            options.method, parameters, index, len(clip), len(clip)
        )
        frames = clip.between(first, end)
    with ProgressBar("flow") as progress:
        result = optical_flow(
            frames,
            index=index - first,
            method=options.method,
            channel_axis=_common.channel_axis_of(frames),
            progress=progress,
            **parameters,
        )
    result.report["frames"][0] = clip.shape[0]
    result.report["index"] = index
    write_flow(options.output, result.flow)
    if options.plot:
        write_image(options.plot, plot.flow_figure(result.flow))
    written = {"flow": options.output} | (
        {"plot": options.plot} if options.plot else {}
    )
    _common.show_result(result.report | {"written": written}, as_json=options.json)
