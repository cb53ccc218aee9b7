# SPDX-License-Identifier: Apache-2.0
"""The console to which all commands print, and progress bars on it."""

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from rich.console import Console, JustifyMethod, OverflowMethod
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from intent_recognition.errors import printable

NEWS_S = 30.0
"""Time between two lines of progress if the output is not a terminal [s]."""


class _Output(Console):
    """Prints texts of files and nodes literally: no markup, no emoji, no escape sequences.

    `main` handles a closed pipe; rich alone would end the program with exit code 1.
    """

    def render_str(self, text: str, **options: Any) -> Text:
        """Text with unprintable characters escaped."""
        return super().render_str("\n".join(map(printable, text.split("\n"))), **options)

    def on_broken_pipe(self) -> None:
        """Raise the error that `main` handles."""
        raise BrokenPipeError


def make_console(stderr: bool = False) -> Console:
    """A console as wide as the terminal; without one, wide enough for every table."""
    width = None if (sys.stderr if stderr else sys.stdout).isatty() else 140
    return _Output(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def say(console: Console, text: object, style: str | None = None) -> None:
    """Print a text without wrapping it, so that paths and messages can be copied."""
    console.print(str(text), style=style, soft_wrap=True)


@contextmanager
def news(console: Console, text: Callable[[], str]) -> Iterator[None]:
    """Print a text every `NEWS_S` if the output is not a terminal."""
    over = threading.Event()

    def tell() -> None:
        while not over.wait(NEWS_S):
            say(console, text())

    if console.is_terminal:
        yield
        return
    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()


@contextmanager
def bar_with(console: Console, *columns: ProgressColumn) -> Iterator[Progress]:
    """A progress bar with these columns, removed at its end; plain lines without a terminal."""
    shown = (TextColumn("{task.description}", markup=False), BarColumn(), *columns)
    bar = Progress(*shown, console=console, transient=True, disable=not console.is_terminal)
    with bar, news(console, lambda: "; ".join(map(_state, bar.tasks))):
        yield bar


def _state(task: Task) -> str:
    elapsed_s = task.elapsed or 0.0
    if task.total is None:
        return f"{task.description}: {elapsed_s:.0f} s"
    said = f"{task.description}: {task.completed:.0f} of {task.total:.0f}, {elapsed_s:.0f} s"
    if not task.completed:
        return said
    rest_s = elapsed_s * (task.total - task.completed) / task.completed
    return f"{said}, about {rest_s:.0f} s more"


def progress_bar(console: Console) -> AbstractContextManager[Progress]:
    """A progress bar for a known number of items."""
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
        head = console.render_str(name.ljust(width), style="bold")
        console.print(head, value, sep="  ", soft_wrap=True)


def plain_table(*titles: str) -> Table:
    """A table without a box; columns whose title begins with `>` hold numbers."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    return _with_columns(table, titles, "fold")


def boxed_table(title: str, *titles: str) -> Table:
    """A table with a title and a box; headings wrap at words."""
    words = [heading.replace("_", " ") for heading in titles]
    return _with_columns(Table(title=title), words, "ellipsis")


def _with_columns(table: Table, titles: Sequence[str], overflow: OverflowMethod) -> Table:
    for title in titles:
        side: JustifyMethod = "right" if title.startswith(">") else "left"
        table.add_column(title.removeprefix(">"), justify=side, overflow=overflow)
    return table
