"""The command line's help, from the program itself: ``.. command-line::``."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

from docutils import nodes
from sphinx.util.docutils import SphinxDirective
from unsmear.cli import parser

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WIDTH = 88  # columns of a help text


class CommandLine(SphinxDirective):
    """Show the help of the program and of each of its verbs."""

    def run(self) -> list[nodes.Node]:
        """Return a section per verb."""
        os.environ["COLUMNS"] = str(WIDTH)
        top = parser()
        content: list[nodes.Node] = [listing(top)]
        verbs = next(
            action
            for action in top._actions
            if isinstance(action, argparse._SubParsersAction)
        )
        for name, verb in verbs.choices.items():
            section = nodes.section(ids=[f"unsmear-{name}"])
            section += nodes.title("", f"unsmear {name}")
            section += listing(verb)
            content.append(section)
        return content


def listing(of: argparse.ArgumentParser) -> nodes.literal_block:
    """Return a parser's help as it appears on a terminal."""
    text = of.format_help()
    return nodes.literal_block(text, text, language="text")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
