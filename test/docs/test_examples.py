# SPDX-License-Identifier: Apache-2.0
"""The Python that README and docs show: it parses, and what it imports is there."""

import ast
import re
import runpy

import pytest
from docs.shown import PAGES, ROOT
from few_functions import aligned_basis

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


@pytest.mark.slow
def test_the_library_works_as_the_readme_shows(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    part = text.split("## Use it as a library\n", 1)[1].split("\n## ", 1)[0]
    (block,) = BLOCK.findall(part)
    (shown,) = re.findall(r"^```text\n(.*?)^```", part, re.MULTILINE | re.DOTALL)
    exec(block, {})
    printed = capsys.readouterr().out
    task = re.compile(r"s: (\w+), ")
    assert task.search(printed)[1] == task.search(shown)[1]
    numbers = [
        [float(number) for number in re.findall(r"-?\d+\.\d+", line)] for line in (printed, shown)
    ]
    assert numbers[0] == pytest.approx(numbers[1], abs=0.03)


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
        with aligned_basis():
            runpy.run_path(str(example), run_name="__main__")
        assert pyplot.get_fignums() or example.stem == "10_a_real_recording"
    finally:
        pyplot.close("all")
