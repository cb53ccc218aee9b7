# SPDX-License-Identifier: Apache-2.0
"""The pages that come from the code are up to date; `make reference` makes them so."""

import sys

import pytest
from docs.shown import ROOT
from programs import output_of

pytestmark = pytest.mark.slow

PAGES = ("commands", "launch", "nodes")


@pytest.fixture(scope="module")
def written(once):
    """The pages, written anew in a process of its own: it starts every node once."""
    script = ROOT / "docs" / "tools" / "write_reference.py"
    return once("reference", lambda folder: output_of(sys.executable, script, folder))


@pytest.mark.parametrize("page", PAGES)
def test_page_is_up_to_date(page, written):
    shipped = (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8")
    assert shipped == (written / f"{page}.md").read_text(encoding="utf-8"), "run `make reference`"
