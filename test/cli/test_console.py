# SPDX-License-Identifier: Apache-2.0
"""Texts of files and nodes appear on the console as they are."""

import pytest

from intent_recognition.cli.console import boxed_table, busy, make_console, print_facts, say

TEXT = "out/[/a]/[red]:warning:\x1b[2J"


def in_table(console, text):
    table = boxed_table(text, text)
    table.add_row(text)
    console.print(table)


@pytest.mark.parametrize("stderr", [False, True])
@pytest.mark.parametrize(
    "show", [say, in_table, lambda console, text: print_facts(console, {text: text})]
)
def test_nothing_is_taken_for_markup_or_goes_to_the_terminal(show, stderr, capsys):
    show(make_console(stderr), f"{TEXT}\n")
    printed = capsys.readouterr()[stderr]
    assert {say: 1, in_table: 3}.get(show, 2) == printed.count(repr(TEXT)[1:-1])


def test_no_description_of_a_bar_is_taken_for_markup(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with busy(make_console(), TEXT):
        pass
    assert "out/[/a]/[red]" in capsys.readouterr().out
