# SPDX-License-Identifier: Apache-2.0
"""The figures of README and docs are those of docs/figures.json, which commands write."""

import json
import re
import sys
from contextlib import suppress

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


def test_only_what_is_not_current_is_measured_and_each_is_kept(monkeypatch, tmp_path, capsys):
    """Figures a (of today), b (of another command), c (stopped there) and d."""
    kept, run = tmp_path / "figures.json", figures.measured
    sources = {
        name: figures.Source(f"python -c 'print({k})'", None, figures._last_line)
        for k, name in enumerate("abcd")
    }
    today = {"version": figures.__version__, "code": figures.code(), "text": "old"}
    of = {"a": sources["a"].command, "b": "-"}
    kept.write_text(json.dumps({name: today | {"command": of[name]} for name in of}))
    for name, value in (("SOURCES", sources), ("FILE", kept), ("PAGES", ())):
        monkeypatch.setattr(figures, name, value)

    def stopped(name):
        if name == "c":
            raise KeyboardInterrupt
        return run(name)

    def shown(*words):
        monkeypatch.setattr(sys, "argv", ["figures.py", *words])
        with suppress(KeyboardInterrupt):
            figures.main()
        texts = "".join(one["text"] for one in figures.load().values())
        return texts, capsys.readouterr().out

    monkeypatch.setattr(figures, "measured", stopped)
    texts, said = shown()
    assert texts == "old1" and "to measure: 3, about 6 min" in said
    monkeypatch.setattr(figures, "measured", run)
    assert shown()[0] == "old123"
    assert "to measure: 0, about 0 min" in shown("--list")[1]
