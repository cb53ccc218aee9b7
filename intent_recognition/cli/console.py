# SPDX-License-Identifier: Apache-2.0
"""The console all commands print to, and progress on it."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich import markup
from rich.console import Console, JustifyMethod, OverflowMethod
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from intent_recognition.errors import printable

MOST_LISTED = 5
"""Items of a list that are printed. Convention."""
WIDTH_OF_A_PIPE = 140
"""Columns where the output is no terminal, so that tables are not cut off. Convention."""


def escape(text: str) -> str:
    """A text of a file or a node as it is printed: no markup, no escape sequence."""
    return markup.escape(printable(text))


def make_console() -> Console:
    """A console as wide as the terminal, or wide enough for every table."""
    return Console(width=None if sys.stdout.isatty() else WIDTH_OF_A_PIPE, highlight=False)


def brief_list(items: Sequence[object]) -> str:
    """The first items by commas, and how many more there are."""
    more = f", and {len(items) - MOST_LISTED} more" if len(items) > MOST_LISTED else ""
    return ", ".join(map(str, items[:MOST_LISTED])) + more


def say(console: Console, text: object, style: str | None = None) -> None:
    """Print a text as it is, on one line however long: paths and messages can be copied."""
    console.print(str(text), style=style, markup=False, soft_wrap=True)


def bar_with(console: Console, *columns: ProgressColumn) -> Progress:
    """A progress bar with these columns behind it, removed at its end; none without a terminal."""
    shown = (TextColumn("{task.description}"), BarColumn(), *columns)
    return Progress(*shown, console=console, transient=True, disable=not console.is_terminal)


def progress_bar(console: Console) -> Progress:
    """A bar for work whose pieces are counted."""
    return bar_with(console, MofNCompleteColumn(), TimeRemainingColumn())


@contextmanager
def busy(console: Console, what: str) -> Iterator[None]:
    """A bar with the elapsed time, for work of unknown length."""
    with bar_with(console, TimeElapsedColumn()) as bar:
        bar.add_task(what, total=None)
        yield


def print_facts(console: Console, facts: Mapping[str, str]) -> None:
    """Print names and values in two columns."""
    width = max(map(len, facts))
    for name, value in facts.items():
        line = f"[bold]{escape(name.ljust(width))}[/bold]  {escape(str(value))}"
        console.print(line, soft_wrap=True)


def plain_table(*titles: str) -> Table:
    """A table whose titles beginning with `>` head columns of numbers."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    return _with_columns(table, titles, "fold")


def boxed_table(title: str, *titles: str) -> Table:
    """The same with a title and in a box."""
    return _with_columns(Table(title=title), titles, "ellipsis")


def _with_columns(table: Table, titles: Sequence[str], overflow: OverflowMethod) -> Table:
    for title in titles:
        side: JustifyMethod = "right" if title.startswith(">") else "left"
        table.add_column(escape(title.removeprefix(">")), justify=side, overflow=overflow)
    return table
