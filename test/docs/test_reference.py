# SPDX-License-Identifier: Apache-2.0
"""The pages that come from the code are up to date; `make reference` makes them so."""

import sys

import pytest
from docs.shown import ROOT
from programs import output_of

pytestmark = pytest.mark.slow

PAGES = ("commands", "launch", "nodes")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The pages, written anew in a process of its own: it starts every node once."""
    folder = tmp_path_factory.mktemp("reference")
    output_of(sys.executable, ROOT / "docs" / "tools" / "write_reference.py", folder)
    return folder


@pytest.mark.parametrize("page", PAGES)
def test_page_is_up_to_date(page, written):
    shipped = (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8")
    assert shipped == (written / f"{page}.md").read_text(encoding="utf-8"), "run `make reference`"
