# SPDX-License-Identifier: Apache-2.0
"""A report as one HTML page with its own style and figures inside, which needs no network.

A page is a tree of frozen values; `render` turns it into text. All content is escaped.
"""

import base64
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from math import isnan
from pathlib import Path
from typing import Any, Literal

from intent_recognition.array_types import settle
from intent_recognition.durable import writing
from intent_recognition.report.stylesheet import STYLESHEET

ABSENT = "\N{EN DASH}"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; a small one is a remark."""

    text: str
    small: bool = False


@dataclass(frozen=True)
class Column:
    """Heading and format of a table's column."""

    title: str
    unit: str = ""  # unit of its numbers
    align: Literal["left", "right", "center"] = "right"  # alignment of heading and cells
    form: str = ""  # format of its numbers, for `format`


@dataclass(frozen=True)
class TableBlock:
    """Rows of cells: texts, numbers in the column's format; None and NaN are shown as a dash."""

    columns: Sequence[Column]  # C columns
    rows: Iterable[Sequence[object]]  # rows of C cells
    caption: str = ""
    marked: Collection[int] = ()  # indices of highlighted rows, such as misses
    strong: Collection[int] = ()  # indices of bold rows, such as totals

    def __post_init__(self) -> None:
        rows = (zip(row, self.columns, strict=True) for row in self.rows)
        settle(self, rows=tuple(tuple(_written(v, c.form) for v, c in cells) for cells in rows))


def _written(value: object, form: str) -> str | None:
    if value is None or (isinstance(value, float) and isnan(value)):
        return None
    return value if isinstance(value, str) else format(value, form)


@dataclass(frozen=True)
class Figure:
    """An image, shown at most at its own width."""

    data: bytes
    caption: str = ""

    @property
    def suffix(self) -> str:
        """File name extension for these bytes: svg or png."""
        return "png" if self.data.startswith(b"\x89PNG") else "svg"


@dataclass(frozen=True)
class Row:
    """Figures side by side if the page is wide enough."""

    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class KeyNumber:
    """A highlighted number with the paper's value beside it."""

    label: str
    ours: str  # value with unit, as text
    paper: str = ""  # the paper's value; empty without one
    good: bool | None = None  # True and False set a colour, None does not
    note: str = ""  # a short remark


@dataclass(frozen=True)
class KeyNumbers:
    """A row of key numbers."""

    numbers: tuple[KeyNumber, ...]


Block = Paragraph | TableBlock | Figure | Row | KeyNumbers


@dataclass(frozen=True)
class Section:
    """A heading and the blocks below it."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class ReportPage:
    """A whole report; `footer` states its origin."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    footer: str = ""


def text_columns(*names: str) -> list[Column]:
    """Columns of texts; a name that begins with `>` is aligned to the right."""
    return [Column(n.removeprefix(">"), align="right" if n[:1] == ">" else "left") for n in names]


def render(page: ReportPage) -> str:
    """Render the page as one self-contained HTML document."""
    footer = f"<footer>{escape(page.footer)}</footer>" if page.footer else ""
    body = "\n".join(_section(section) for section in page.sections if section.blocks)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(page.title)}</title>
<style>{STYLESHEET}</style>
</head>
<body>
<main>
<header><h1>{escape(page.title)}</h1><p>{escape(page.subtitle)}</p></header>
{body}
{footer}
</main>
</body>
</html>
"""


def write_page(path: str | Path, page: ReportPage) -> Path:
    """Write the page; create its folder if it is missing.

    Raises:
        ResourceBusyError: the file cannot be written.
    """
    target = Path(path)
    with writing(f"report {target}"):
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(render(page), encoding="utf-8")
    return target


def _section(section: Section) -> str:
    blocks = "\n".join(_RENDERERS[type(block)](block) for block in section.blocks)
    return f"<section>\n<h2>{escape(section.heading)}</h2>\n{blocks}\n</section>"


def _text(block: Paragraph) -> str:
    kind = ' class="small"' if block.small else ""
    return f"<p{kind}>{escape(block.text)}</p>"


def _table(block: TableBlock) -> str:
    caption = f"<caption>{escape(block.caption)}</caption>" if block.caption else ""
    head = "".join(
        f'<th scope="col" class="{column.align}">{escape(column.title)}{_unit(column.unit)}</th>'
        for column in block.columns
    )
    body = "\n".join(_table_row(block, number, row) for number, row in enumerate(block.rows))
    return (
        f'<div class="table"><table>{caption}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _unit(unit: str) -> str:
    return f' <span class="unit">[{escape(unit)}]</span>' if unit else ""


def _table_row(block: TableBlock, number: int, row: Sequence[Any]) -> str:
    names = [
        n for n, rows in (("marked", block.marked), ("strong", block.strong)) if number in rows
    ]
    kind = f' class="{" ".join(names)}"' if names else ""
    cells = "".join(
        f'<td class="{column.align}">{escape(ABSENT if cell is None else cell)}</td>'
        for column, cell in zip(block.columns, row, strict=True)
    )
    return f"<tr{kind}>{cells}</tr>"


def _figure(block: Figure) -> str:
    data = base64.b64encode(block.data).decode("ascii")
    caption = f"<figcaption>{escape(block.caption)}</figcaption>" if block.caption else ""
    alt = escape(block.caption)
    kind = {"svg": "svg+xml"}.get(block.suffix, block.suffix)
    return f'<figure><img alt="{alt}" src="data:image/{kind};base64,{data}">{caption}</figure>'


def _key_number(number: KeyNumber) -> str:
    verdict = {True: " good", False: " bad", None: ""}[number.good]
    parts: Sequence[tuple[str, str]] = (
        ("paper", f"paper: {number.paper}" if number.paper else ""),
        ("note", number.note),
    )
    rest = "".join(f'<div class="{k}">{escape(text)}</div>' for k, text in parts if text)
    return (
        f'<div class="number{verdict}"><div class="label">{escape(number.label)}</div>'
        f'<div class="ours">{escape(number.ours)}</div>{rest}</div>'
    )


_RENDERERS: dict[type, Callable[..., str]] = {
    Paragraph: _text,
    TableBlock: _table,
    Figure: _figure,
    Row: lambda row: f'<div class="row">{"".join(map(_figure, row.figures))}</div>',
    KeyNumbers: lambda row: f'<div class="numbers">{"".join(map(_key_number, row.numbers))}</div>',
}
