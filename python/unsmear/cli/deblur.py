"""``unsmear deblur``: blurred frames in, restored frames out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import plot
from unsmear._atomic import write_bytes_atomic
from unsmear._plain_data import plain_data
from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.deblur import METHODS, deblur
from unsmear.flow_files import read_flow
from unsmear.sequence import FLOW_METHODS, JOINT, deblur_sequence
from unsmear.sequences import write_frames
from unsmear.velocity import velocity_of_frame

if TYPE_CHECKING:
    import argparse

    from numpy.typing import NDArray

SUMMARY = "remove the motion blur of every frame"
EXAMPLE = "unsmear deblur clip.mp4 -o sharp/ --report report.html"

AUTOMATIC = "auto"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    _common.add_frames(verb)
    verb.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="folder, .tif or video"
    )
    verb.add_argument(
        "--exposure",
        type=_exposure,
        default=AUTOMATIC,
        help="share of the frame interval the shutter was open; default auto",
    )
    verb.add_argument(
        "--method",
        choices=(AUTOMATIC, *METHODS),
        default=AUTOMATIC,
        help="auto (default): the whole chain, which leaves alone what would not get "
        "better; the others restore every frame by itself, whatever comes of it",
    )
    verb.add_argument(
        "--joint",
        type=int,
        choices=JOINT,
        default=JOINT[0],
        help="frames restored together by the method auto; default %(default)s",
    )
    verb.add_argument(
        "--noise", type=float, help="standard deviation; default measured"
    )
    verb.add_argument("--flow", help="flow file to use for all frames, not measured")
    verb.add_argument(
        "--report", metavar="FILE", help="what was found and done; .html or .json"
    )
    _common.add_flow_method(verb, "--flow-method", "balanced")


def run(options: argparse.Namespace) -> None:
    """Measure, restore and write."""
    frames = _common.frames_of(options)
    with ProgressBar("deblur") as bar:
        if options.method == AUTOMATIC and not options.flow:
            restored, flows, reports = _whole_chain(options, frames, bar)
        else:
            restored, flows, reports = _frame_by_frame(options, frames, bar)
    write_frames(options.output, restored)
    if options.report:
        _write_report(options, frames, restored, flows, reports)
    warnings = {text for report in reports for text in report.get("warnings", [])}
    result: dict[str, Any] = {
        "frames": len(frames),
        "method": options.method,
        "exposure": float(np.mean([report["exposure"] for report in reports])),
        "verdicts": sorted({report["verdict"] for report in reports})
        if "verdict" in reports[0]
        else [],
        "warnings": sorted(warnings),
        "written": options.output,
    }
    if options.json:
        result["reports"] = reports
    _common.show_result(result, as_json=options.json)


def _exposure(text: str) -> float | str:
    return text if text == AUTOMATIC else float(text)


def _whole_chain(
    options: argparse.Namespace, frames: NDArray[Any], bar: ProgressBar
) -> tuple[NDArray[Any], list[NDArray[np.float32]], list[dict[str, Any]]]:
    if len(frames) < 2:
        msg = "one frame alone shows no motion: give more frames, or --flow"
        raise ValueError(msg)
    if options.flow_method not in FLOW_METHODS:
        names = ", ".join(FLOW_METHODS)
        msg = (
            f"--flow-method must be one of {names} for the method auto, "
            f"got {options.flow_method}"
        )
        raise ValueError(msg)
    result = deblur_sequence(
        frames,
        exposure=options.exposure,
        flow_method=options.flow_method,
        joint=options.joint,
        noise=options.noise,
        channel_axis=_common.channel_axis_of(frames),
        progress=bar,
        **_common.parameters_of(options),
    )
    return result.frames, list(result.flows), result.reports


def _frame_by_frame(
    options: argparse.Namespace, frames: NDArray[Any], bar: ProgressBar
) -> tuple[NDArray[Any], list[NDArray[np.float32]], list[dict[str, Any]]]:
    restored, flows, reports = [], [], []
    method = "tv" if options.method == AUTOMATIC else options.method
    for index, frame in enumerate(frames):
        flows.append(_flow_of(options, frames, index))
        result = deblur(
            frame,
            flows[-1],
            exposure=options.exposure,
            method=method,
            noise=options.noise,
            channel_axis=2 if frames.ndim == 4 else None,
        )
        restored.append(result.image)
        reports.append(result.report)
        bar((index + 1) / len(frames))
    return np.stack(restored), flows, reports


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


def _write_report(
    options: argparse.Namespace,
    frames: NDArray[Any],
    restored: NDArray[Any],
    flows: list[NDArray[np.float32]],
    reports: list[dict[str, Any]],
) -> None:
    """Write the reports: all of them as JSON, or a page to look at."""
    path = options.report
    if path.endswith(".json"):
        text = json.dumps(plain_data(reports), indent=2, allow_nan=False)
        write_bytes_atomic(path, text.encode())
        return
    plot.report(
        path,
        frames,
        restored=restored,
        flows=flows,
        exposure=float(np.mean([report["exposure"] for report in reports])),
        verdicts=[
            f"frame {number}: {text}"
            for number, report in enumerate(reports)
            for text in (report.get("verdict"), *report.get("warnings", ()))
            if text
        ],
        parameters={"frames": plain_data(reports)},
        command=options.command,
        title="unsmear deblur",
    )
