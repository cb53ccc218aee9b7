# SPDX-License-Identifier: Apache-2.0
"""The site: `make docs` builds it from the repository's root, so that all links lead somewhere.

Nothing is fetched, neither while it is built nor while it is read.
"""

import re
import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "tools"))

project = "intent_recognition"
author = "the maintainers of intent_recognition"
copyright = "the authors; Apache-2.0"
release = re.search(
    r'^__version__ = "([^"]+)"',
    (ROOT / "intent_recognition" / "__init__.py").read_text(encoding="utf-8"),
    re.MULTILINE,
)[1]

extensions = ["myst_parser", "formulae"]
root_doc = "docs/index"
include_patterns = ["docs/**", "README.md", "CONTRIBUTING.md", "CHANGELOG.rst", "bags/README.md"]
exclude_patterns = [
    "docs/tools",
    "docs/images",
    ".*",
    "out",
    "venv",
    "build",
    "install",
    "log",
    "bags/*/**",
]

myst_heading_anchors = 4
myst_fence_as_directive = ["math"]
html_math_renderer = "drawings"

highlight_language = "text"
smartquotes_action = "qe"  # but not dashes: `--json` is an option

html_theme = "furo"
html_title = f"{project} {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_extra_path = ["entrance"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
pygments_dark_style = "native"

GRAPH = "![The nodes and the topics between them](docs/images/graph.svg)"


def picture_for_mermaid(app: Sphinx, name: str, source: list[str]) -> None:
    """GitHub draws the README's graph by a script; here it is the same graph as a picture."""
    if name == "README":
        source[0] = re.sub(r"```mermaid\n.*?```", GRAPH, source[0], flags=re.DOTALL)


def text_for_folders(app: Sphinx, name: str, source: list[str]) -> None:
    """GitHub shows a folder where a link leads to one; a site has no page of it."""
    here = (ROOT / name).parent

    def shown(link: re.Match) -> str:
        return link[1] if (here / link[2]).is_dir() else link[0]

    source[0] = re.sub(r"\[([^\]]+)\]\(([^)#\s:]+)\)", shown, source[0])


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.add_lexer("mermaid", TextLexer)
    app.connect("source-read", picture_for_mermaid)
    app.connect("source-read", text_for_folders)
