"""The command line: ``unsmear VERB ...``, one module per verb.

Exit status: 0 good, 1 failed (the reason is on standard error), 2 wrong usage. With
``--json`` the result is one JSON document on standard output.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from typing import TYPE_CHECKING, NoReturn

from unsmear.cli import _about, _completion, convert, deblur, demo, evaluate, flow, show

if TYPE_CHECKING:
    from collections.abc import Sequence

_VERBS = (demo, flow, deblur, evaluate, show, convert)
_FAILED, _INTERRUPTED = 1, 130


class _Version(argparse.Action):
    """Print what is installed, found out only when asked, and stop."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        try:
            print(_about.about())
        except ValueError as error:
            parser.exit(_FAILED, f"unsmear: {error}\n")
        parser.exit(0)


def parser() -> argparse.ArgumentParser:
    """Return the parser of all verbs."""
    top = argparse.ArgumentParser(
        prog="unsmear",
        description="Measure motion in image sequences and remove the blur it leaves.",
    )
    top.add_argument(
        "--version", action=_Version, nargs=0, help="version and what it runs under"
    )
    top.add_argument(
        "--print-completion",
        action=_completion.PrintCompletion,
        choices=_completion.SHELLS,
        metavar="SHELL",
        help="print the script that completes options: %(choices)s",
    )
    verbs = top.add_subparsers(dest="verb", metavar="VERB", required=True)
    for module in _VERBS:
        name = module.__name__.rpartition(".")[2]
        verb = verbs.add_parser(
            name,
            help=module.SUMMARY,
            description=module.SUMMARY,
            epilog=f"example:\n  {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(verb)
        verb.add_argument(
            "--json", action="store_true", help="print the result as JSON"
        )
        verb.set_defaults(run=module.run)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser().parse_args(given)
    options.command = shlex.join(["unsmear", *given])
    try:
        status: int | None = options.run(options)
    except KeyboardInterrupt:
        print("unsmear: interrupted", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:
        return _FAILED
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        print(f"unsmear: {_said(error)}", file=sys.stderr)
        return _FAILED
    return status or 0


def _said(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__


def entry() -> NoReturn:
    """Run the command line and end the process."""
    status = main()
    if status == _INTERRUPTED:
        # All is put away; the interpreter would take as long again over its modules.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)
