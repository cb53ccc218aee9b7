# SPDX-License-Identifier: Apache-2.0
"""`intent experiments`: what is asked for runs, is printed and written; the rest is told."""

import io
import json
import signal
import sys
from multiprocessing import active_children
from pathlib import Path

import pytest
from rich.console import Console

from experiments import catalogue, report, runs
from experiments.catalogue import Experiment
from experiments.runs import run_all
from experiments.settings import Settings
from intent_recognition.cli import experiments as command
from intent_recognition.cli.main import main

GOOD = Experiment("stub", "experiment_stub", "Nobody, Fig. 0", "a stub")
BROKEN = Experiment("broken", "experiment_stub_broken", "Nobody, Fig. 1", "a stub that breaks off")

WAITING = Experiment("waiting", "experiment_stub_waiting", "Nobody, Fig. 2", "a stub without end")


@pytest.fixture
def stubs(monkeypatch):
    """Only the stubs are in the catalogue."""
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parent), *sys.path])
    monkeypatch.setattr(catalogue, "EXPERIMENTS", (GOOD, BROKEN))


@pytest.mark.slow
def test_writes_report_and_numbers_by_seed(stubs, tmp_path, capsys):
    """The same again: test_json.py."""
    assert main(["experiments", "stub", "--seed", "3", "--output", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "1 of 1 figures met or beaten, 0 missed, 1 not like for like" in printed
    written = json.loads((tmp_path / "numbers.json").read_text())
    numbers = written["experiments"]["stub"]["numbers"]
    assert numbers["value"] == float(Settings(seed=3).rng(0).standard_normal())
    page = (tmp_path / "report.html").read_text()
    assert "A stub" in page
    assert "Nobody, Fig. 0" in page


@pytest.mark.slow
def test_without_a_terminal_steps_are_plain_lines_and_one_that_breaks_off_is_alone(
    stubs, tmp_path, capsys
):
    assert main(["experiments", "--quick", "--output", str(tmp_path)]) == 1
    printed = capsys.readouterr()
    lines = [line.split() for line in printed.out.splitlines() if line]
    told = [(words[2], " ".join(words[3:])) for words in lines if words[1:2] == ["s"]]
    assert ("stub", "0 % starting") in told
    assert ("stub", "50 % drawing") in told
    assert ("stub", "52 % still drawing") not in told
    assert {("stub", "done"), ("broken", "broke off")} <= set(told)
    assert "broken broke off: no recordings in stub" in printed.err
    content = json.loads((tmp_path / "numbers.json").read_text())["experiments"]
    assert content["stub"]["numbers"]["quick"] is True
    assert content["broken"] == {"failure": "no recordings in stub"}
    assert "broken broke off" in (tmp_path / "report.html").read_text()


class InterruptedWhereItWaits(io.StringIO):
    """A terminal whose user has seen enough."""

    def write(self, text):
        if "waiting" in text:
            raise KeyboardInterrupt
        return super().write(text)


@pytest.mark.slow
@pytest.mark.parametrize("present", [signal.SIG_DFL, signal.SIG_IGN])
def test_interrupted_it_ends_the_processes_of_its_experiments(stubs, monkeypatch, present):
    """They inherit whether SIGTERM is ignored."""
    monkeypatch.setattr(runs, "STOP_S", 0.5)
    console = Console(file=InterruptedWhereItWaits())
    before = signal.signal(signal.SIGTERM, present)
    try:
        with pytest.raises(KeyboardInterrupt):
            run_all((WAITING,), Settings(seed=1), 1, console)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert active_children() == []


def test_an_installed_package_says_where_the_experiments_are(monkeypatch, capsys):
    monkeypatch.setattr(command, "source_tree", lambda: None)
    assert main(["experiments", "--list"]) == 1
    told = capsys.readouterr().err
    assert "source tree" in told and "Clone the repository" in told and len(told.splitlines()) == 1


def test_unknown_name_is_one_line(capsys):
    assert main(["experiments", "juggling"]) == 1
    assert "NAME" in capsys.readouterr().err


def test_recordings_that_are_not_there_are_said_before_any_work(capsys, tmp_path):
    missing = tmp_path / "nowhere"
    assert main(["experiments", "--bags", str(missing), "--output", str(tmp_path / "new")]) == 1
    assert f"--bags: expected a folder of recordings, got {missing}" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_without_comparable_figures_none_is_called_good():
    numbers, *_ = report._overview({}, {}).blocks
    assert [number.good for number in numbers.numbers] == [None, None, None]
