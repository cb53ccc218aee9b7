# SPDX-License-Identifier: Apache-2.0
"""The Python that README and docs show: it parses, and what it imports is there.

The README's program is run, too: test/packaging/test_light.py.
"""

import ast
import re
import runpy

import pytest
from docs.shown import PAGES, ROOT

BLOCK = re.compile(r"^ *```python\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
EXAMPLES = [
    pytest.param(block, id=f"{page.relative_to(ROOT)}, {number}")
    for page in PAGES
    for number, block in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")))
]


@pytest.mark.parametrize("block", EXAMPLES)
def test_what_it_imports_is_there(block):
    tree = ast.parse(block)
    imports = [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    exec(compile(ast.Module(imports, []), "example", "exec"), {})


GALLERY = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("example", GALLERY, ids=lambda path: path.stem)
def test_an_example_of_the_gallery_runs(example, monkeypatch):
    """The site runs them, too; here without drawing anything to a file."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.syspath_prepend(str(example.parent))
    monkeypatch.chdir(example.parent)
    monkeypatch.setattr(pyplot, "show", lambda: None)
    try:
        runpy.run_path(str(example), run_name="__main__")
        assert pyplot.get_fignums() or example.stem == "10_a_real_recording"
    finally:
        pyplot.close("all")
