"""Mathematics as MathML: browsers set it themselves, without scripts or fonts.

LaTeX is translated by docutils; what it does not know is a warning, and so an error of
a strict build.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

# docutils takes the digits of \frac12 for one number.
BARE_FRACTION = re.compile(r"(\\[td]?frac)\s*(\d)(\d)")

logger = logging.getLogger(__name__)


def translated(node: nodes.math | nodes.math_block, *, as_block: bool) -> str:
    """Return the MathML of a node."""
    code = BARE_FRACTION.sub(r"\1{\2}{\3}", node.astext())
    if as_block and ("&" in code or r"\\" in code):
        code = rf"\begin{{align}}{code}\end{{align}}"
    try:
        return tex2mathml(code, as_block=as_block)
    except (MathError, SyntaxError) as error:
        logger.warning("mathematics not understood: %s in %r", error, code)
        return f"<code>{code}</code>"


def visit_inline(self: HTML5Translator, node: nodes.math) -> None:
    """Write mathematics within a line."""
    self.body.append(translated(node, as_block=False))
    raise nodes.SkipNode


def visit_block(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write mathematics on lines of its own."""
    self.body.append(f'<div class="math">{translated(node, as_block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer and choose it."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
