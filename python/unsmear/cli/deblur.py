"""``unsmear deblur``: blurred frames in, restored frames out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import plot
from unsmear._atomic import write_bytes_atomic
from unsmear._plain_data import plain_data
from unsmear._progress import ProgressBar
from unsmear.cli import _common, _several_clips
from unsmear.deblur import METHODS
from unsmear.flow_files import read_flow
from unsmear.sequence import JOINT
from unsmear.streaming.deblur_clip import deblur_clip

if TYPE_CHECKING:
    import argparse

    from unsmear.streaming.results import ClipResult

SUMMARY = "remove the motion blur of every frame"
MEMORY = """memory, whatever the number of frames of W x H pixels: about 110 MiB,
33 frames as stored, and 1700 W H bytes ("auto"; up to as much again for each further
exposure or pass tried, at most five) or 350 W H bytes ("wiener"); the report of
every frame takes some kilobytes"""
EXAMPLE = "unsmear deblur clip.mp4 -o sharp/ --report report.html"

AUTOMATIC = "auto"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.description = f"{SUMMARY}\n\n{MEMORY}"
    _common.add_frames(verb)
    verb.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="OUT",
        help="folder, .tif, .gif or video; for several clips a folder",
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
        default=3,
        help="frames restored together by the method auto; default %(default)s, and 1 "
        "takes half the time",
    )
    verb.add_argument(
        "--noise", type=float, help="standard deviation; default measured"
    )
    verb.add_argument("--flow", help="flow file to use for all frames, not measured")
    verb.add_argument(
        "--report",
        metavar="FILE",
        help="what was found and done; .json, or .html with up to 24 of the frames",
    )
    verb.add_argument(
        "--resume",
        action="store_true",
        help="go on where a run with the same frames and options was broken off, and "
        "keep what is finished (in OUT.part) should this one be",
    )
    verb.add_argument(
        "--fps", type=float, help="frames per second of frames without a clock; 25"
    )
    verb.add_argument(
        "--no-audio",
        dest="audio",
        action="store_false",
        help="leave the sound of a video out",
    )
    _common.add_flow_method(verb, "--flow-method", "balanced")
    _several_clips.add_arguments(verb)


def run(options: argparse.Namespace) -> int | None:
    """Measure, restore and write."""
    page = bool(options.report) and not options.report.endswith(".json")
    given: dict[str, Any] = {
        "method": options.method,
        "exposure": options.exposure,
        "flow": read_flow(options.flow) if options.flow else None,
        "flow_method": options.flow_method,
        "joint": options.joint,
        "noise": options.noise,
        "fps": options.fps,
        "audio": options.audio,
        "resume": options.resume,
        **_common.parameters_of(options),
    }
    jobs = _several_clips.jobs_of(options)
    if jobs is not None:
        return _several_clips.run(options, jobs, given)
    with ProgressBar("deblur") as bar:
        made = deblur_clip(
            _common.source_of(options),
            options.output,
            samples=page,
            progress=bar,
            **given,
        )
    if options.report:
        _write_report(options, made)
    result: dict[str, Any] = {
        "frames": made.count,
        "method": options.method,
        **_common.found_in(made),
        "written": options.output,
    }
    if options.resume:
        result["taken up at frame"] = made.taken_up_at
    if options.json:
        result["reports"] = made.reports
    _common.show_result(result, as_json=options.json)
    return None


def _exposure(text: str) -> float | str:
    return text if text == AUTOMATIC else float(text)


def _write_report(options: argparse.Namespace, made: ClipResult) -> None:
    """Write the reports: all of them as JSON, or a page to look at."""
    path = options.report
    if path.endswith(".json"):
        text = json.dumps(plain_data(made.reports), indent=2, allow_nan=False)
        write_bytes_atomic(path, text.encode())
        return
    plot.report(
        path,
        np.stack([sample.blurred for sample in made.samples]),
        restored=np.stack([sample.restored for sample in made.samples]),
        flows=[sample.flow for sample in made.samples],
        confidences=[sample.confidence for sample in made.samples],
        exposure=float(np.mean([report["exposure"] for report in made.reports])),
        verdicts=[
            f"frame {sample.index}: {text}"
            for sample in made.samples
            for text in _said_of(made.reports[sample.index])
        ],
        parameters={
            "sha256": _common.digests_of(options),
            "frames": plain_data(made.reports),
        },
        command=options.command,
        title="unsmear deblur",
    )


def _said_of(report: dict[str, Any]) -> list[str]:
    return [
        text for text in (report.get("verdict"), *report.get("warnings", [])) if text
    ]
