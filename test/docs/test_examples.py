# SPDX-License-Identifier: Apache-2.0
"""Python of README and docs, pages made from the code, and what is documented of it."""

import ast
import re
import runpy
import sys

import pytest
from docs.shown import PAGES, ROOT
from programs import output_of

from intent_recognition.learning import training
from intent_recognition.registry import NODES

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
    monkeypatch.setattr(training, "PACES", ("steady", "aligned"))
    try:
        runpy.run_path(str(example), run_name="__main__")
        assert pyplot.get_fignums() or example.stem == "10_a_real_recording"
    finally:
        pyplot.close("all")


@pytest.fixture(scope="module")
def written(once):
    """The pages, written anew in a process of its own: it starts every node once."""
    script = ROOT / "docs" / "tools" / "write_reference.py"
    return once("reference", lambda folder: output_of(sys.executable, script, folder))


@pytest.mark.slow
@pytest.mark.parametrize("page", ["commands", "launch", "nodes"])
def test_page_is_up_to_date(page, written):
    shipped = (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8")
    assert shipped == (written / f"{page}.md").read_text(encoding="utf-8"), "run `make reference`"


TOPICS = (ROOT / "docs" / "topics.md").read_text(encoding="utf-8").replace("<body>", "{body}")
REASON = re.compile(r"""(?:reject|rejecting|diagnostics.count|RejectionError)\(\s*"(\w+)\"""")


def test_every_topic_of_a_node_is_listed():
    published = {topic for node in NODES.values() for topic in node.publishes}
    other = {"/tf", "/tf_static", "mocap/wrist/pose", "{sampled}"}  # under another heading or name
    assert other <= published
    assert not [topic for topic in sorted(published - other) if f"`{topic}`" not in TOPICS]


def test_every_reason_to_reject_is_named():
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    sources = [
        path.read_text(encoding="utf-8")
        for folder in ("intent_recognition", "sim_bridge")
        for path in (ROOT / folder).rglob("*.py")
    ]
    reasons = {reason for source in sources for reason in REASON.findall(source)}
    assert len(reasons) > 50
    assert not [reason for reason in sorted(reasons) if f"`{reason}`" not in pages]


def undocumented(path):
    """The numbers at the top of a file that nothing is said of; several may share a docstring."""
    waiting = []
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if is_number(statement):
            waiting.append(statement.targets[0].id)
            continue
        text = statement.value if isinstance(statement, ast.Expr) else None
        if not (isinstance(text, ast.Constant) and isinstance(text.value, str)):
            yield from waiting
        waiting = []
    yield from waiting


def is_number(statement):
    """Whether it gives a name in capitals numbers only."""
    if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)):
        return False
    inside = list(ast.walk(statement.value))
    leaves = [node.value for node in inside if isinstance(node, ast.Constant)]
    return (
        statement.targets[0].id.isupper()
        and bool(leaves)
        and all(type(leaf) in (int, float) for leaf in leaves)
        and not any(isinstance(node, (ast.Name, ast.Call)) for node in inside)
    )


def test_every_constant_has_a_docstring():
    files = (p for top in ("intent_recognition", "sim_bridge") for p in (ROOT / top).rglob("*.py"))
    assert [f"{path}: {name}" for path in files for name in undocumented(path)] == []
