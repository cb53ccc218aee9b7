# SPDX-License-Identifier: Apache-2.0
"""The figures of README and docs are those of docs/figures.json, which commands write."""

import re
import sys

import pytest
from docs.shown import ROOT

sys.path.append(str(ROOT / "docs" / "tools"))
import figures


@pytest.mark.parametrize("path", figures.PAGES, ids=lambda path: path.name)
def test_a_page_shows_what_was_measured(path):
    page = path.read_text(encoding="utf-8")
    assert figures.with_figures(page, figures.load()) == page, "run docs/tools/figures.py --write"


def test_every_figure_has_a_command_and_is_shown():
    kept = figures.load()
    assert set(kept) <= set(figures.SOURCES)
    for name, figure in kept.items():
        assert figure["command"].split(" --")[0] in figures.SOURCES[name].command
    pages = "".join(path.read_text(encoding="utf-8") for path in figures.PAGES)
    assert set(re.findall(r"<!-- figures (\S+) -->", pages)) == set(figures.SOURCES)


def test_a_figure_that_is_missing_or_old_is_marked():
    page = "<!-- figures demo -->\n<!-- end -->\n1<!--demo.n-->"
    assert '*Not measured yet: `make figures FIGURES="demo"`.*' in figures.with_figures(page, {})
    assert "?<!--demo.n-->" in figures.with_figures(page, {})
    old = {"demo": {"text": "a", "version": "0.1.0", "values": {"n": "2"}}}
    assert "```\n\n*Measured with version 0.1.0.*\n<!-- end -->" in figures.with_figures(page, old)
