"""``unsmear show``: a flow file as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from unsmear import plot
from unsmear.cli import _common
from unsmear.flow_files import read_flow
from unsmear.images import read_image, write_image

if TYPE_CHECKING:
    import argparse

SUMMARY = "draw a flow field in colour with its legend"
EXAMPLE = "unsmear show flow.flo -o flow.png"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.add_argument("flow", metavar="FLOW", help="flow file")
    verb.add_argument("-o", "--output", required=True, metavar="PNG")
    verb.add_argument(
        "--max-flow", type=float, help="speed of full colour, px/frame; default p99"
    )
    verb.add_argument(
        "--arrows", metavar="PICTURE", help="draw arrows on this picture instead"
    )


def run(options: argparse.Namespace) -> None:
    """Draw and write."""
    flow = read_flow(options.flow)
    if options.arrows:
        picture = plot.arrows(flow, read_image(options.arrows))
    else:
        picture = plot.flow_figure(flow, max_flow=options.max_flow)
    write_image(options.output, picture)
    _common.show_result({"written": options.output}, as_json=options.json)
