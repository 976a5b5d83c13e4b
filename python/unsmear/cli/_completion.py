"""Completion of the command line in the shell: ``unsmear --print-completion bash``."""

from __future__ import annotations

import argparse
from typing import Any

SHELLS = ("bash", "zsh", "tcsh")

# Placeholders that stand for files; the shell offers names of files for them.
_FILES = frozenset(("FRAMES", "FLOW", "OUT", "FILE", "PNG", "PICTURE", "DIR", "A", "B"))


class PrintCompletion(argparse.Action):
    """Print the completion script of a shell and stop."""

    def __call__(self, parser: argparse.ArgumentParser, *given: Any) -> None:
        """Print and exit: 0, or 1 without the library that knows the shells."""
        _, shell, option = given
        try:
            import shtab
        except ImportError:
            parser.exit(
                1,
                f"{parser.prog}: {option} needs shtab: "
                "pip install 'unsmear[completion]'\n",
            )
        _offer_files(parser, shtab.FILE)
        print(shtab.complete(parser, str(shell)))
        parser.exit(0)


def _offer_files(parser: argparse.ArgumentParser, how: Any) -> None:
    """Mark the arguments that name files, in all verbs."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                _offer_files(verb, how)
        elif action.metavar in _FILES:
            action.complete = how  # type: ignore[attr-defined]
