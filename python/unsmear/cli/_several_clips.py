"""``unsmear deblur`` of several clips: here one after the other, or over a cluster."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from unsmear._progress import ProgressBar
from unsmear.cli import _common
from unsmear.streaming.several_clips import (
    clips_among,
    one_after_another,
    targets_in,
)

if TYPE_CHECKING:
    import argparse
    from collections.abc import Generator

    from unsmear.streaming.several_clips import ClipOutcome, Job

_FAILED = 1
SHOWN = 3
"""Clips at work whose names fit on the line of progress."""
NOTES = 2
"""Verdicts and warnings on the line that tells of a clip."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verb.add_argument(
        "--each",
        action="store_true",
        help="every FRAMES, and every match of a glob, is a clip of its own: for "
        "stacks and animations; several videos or folders are that anyway",
    )
    verb.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="restore clips over the dask.distributed cluster of this scheduler, or "
        "'local': one on this machine, a process per processor",
    )


def jobs_of(options: argparse.Namespace) -> list[Job] | None:
    """Return source and target of every clip; None for one clip to be restored here."""
    clips = clips_among(options.frames, each=options.each)
    if clips is None and not options.scheduler:
        return None
    if options.report:
        raise ValueError(
            "--report must be left out for several clips and with --scheduler, got "
            f"{options.report!r}; --json prints what was found and done"
        )
    if clips is None:
        return [(_common.source_of(options), options.output)]
    folder = Path(options.output)
    if folder.suffix and not folder.is_dir() and not options.output.endswith("/"):
        raise ValueError(
            f"output must be a folder for {len(clips)} clips, got {options.output!r}; "
            "put a slash behind it if it is to be one"
        )
    targets = targets_in(options.output, clips)
    folder.mkdir(parents=True, exist_ok=True)
    return list(zip(clips, targets, strict=True))


def run(options: argparse.Namespace, jobs: list[Job], given: dict[str, Any]) -> int:
    """Restore clips, tell what became of each, and return the exit status."""
    shares = dict.fromkeys(range(len(jobs)), 0.0)
    results: list[dict[str, Any]] = []
    failed = 0
    with ProgressBar("deblur") as bar:

        def progress(number: int, share: float) -> None:
            shares[number] = share
            bar(sum(shares.values()) / len(jobs), note=_at_work(jobs, shares))

        outcomes = _outcomes(options.scheduler, jobs, progress, given)
        with closing(outcomes):
            for outcome in outcomes:
                progress(outcome.number, 1.0)
                failed += outcome.error is not None
                results.append(_told(outcome))
                if outcome.error is not None:
                    name = _name(outcome.source)
                    bar.say(f"unsmear: {name}: {outcome.error}", sys.stderr)
                elif not options.json:
                    bar.say(_line(results[-1]), sys.stdout)
    summary: dict[str, Any] = {
        "clips": len(jobs),
        "failed": failed,
        "written": options.output,
    }
    if options.json:
        summary["results"] = sorted(results, key=lambda one: one["number"])
    _common.show_result(summary, as_json=options.json)
    return _FAILED if failed else 0


def _outcomes(
    scheduler: str | None, jobs: list[Job], progress: Any, given: dict[str, Any]
) -> Generator[ClipOutcome, None, None]:
    if scheduler is None:
        return one_after_another(jobs, progress=progress, **given)
    from unsmear.dask.clips import deblur_clips

    return deblur_clips(jobs, scheduler=scheduler, progress=progress, **given)


def _name(source: str | list[str]) -> str:
    return source if isinstance(source, str) else f"{source[0]} ..."


def _at_work(jobs: list[Job], shares: dict[int, float]) -> str:
    running = [number for number, share in shares.items() if 0 < share < 1]
    names = [
        f"{Path(_name(jobs[number][0])).name} {shares[number]:.0%}"
        for number in running[:SHOWN]
    ]
    finished = sum(share >= 1 for share in shares.values())
    return ", ".join([f"{finished} of {len(jobs)} clips", *names])


def _told(outcome: ClipOutcome) -> dict[str, Any]:
    """Return what became of a clip as plain data."""
    told: dict[str, Any] = {
        "number": outcome.number,
        "source": outcome.source,
        "error": outcome.error,
    }
    made = outcome.result
    if made is None:
        return told
    return told | {
        "written": outcome.target,
        "frames": made.count,
        "taken up at frame": made.taken_up_at,
        **_common.found_in(made),
        "reports": made.reports,
    }


def _line(told: dict[str, Any]) -> str:
    notes = [*told["verdicts"], *told["warnings"]]
    parts = [f"{told['frames']} frames", *notes[:NOTES]]
    if told["taken up at frame"]:
        parts.insert(1, f"taken up at {told['taken up at frame']}")
    if len(notes) > NOTES:
        parts.append(f"and {len(notes) - NOTES} more notes (--json)")
    return f"{_name(told['source'])} -> {told['written']}  {'; '.join(parts)}"
