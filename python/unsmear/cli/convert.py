"""``unsmear convert``: a flow file from one format to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from unsmear.cli import _common
from unsmear.flow_files import read_flow, write_flow

if TYPE_CHECKING:
    import argparse

SUMMARY = "convert a flow file; the suffixes name the formats"
EXAMPLE = "unsmear convert truth.flo truth.png"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.add_argument("source", metavar="A", help=".flo .pfm .png .npy .npz .flo5")
    verb.add_argument("target", metavar="B", help="likewise")


def run(options: argparse.Namespace) -> None:
    """Read and write."""
    flow = read_flow(options.source)
    write_flow(options.target, flow)
    height, width = flow.shape[:2]
    _common.show_result(
        {"written": options.target, "size": f"{width}x{height}"}, as_json=options.json
    )
