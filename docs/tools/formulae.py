# SPDX-License-Identifier: Apache-2.0
"""Formulae as drawings inside the page: no script, no font and no network, the same everywhere."""

from functools import lru_cache
from html import escape

from docutils import nodes
from matplotlib import rc_context
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextPath
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

SIZE = 100.0
"""Units of a drawing in one em of its font."""
FONT = FontProperties(math_fontfamily="cm")
LETTERS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C"}
MARGIN = 4.0


@lru_cache
def drawing(formula: str) -> str:
    """An SVG of a formula; it takes the colour and the size of the text around it.

    Raises:
        ValueError: matplotlib's mathtext, a part of LaTeX, does not know something in it.
    """
    one_line = " ".join(formula.split())
    drawn = one_line.replace(r"\top", r"{\!\top\!}")  # which mathtext sets apart, as a relation
    with rc_context({"text.parse_math": True}):  # which the examples of the gallery switch off
        outline = TextPath((0, 0), f"${drawn}$", size=SIZE, prop=FONT)
    box = outline.cleaned(curves=False).get_extents().padded(MARGIN)  # of lines: far faster
    place = f"{box.x0:.0f} {-box.y1:.0f} {box.width:.0f} {box.height:.0f}"
    style = (
        f"width:{box.width / SIZE:.3f}em;height:{box.height / SIZE:.3f}em;"
        f"vertical-align:{box.y0 / SIZE:.3f}em"
    )
    return (
        f'<svg class="formula" role="img" aria-label="{escape(one_line)}" viewBox="{place}"'
        f' style="{style}"><path fill="currentColor" d="{_commands(outline)}"/></svg>'
    )


def _commands(outline: Path) -> str:
    parts = []
    for points, code in outline.iter_segments(curves=True):
        if code == Path.CLOSEPOLY:
            parts.append("Z")
            continue
        numbers = (f"{x:.0f} {-y:.0f}" for x, y in points.reshape(-1, 2))
        parts.append(LETTERS[code] + " ".join(numbers))
    return "".join(parts)


def visit_inline(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line."""
    translator.body.append(drawing(node.astext()))
    raise nodes.SkipNode


def visit_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula of its own."""
    translator.body.append(f'<div class="math">{drawing(node.astext())}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_html_math_renderer("drawings", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
