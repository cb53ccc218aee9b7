# SPDX-License-Identifier: Apache-2.0
"""The newcomer's way: takes of Motive and a Panda's log to an arm that does the tasks."""

import json
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest
from rich.console import Console

from intent_recognition.cli import demo_recordings
from intent_recognition.cli.main import main
from intent_recognition.tables import suggest_map

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    """Five takes of each task, by the script of the tutorial."""
    pytest.importorskip("pybullet_data", reason="the script draws its Panda from it")
    folder = tmp_path_factory.mktemp("takes")
    path = ROOT / "docs/tutorials/example_takes.py"
    subprocess.run([sys.executable, path, folder, "--number", "5"], check=True)
    return folder


@pytest.fixture(scope="module")
def learned(takes, tmp_path_factory):
    """The same imported by the suggested map, one of each task kept apart, and a model."""
    folder = tmp_path_factory.mktemp("learned")
    demos, held_out = folder / "demos", folder / "held_out"
    assert main(["import", str(takes), "--suggest", "--output", str(folder / "map.yaml")]) == 0
    given = ["--map", str(folder / "map.yaml"), "--output", str(demos)]
    assert main(["import", str(takes), *given]) == 0
    held_out.mkdir()
    for name in ("hand_bolt_04", "hand_tray_04"):
        (demos / name).rename(held_out / name)
    model = folder / "mine.npz"
    given = ["--dofs", str(demos / "dofs.yaml"), "--output", str(model)]
    assert main(["train", str(demos), *given]) == 0
    return model, held_out


def test_folders_of_two_programs_are_one_recording_each(takes):
    text = suggest_map(takes)
    assert "motive: motive/{task}_{number}.csv" in text
    assert "panda: panda/{task}_{number}.csv" in text
    observed, controlled = text.split("controlled:")
    assert "wrist.Position.X" in observed and "panda_joint7" in controlled
    assert "# Seldom seen: Unlabeled 1204.Position" in controlled
    assert "# Markers of these bodies: wrist:Marker 001.Position" in controlled


@pytest.mark.slow
def test_the_arm_does_what_was_learned(learned, tmp_path, capfd):
    model, held_out = learned
    numbers = tmp_path / "numbers.json"
    given = ["--arm", "panda", "--headless", "--model", str(model), "--recordings", str(held_out)]
    given += ["--output", str(tmp_path / "out"), "--json", str(numbers)]
    assert main(["demo", *given]) == 0
    told = capfd.readouterr().out.splitlines()[-1]
    assert told.startswith("acted on as labelled 2/2, hand off by ")
    shown = json.loads(numbers.read_text(encoding="utf-8"))
    assert [one["task"] for one in shown] == ["hand_bolt", "hand_tray"]
    assert all(one["after_s"] > 0.9 for one in shown)  # the person rests before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--arm", "lwr"], "joints of lwr"),
        (["--arm", "panda", "--rate", "2"], "no such option with --recordings"),
        (["--recordings", "{}"], "--recordings: expected a bag, got none in "),
    ],
)
def test_what_does_not_fit_is_said_before_anything_starts(learned, options, said, capsys, tmp_path):
    model, held_out = learned
    given = ["--model", str(model), "--recordings", str(held_out), "--output", str(tmp_path / "o")]
    options = [option.format(tmp_path) for option in options]
    assert main(["demo", "--headless", *given, *options]) != 0
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("page", [True, False])
def test_a_page_that_is_closed_in_the_first_recording_is_no_failure(page):
    args = Namespace(json=None, dashboard=page)
    assert demo_recordings._report(args, [], Console()) == int(not page)


@pytest.mark.parametrize("task", ["a", ""])
def test_where_an_arm_missed_something_it_is_said_how_to_count_without_a_clock(task, capsys):
    shown = [demo_recordings.Shown("a_0", "a", "a", 1.0, 2.0)] * 2
    shown.append(demo_recordings.Shown("a_1", "a", task, float("nan"), float("nan")))
    args = Namespace(json=None, dashboard=False, model=Path("m.npz"), recordings=Path("held out"))
    assert demo_recordings._report(args, shown, Console(file=sys.stdout, width=80)) == 0
    assert ("  intent rehearse m.npz 'held out'\n" in capsys.readouterr().out) == (not task)
