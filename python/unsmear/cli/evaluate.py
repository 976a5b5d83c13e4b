"""``unsmear evaluate``: flow against the truth, methods over a folder, or pictures."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import metrics
from unsmear._atomic import write_bytes_atomic
from unsmear._plain_data import plain_data
from unsmear.cli import _common
from unsmear.flow_files import read_flow
from unsmear.images import read_image
from unsmear.suite import evaluate_suite, markdown

if TYPE_CHECKING:
    import argparse

SUMMARY = "compare a flow field with the truth, methods on sequences, or two pictures"
EXAMPLE = """unsmear evaluate flow.flo truth.flo --mask land.png
  unsmear evaluate --suite sequences/ --methods balanced fast --rivals -o table"""
_PRINTED = """

printed for FLOW TRUTH:
  aae          mean angle between (u, v, 1) of both, degrees
  direction    mean angle between (u, v) of both, degrees
  epe          mean endpoint error, px/frame; percentiles are of it
  magnitude    mean difference in speed, px/frame
  density      share of the pixels counted where the flow is known
  outliers     share of them wrong by more than 3 px/frame and 5 % of the speed"""
_SUITE_SUFFIXES = (".md", ".json")


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.epilog = f"{verb.epilog or ''}{_PRINTED}"
    verb.add_argument("files", nargs="*", metavar="FILE", help="FLOW TRUTH")
    verb.add_argument("--mask", help="picture: pixels that count are not 0")
    verb.add_argument(
        "--min-speed",
        type=float,
        default=0.0,
        metavar="S",
        help="count only pixels whose true speed is at least S px/frame",
    )
    verb.add_argument(
        "--confidence", metavar="FILE", help="picture or .npy: errors per density too"
    )
    verb.add_argument(
        "--images", nargs=2, metavar=("A", "B"), help="PSNR and SSIM of two pictures"
    )
    suite = verb.add_argument_group("all methods on all sequences of a folder")
    suite.add_argument(
        "--suite",
        metavar="DIR",
        help="sequences with truth: pictures and flow files that end in numbers",
    )
    suite.add_argument(
        "-o", "--output", metavar="OUT", help="write OUT.md and OUT.json"
    )
    suite.add_argument(
        "--methods",
        nargs="+",
        metavar="M",
        help="NAME or NAME:parameter=value,...; default all of ours",
    )
    suite.add_argument(
        "--rivals",
        action="store_true",
        help='OpenCV and scikit-image too (pip install "unsmear[bench]")',
    )
    suite.add_argument(
        "--runs",
        type=int,
        default=2,
        metavar="N",
        help="the shortest counts; default 2",
    )


def run(options: argparse.Namespace) -> None:
    """Compare and print."""
    kinds = [bool(options.files), bool(options.images), bool(options.suite)]
    if sum(kinds) > 1:
        msg = "give one of FLOW TRUTH, --images A B and --suite DIR"
        raise ValueError(msg)
    if options.suite:
        _run_suite(options)
        return
    if options.images:
        a, b = map(read_image, options.images)
        result: dict[str, Any] = {
            "psnr": metrics.psnr(a, b),
            "ssim": metrics.ssim(a, b),
        }
        _common.show_result(result, as_json=options.json)
        return
    if len(options.files) != 2:
        msg = f"FLOW TRUTH must be two files, got {len(options.files)}"
        raise ValueError(msg)
    flow, truth = map(read_flow, options.files)
    mask = _mask(options, truth)
    result = metrics.flow_errors(flow, truth, mask)
    if options.confidence:
        confidence = (
            np.load(options.confidence, allow_pickle=False)
            if options.confidence.endswith(".npy")
            else read_image(options.confidence)
        )
        result["sparsification"] = metrics.sparsification(
            flow, confidence, truth, mask=mask
        )
    _common.show_result(result, as_json=options.json)


def _run_suite(options: argparse.Namespace) -> None:
    result = evaluate_suite(
        options.suite,
        methods=options.methods,
        rivals=options.rivals,
        runs=options.runs,
        report=lambda line: print(line, file=sys.stderr),
    )
    plain = json.dumps(plain_data(result), indent=1) + "\n"
    table = markdown(result)
    if options.output:
        output = Path(options.output)
        if output.suffix in _SUITE_SUFFIXES:
            output = output.with_suffix("")
        for suffix, text in zip(_SUITE_SUFFIXES, (table, plain), strict=True):
            path = output.with_name(output.name + suffix)
            write_bytes_atomic(path, text.encode())
    print(plain if options.json else table, end="")


def _mask(options: argparse.Namespace, truth: Any) -> Any:
    fast = np.hypot(truth[..., 0], truth[..., 1]) >= options.min_speed
    if not options.mask:
        return fast
    mask = read_image(options.mask)
    if mask.shape != fast.shape:
        msg = f"mask must have shape {fast.shape}, got {mask.shape}"
        raise ValueError(msg)
    return fast & (mask != 0)
