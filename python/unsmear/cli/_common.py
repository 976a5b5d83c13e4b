"""What several verbs share: sources of frames, method parameters, printing."""

from __future__ import annotations

import hashlib
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._parameters import PARAMETERS, of_pairs
from unsmear._plain_data import plain_data
from unsmear.frame_files import located

if TYPE_CHECKING:
    import argparse

    from numpy.typing import NDArray

    from unsmear.streaming.results import ClipResult

FRAMES_HELP = "folder, glob in quotes, picture files, image stack or video"


def add_frames(verb: argparse.ArgumentParser) -> None:
    """Add the positional FRAMES."""
    verb.add_argument("frames", nargs="+", metavar="FRAMES", help=FRAMES_HELP)


def source_of(options: argparse.Namespace) -> str | list[str]:
    """Return FRAMES; one name may be a folder, a glob, a stack or a video."""
    names: list[str] = options.frames
    return names[0] if len(names) == 1 else names


def digests_of(options: argparse.Namespace) -> dict[str, str]:
    """Return the SHA-256 of every file that FRAMES names, by its name."""
    found = located(source_of(options))
    digests = {}
    for path in found if isinstance(found, list) else [found]:
        with path.open("rb") as file:
            digests[str(path)] = hashlib.file_digest(file, "sha256").hexdigest()
    return digests


def channel_axis_of(frames: NDArray[Any]) -> int | None:
    """Colour axis of frames as `read_frames` returns them."""
    return 3 if frames.ndim == 4 else None


def add_flow_method(verb: argparse.ArgumentParser, option: str, default: str) -> None:
    """Add the choice of a flow method and its parameters."""
    verb.add_argument(
        option, choices=sorted(PARAMETERS), default=default, help=f"default {default}"
    )
    verb.add_argument(
        "-p",
        "--parameter",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a parameter of the flow method; may be repeated",
    )


def parameters_of(options: argparse.Namespace) -> dict[str, Any]:
    """Parse NAME=VALUE pairs; a value is JSON if it can be, else text."""
    return of_pairs(options.parameter, "--parameter must look like NAME=VALUE")


def found_in(made: ClipResult) -> dict[str, Any]:
    """Return what the reports of a clip say in common."""
    warnings = {text for report in made.reports for text in report.get("warnings", [])}
    return {
        "exposure": float(np.mean([report["exposure"] for report in made.reports])),
        "verdicts": sorted({r["verdict"] for r in made.reports if "verdict" in r}),
        "warnings": [*made.warnings, *sorted(warnings)],
    }


def show_result(result: dict[str, Any], *, as_json: bool) -> None:
    """Print a result: JSON, or one aligned line per entry but tables, for machines."""
    if as_json:
        print(json.dumps(plain_data(result), indent=2))
        return
    flat = dict(_flatten(result))
    width = max(map(len, flat), default=0)
    for name, value in flat.items():
        print(f"{name:<{width}}  {_text(value)}")


def _flatten(result: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    lines: list[tuple[str, Any]] = []
    for name, value in result.items():
        if isinstance(value, dict):
            lines += _flatten(value, f"{prefix}{name} ")
        elif not (isinstance(value, list) and any(isinstance(v, dict) for v in value)):
            lines.append((f"{prefix}{name}", value))
    return lines


def _text(value: Any) -> str:
    if isinstance(value, float):
        return "unknown" if math.isnan(value) else f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_text, value)) or "none"
    return str(value)
