# SPDX-License-Identifier: Apache-2.0
"""A page is well formed, escaped, complete, and asks nothing of the network."""

import base64
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from intent_recognition.errors import ResourceBusyError
from intent_recognition.report import (
    Column,
    Figure,
    KeyNumber,
    KeyNumbers,
    Paragraph,
    ReportPage,
    Row,
    Section,
    TableBlock,
    write_page,
)
from intent_recognition.report.html import ABSENT, render

RELAXED = settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
VOID = {"meta", "img"}
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
PRINTABLE = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), max_size=30)


class Reader(HTMLParser):
    """Checks that tags close in order; collects the texts of table cells and headings."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.texts, self.attributes = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.attributes += attributes
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "td" in self.open or "th" in self.open:
            self.cells[-1] += data
        if "style" not in self.open:
            self.texts.append(data)


def test_values_are_written_as_their_column_says():
    columns = (Column("task"), Column("error", "cm", form=".1f"), Column("n"), Column("late", "s"))
    table = TableBlock(columns, ((t, 2.25, np.int64(3), None) for t in "ab"), "c", strong=[1])
    assert table.rows == (("a", "2.2", "3", None), ("b", "2.2", "3", None))
    assert (table.columns, table.caption, table.strong) == (columns, "c", [1])
    assert TableBlock(columns, [("a", "never", 3, 0.5)]).rows == (("a", "never", "3", "0.5"),)
    with pytest.raises(ValueError, match="is longer than"):
        TableBlock(columns, [("a", 1.0, 2, 3), ("b", 1.0)])


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader


def page(*blocks) -> ReportPage:
    return ReportPage("Title", "subtitle", (Section("Heading", blocks),), "footer")


@RELAXED
@given(st.lists(st.lists(PRINTABLE, min_size=3, max_size=3), max_size=5))
def test_table_cells_are_what_was_given(rows):
    columns = (Column("a", "cm"), Column("b", align="left"), Column("c"))
    reader = read(render(page(TableBlock(columns, tuple(tuple(row) for row in rows)))))
    assert reader.cells == ["a [cm]", "b", "c", *(cell for row in rows for cell in row)]


@RELAXED
@given(PRINTABLE)
@example('<b class="x">')
def test_any_text_is_escaped_everywhere(text):
    blocks = (
        Paragraph(text),
        KeyNumbers((KeyNumber(text, text, text, True, text),)),
        Figure(SVG, text),
        TableBlock((Column(text, text),), ((text,),), text),
    )
    html = render(ReportPage(text, text, (Section(text, blocks),), text))
    reader = read(html)
    plain = read(render(ReportPage("t", "t", (Section("t", blocks),), "t")))
    assert len(reader.attributes) == len(plain.attributes)
    assert ("alt", text) in reader.attributes


def test_alignment_marks_and_absent_cells():
    table = TableBlock(
        (Column("task", align="left"), Column("error", "cm")),
        (("plate", "3.2"), ("screw", None)),
        "errors",
        marked=frozenset({1}),
        strong=frozenset({0}),
    )
    html = render(page(table))
    assert '<td class="left">plate</td><td class="right">3.2</td>' in html
    assert f'<tr class="marked"><td class="left">screw</td><td class="right">{ABSENT}</td>' in html
    assert '<tr class="strong">' in html


def test_figures_travel_inside_the_page():
    png = b"\x89PNG\r\n\x1a\n..."
    html = render(page(Row((Figure(SVG, "one"), Figure(png, "two")))))
    assert base64.b64encode(SVG).decode() in html
    assert f"data:image/png;base64,{base64.b64encode(png).decode()}" in html


def test_writing_makes_the_folder_and_names_what_fails(tmp_path):
    shown = page(Paragraph("\N{GREEK SMALL LETTER SIGMA}"))
    target = write_page(tmp_path / "new" / "report.html", shown)
    assert target.read_text(encoding="utf-8") == render(shown)
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceBusyError, match="report"):
        write_page(tmp_path / "file" / "report.html", page())
