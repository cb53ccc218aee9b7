# SPDX-License-Identifier: Apache-2.0
"""The Python that README and docs show: it parses, and what it imports is there."""

import ast
import re

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


def test_reading_columns_works_as_shown(tmp_path, monkeypatch):
    (block,) = BLOCK.findall((ROOT / "docs" / "bags.md").read_text(encoding="utf-8"))
    bag = ROOT / "bags" / "toolbox" / "test" / "plate_handover_03"
    (tmp_path / bag.name).symlink_to(bag)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(block, names)
    assert names["found"]["mocap/wrist/pose"].positions.shape[1] == 3
    assert names["found"]["joint_states"].parts[0].position.shape[1] == 7
