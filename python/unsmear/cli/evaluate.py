"""``unsmear evaluate``: flow against the truth, or one picture against another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import metrics
from unsmear.cli import _common
from unsmear.flow_files import read_flow
from unsmear.images import read_image

if TYPE_CHECKING:
    import argparse

SUMMARY = "compare a flow field with the truth, or two pictures"
EXAMPLE = "unsmear evaluate flow.flo truth.flo --mask land.png"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
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


def run(options: argparse.Namespace) -> None:
    """Compare and print."""
    if options.images:
        if options.files:
            msg = "give FLOW TRUTH or --images A B, not both"
            raise ValueError(msg)
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


def _mask(options: argparse.Namespace, truth: Any) -> Any:
    fast = np.hypot(truth[..., 0], truth[..., 1]) >= options.min_speed
    if not options.mask:
        return fast
    mask = read_image(options.mask)
    if mask.shape != fast.shape:
        msg = f"mask must have shape {fast.shape}, got {mask.shape}"
        raise ValueError(msg)
    return fast & (mask != 0)
