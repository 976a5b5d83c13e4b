"""``unsmear deblur``: blurred frames in, restored frames out."""

from __future__ import annotations

import html
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._atomic import write_bytes_atomic
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
            restored, reports = _whole_chain(options, frames, bar)
        else:
            restored, reports = _frame_by_frame(options, frames, bar)
    write_frames(options.output, restored)
    if options.report:
        _write_report(options.report, reports)
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
) -> tuple[NDArray[Any], list[dict[str, Any]]]:
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
    return result.frames, result.reports


def _frame_by_frame(
    options: argparse.Namespace, frames: NDArray[Any], bar: ProgressBar
) -> tuple[NDArray[Any], list[dict[str, Any]]]:
    restored, reports = [], []
    method = "tv" if options.method == AUTOMATIC else options.method
    for index, frame in enumerate(frames):
        result = deblur(
            frame,
            _flow_of(options, frames, index),
            exposure=options.exposure,
            method=method,
            noise=options.noise,
            channel_axis=2 if frames.ndim == 4 else None,
        )
        restored.append(result.image)
        reports.append(result.report)
        bar((index + 1) / len(frames))
    return np.stack(restored), reports


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


COLUMNS = {
    "verdict": "verdict",
    "exposure": "exposure (frames)",
    "exposure_status": "trust in it",
    "blur_px": "blur (px)",
    "noise": "noise",
    "expected_gain_db": "expected gain (dB)",
    "ringing_risk": "risk of ringing",
}


def _write_report(path: str, reports: list[dict[str, Any]]) -> None:
    """Write the reports: all of them as JSON, or the main figures as a page."""
    if path.endswith(".json"):
        text = json.dumps(reports, indent=2, allow_nan=False)
    else:
        head = "".join(f"<th>{name}</th>" for name in ("frame", *COLUMNS.values()))
        rows = []
        for number, report in enumerate(reports):
            cells = [str(number), *(_cell(report.get(name)) for name in COLUMNS)]
            line = "".join(f"<td>{html.escape(cell)}</td>" for cell in cells)
            rows.append(f"<tr>{line}</tr>")
        text = (
            "<!DOCTYPE html>\n<meta charset='utf-8'>\n<title>unsmear deblur</title>\n"
            "<style>td, th { padding: 0 1em; text-align: left }</style>\n"
            f"<table>\n<tr>{head}</tr>\n" + "\n".join(rows) + "\n</table>\n"
        )
    write_bytes_atomic(path, text.encode())


def _cell(value: Any) -> str:
    if value is None:
        return "unknown"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
