"""Fail the build when a page would load anything from elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from sphinx.errors import ExtensionError

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# What browsers fetch by themselves; links that a reader may follow are no matter.
FETCHED = re.compile(
    r"<(?:script|img|iframe|source|video|audio)\b[^>]*\bsrc=\"(?:https?:)?//[^\"]*"
    r"|<link\b(?![^>]*rel=\"(?:canonical|author|license|edit)\")[^>]*\bhref=\"(?:https?:)?//[^\"]*"
    r"|@import\s+(?:url\()?[\"']?(?:https?:)?//[^\"')]*"
    r"|url\([\"']?(?:https?:)?//[^\"')]*",
    re.IGNORECASE,
)


def from_elsewhere(folder: Path) -> list[str]:
    """Return what pages and style sheets below a folder would fetch."""
    found = []
    for path in sorted(folder.rglob("*")):
        if path.suffix in (".html", ".css"):
            text = path.read_text("utf-8")
            found += [f"{path.name}: {hit[:120]}" for hit in FETCHED.findall(text)]
    return found


def check(app: Sphinx, exception: Exception | None) -> None:
    """Look through the finished site."""
    if exception is None and app.builder.format == "html":
        found = from_elsewhere(Path(app.outdir))
        if found:
            msg = "pages must not load anything from elsewhere:\n" + "\n".join(found)
            raise ExtensionError(msg)


def setup(app: Sphinx) -> dict[str, bool]:
    """Look when the site is finished."""
    app.connect("build-finished", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
