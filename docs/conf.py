# SPDX-License-Identifier: Apache-2.0
"""The site: `make docs` builds it from the repository's root, so that all links lead somewhere.

Nothing is fetched, neither while it is built nor while it is read.
"""

import re
import sys
from pathlib import Path
from typing import NewType

import numpy.typing
from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS / "tools")]

project = "intent_recognition"
author = "the maintainers of intent_recognition"
copyright = "the authors; Apache-2.0"
release = re.search(
    r'^__version__ = "([^"]+)"',
    (ROOT / "intent_recognition" / "__init__.py").read_text(encoding="utf-8"),
    re.MULTILINE,
)[1]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "sphinx_copybutton",
    "formulae",
]
root_doc = "docs/index"
include_patterns = [
    "docs/**",
    "README.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "CHANGELOG.rst",
    "bags/README.md",
]
exclude_patterns = [
    "docs/tools",
    "docs/images",
    "docs/templates",
    "docs/gallery/*.ipynb",
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


def shown_by_name(name: str) -> NewType:
    """A type of numpy that the reference shows by its name, and not by what it stands for."""
    shown = NewType(name, object)
    shown.__module__ = "builtins"
    return shown


class NDArray:
    """Stands for `numpy.typing.NDArray` while the site is built."""

    def __class_getitem__(cls, scalar: object) -> NewType:
        """An array of any scalar."""
        return shown_by_name("NDArray")


numpy.typing.ArrayLike = shown_by_name("ArrayLike")
numpy.typing.NDArray = NDArray


# The API: one page for each name of `import intent_recognition as ir`, from its docstring.
templates_path = [str(DOCS / "templates")]
default_role = "py:obj"  # `learn` links to its page; what has no page is shown as code
add_module_names = False
autodoc_typehints = "description"
autodoc_typehints_format = "short"
autodoc_typehints_description_target = "documented_params"  # and what is returned
python_use_unqualified_type_names = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# The gallery: `examples/` is run while the site is built.
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "docs/gallery",
    "filename_pattern": "/",
    "within_subsection_order": "FileNameSortKey",
    "reset_modules": ("matplotlib", "gallery_style.apply"),
    "image_srcset": ["2x"],
    "write_computation_times": False,
    "doc_module": ("intent_recognition",),
    "reference_url": {"intent_recognition": None},
    "backreferences_dir": "docs/gallery/backreferences",
    "show_memory": False,
    "min_reported_time": 10.0,
    "remove_config_comments": True,
    "abort_on_example_error": True,
}

copybutton_selector = "div.highlight-bash pre, div.highlight-python pre, div.highlight-yaml pre"
"""What can be run or written; what is printed cannot."""

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
    """GitHub shows a folder where a link leads to one; of these the site has the examples only."""
    here = (ROOT / name).parent

    def shown(link: re.Match) -> str:
        folder = (here / link[2]).resolve()
        if folder == ROOT / "examples":
            return f"[{link[1]}](/docs/gallery/index.rst)"
        return link[1] if folder.is_dir() else link[0]

    source[0] = re.sub(r"\[([^\]]+)\]\(([^)#\s:]+)\)", shown, source[0])


def skip_fields(app: Sphinx, what: str, name: str, member: object, skip: bool, options) -> bool:
    """Fields of a named tuple are described in the class's docstring."""
    return skip or type(member).__name__ == "_tuplegetter"


def dashes_in_fields(app: Sphinx, tree: nodes.document, name: str) -> None:
    """Sphinx writes `name -- description` and leaves the dash to smartquotes, which is off here."""
    for text in list(tree.findall(lambda node: isinstance(node, nodes.Text) and node == " -- ")):
        text.parent.replace(text, nodes.Text(": "))


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("doctree-resolved", dashes_in_fields)
    app.add_lexer("mermaid", TextLexer)
    app.connect("source-read", picture_for_mermaid)
    app.connect("source-read", text_for_folders)
