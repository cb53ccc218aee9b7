# SPDX-License-Identifier: Apache-2.0
"""Bars and texts on a terminal, and without one."""

import io
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from rich.console import Console

from intent_recognition.cli import console as consoles
from intent_recognition.cli import output, recordings
from intent_recognition.cli.console import (
    boxed_table,
    busy,
    make_console,
    print_facts,
    progress_bar,
    say,
)
from intent_recognition.cli.recordings import read_all
from intent_recognition.cli.session_watch import ProgressLine
from intent_recognition.demonstrations import load_dofs


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=100, _environ={"TERM": "xterm"})


def test_the_demo_counts_a_changed_interaction_once():
    line = ProgressLine(2, console := terminal())
    with line.shown():
        for take, label in (
            (line.on_task, "plate"),
            (line.on_active, "plate"),
            (line.on_task, "screw"),  # the mind changes
            (line.on_active, ""),
            (line.on_active, "screw"),
            (line.on_task, ""),
            (line.on_task, "plate"),
        ):
            take(label)
        line.on_task("")
    console.print(line._status.status)
    assert "interaction 2/2, 1 right so far" in console.file.getvalue()


def test_of_two_people_the_demo_shows_both_and_counts_what_they_have_done():
    line = ProgressLine(3, terminal())
    line.on_active("")
    assert line._text == "done 0/3; robot: -"
    line.on_task("plate", "anna")
    line.on_active("plate")
    line.on_task("screw", "ben")  # no change of mind: another person's
    line.on_task("", "anna")
    line.on_active("screw")
    assert line._text == "done 1/3; anna: -, ben: screw, robot: screw"


@pytest.mark.parametrize("bar", [progress_bar, lambda console: busy(console, "learning")])
def test_no_terminal_no_bar(bar):
    console = Console(file=io.StringIO(), width=100)
    with bar(console):
        pass
    assert not console.file.getvalue()


def test_a_session_of_many_demonstrations_is_one_bag(repository, monkeypatch):
    bars = []

    @contextmanager
    def bar(console):
        with progress_bar(console) as made:
            bars.append(made)
            yield made

    monkeypatch.setattr(recordings, "progress_bar", bar)
    dofs = load_dofs(repository / "config/dofs_two_humans.yaml")
    found, _ = read_all([repository / "bags/assembly/session_00"], dofs, terminal())
    ((task,),) = (one.tasks for one in bars)
    assert len(found) > 1 and task.completed == task.total == 1


@pytest.mark.slow
def test_every_long_step_of_a_command_has_one(recorded, tmp_path, parse, monkeypatch):
    console = terminal()
    monkeypatch.setattr(output, "make_console", lambda **_: console)
    bags, model = recorded / "bags", tmp_path / "model.npz"
    options = ("--dofs", recorded / "dofs.yaml", "--basis", 8)
    fast = ("--test", bags / "demo_00", "--unknown-tasks", "off")
    for arguments in (
        ("train", bags, *options, "--output", model),
        ("replay", bags / "demo_00", "--model", model),
        ("evaluate", bags, *options, *fast, "--report", tmp_path / "r.html"),
    ):
        args = parse(*arguments)
        assert args.run(args) == 0
    shown = console.file.getvalue()
    for step in ("reading", "learning", "replaying", "scoring", "writing the report"):
        assert step in shown, step


@pytest.mark.parametrize("kind", ["counted", "unknown", "session"])
def test_without_a_terminal_a_line_says_again_and_again_how_far_it_is(kind, monkeypatch):
    """The interval is short here; the work waits until a line has come."""
    monkeypatch.setattr(consoles, "NEWS_S", 0.01)
    console = Console(file=(printed := io.StringIO()), width=100)

    def wait_for(text):
        while text not in printed.getvalue():
            pass

    if kind == "counted":
        with progress_bar(console) as bar:
            bar.update(bar.add_task("scoring", total=5), completed=2)
            wait_for("scoring: 2 of 5, 0 s, about 0 s more\n")
    elif kind == "unknown":
        with busy(console, "learning"):
            wait_for("learning: 0 s\n")
    else:
        line = ProgressLine(2, console)
        with line.shown():
            wait_for("waiting for the coworker\n")
            line.on_task("plate")
            wait_for("interaction 1/2, 0 right so far; human: plate, robot: -\n")


def test_the_rest_is_told_by_the_pace_so_far():
    task = SimpleNamespace(description="scoring", total=40, completed=10, elapsed=30.0)
    assert consoles._state(task) == "scoring: 10 of 40, 30 s, about 90 s more"
    task.completed = 0
    assert consoles._state(task) == "scoring: 0 of 40, 30 s"


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
