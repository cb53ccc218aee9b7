# SPDX-License-Identifier: Apache-2.0
"""`intent`: one parser, help for every command, one line for every error."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from bag_builder import write_bag

from intent_recognition import __version__
from intent_recognition.cli import main as cli
from intent_recognition.errors import ModelError

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_explains_itself(command, ended, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = ended(0, command, "--help").out
    assert text.startswith(f"usage: intent {command}") and len(text.splitlines()) > 5
    assert max(map(len, text.splitlines())) <= 80


def parsers():
    """The parser of each command, by its name."""
    (commands,) = (a for a in cli.make_parser()._actions if a.choices and not a.option_strings)
    return commands.choices.items()


def test_every_option_explains_itself():
    for command, parser in parsers():
        for action in parser._actions:
            assert action.help, (command, action.dest)
            assert action.type not in (int, float, Path)  # numbers have limits, no path is empty
            assert not re.search(r"\b([a-z]+) \1\b", action.help), (command, action.help)


def test_commands_and_their_actions_are_listed(ended):
    actions, commands = ended(0, "plan", "--help").out, ended(0, "--help").out
    assert "\n    learn " in actions
    assert all(command in commands for command in cli.COMMANDS)
    version, update = ended(0, "--version").out.splitlines()
    assert version == f"intent {__version__}"
    assert update.startswith(("update: compiled C", "update: numpy"))


def test_what_the_terminal_has_no_letter_for_is_an_escape(monkeypatch, tmp_path):
    bag = write_bag(tmp_path / "ä_0")
    ascii_output = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", ascii_output)
    assert cli.main(["inspect", str(bag)]) == 0
    assert b"\\xe4_0" in ascii_output.buffer.getvalue()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *((f"train /no/bag --output m --basis={n}", "--basis: ") for n in ("2", "1e5", "201")),
        ("train /no/bag --output m --jobs 0", "--jobs: expected 1 or more, got 0"),
        ("train /no/bag --output m --jobs 2 --scheduler tcp://a:1", "not allowed with"),
        *((f"play /b --rate={rate}", "--rate: ") for rate in ("-1", "nan", "inf", "fast")),
        ("warp mug bowl.stl --seed=-1", "--seed: expected"),
        *((f"warp mug bowl.stl --scale={scale}", "--scale: expected") for scale in (0, "inf")),
    ],
)
def test_numbers_have_limits_before_anything_is_read(words, said, refused):
    assert said in refused(*words.split())


def test_a_misspelt_command_is_told_the_nearest_and_no_path_is_empty(refused):
    """An unset variable of a shell is not the present folder."""
    assert "did you mean 'inspect'?" in refused("inspekt", "bags")
    assert "got nothing" in refused("train", "", "--output", "m.npz")


def test_a_missing_file_is_told_without_the_number_of_the_system(tmp_path, capsys):
    missing, output = str(tmp_path / "none.yaml"), str(tmp_path / "out")
    for argv, cure in (
        (["evaluate", str(tmp_path), "--dofs", missing], "/config/dofs.yaml is an example."),
        (["import", str(tmp_path), "--map", missing, "--output", output], "Check the path."),
    ):
        assert cli.main(argv) == 1
        said = capsys.readouterr().err
        assert f"{missing}: expected" in said and "got no such file or directory. " in said
        assert "Errno" not in said and cure in said


@pytest.mark.parametrize(
    "argv",
    [
        ["train", "/no/bag", "--output", "/tmp/never.npz"],
        ["replay", "/no/bag", "--model", "/no/model.npz"],
        ["recover", "/no/bag", "--output", "/tmp/never"],
        ["play", "/no/bag"],
    ],
)
def test_an_error_is_one_line_and_exit_code_one(argv, capsys):
    assert cli.main(argv) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"intent {argv[0]}: ") and "/no/" in line


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("train /no/bag", "--output"), ("evaluate /no/bag", "--json"),
        ("evaluate /no/bag", "--report"), ("replay /no/bag --model m.npz", "--json"),
        ("warp mug /no/mesh.stl", "--report"), ("record", "--output"),
        ("experiments sparse", "--output"),
    ],
)  # fmt: skip
def test_an_output_that_cannot_be_written_is_refused_before_the_work(
    words, option, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("experiments.runs.run_all", lambda *_: pytest.fail("it began"))
    (tmp_path / "file").touch()
    inside = tmp_path / "file" / "out"
    of = {"record": (tmp_path,), "experiments": (tmp_path / "file",)}
    for output in of.get(words.split()[0], (inside, tmp_path)):
        assert cli.main([*words.split(), option, str(output)]) == 1
        said = capsys.readouterr().err
        assert said.startswith(f"intent {words.split()[0]}: {option}") and str(output) in said


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [("INTENT_KERNEL", "foo", ["--version"]), ("PYTHONOPTIMIZE", "2", ["undo", "a"])],
)
def test_an_error_before_the_command_is_one_line_too(name, value, words):
    command = [sys.executable, "-m", "intent_recognition.cli.main", *words]
    environment = os.environ | {"PYTHONPATH": str(ROOT), name: value}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and f": {name}: expected" in line


def test_only_errors_of_this_package_and_of_the_system_are_caught(monkeypatch, capsys):
    def run(error):
        monkeypatch.setattr("intent_recognition.cli.replay.run", Mock(side_effect=error))
        return cli.main(["replay", "a", "--model", "b"]), capsys.readouterr().err

    assert run(ModelError("one\n  two")) == (1, "intent replay: one two\n")
    code, said = run(PermissionError(13, "Permission denied", "/etc/locked"))
    assert code == 1 and said.startswith("intent replay: /etc/locked: Permission denied. Che")
    assert run(KeyboardInterrupt())[0] == 130
    with pytest.raises(ZeroDivisionError):
        run(ZeroDivisionError())


@pytest.mark.slow
def test_a_reader_that_closes_early_sees_no_traceback(repository):
    bag = repository / "bags" / "toolbox" / "test"
    inspect = f"{sys.executable} -m intent_recognition.cli.main inspect {bag}"
    command = f"set -o pipefail; {inspect} | head -n 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert len(done.stdout.splitlines()) == 1 and not done.stderr
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("train", "bag", "--ouput", "m.npz"), "unknown option --ouput: did you mean --output?"),
        (("train", "bag", "--out=m.npz"), "unknown option --out: did you mean --output?"),
        (("demo", "--headles"), "unknown option --headles: did you mean --headless?"),
        (("train", "-x"), "unknown option -x: `intent train --help` lists them"),
        (("plan", "learn", "--frist"), "unknown option --frist: did you mean --first?"),
        (("--versoin", "train"), "unknown option --versoin: did you mean --version?"),
    ],
)
def test_an_unknown_option_is_told_the_nearest_before_all_else(words, said, refused):
    errors = refused(*words)
    command = " ".join(word for word in words[:2] if word in (*cli.COMMANDS, "learn"))
    assert said in errors and "required" not in errors
    assert errors.startswith(f"usage: intent {command if words[0] in cli.COMMANDS else ''}")


def test_values_are_not_taken_for_options():
    words = ["improve", "task", "--cost", "distance", "--moved", "-0.1", "-.2", ".5"]
    assert cli.make_parser().parse_args(words).moved == [-0.1, -0.2, 0.5]
    assert cli.make_parser().parse_args(["inspect", "--", "--bag"]).paths == [Path("--bag")]


def test_every_command_that_needs_ros_says_so_where_there_is_none(tmp_path):
    """Every executable, too; and all explain themselves where there is."""
    program = tmp_path / "without_ros.py"
    program.write_text(WITHOUT_ROS)
    commands = (
        f"intent demo --output {tmp_path}/out",
        f"intent record --output {tmp_path}/new",
        f"intent play {write_bag(tmp_path / 'bag')}",
        *("intent_estimator", "task_teacher --help", "arm_sim", "dashboard"),
    )
    run = subprocess.run(
        [sys.executable, str(program)],
        input="\n".join(commands),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])},
    )
    assert run.returncode == 0, run.stderr
    lines = run.stderr.splitlines()
    assert len(lines) == len(commands)
    for line, words in zip(lines, commands, strict=True):
        name = " ".join(words.split()[:2]) if words.startswith("intent ") else words.split()[0]
        assert line.startswith(f"{name}: ") and "expected ROS 2 Jazzy, got " in line
        assert line.endswith("Source it, or pip install .[ros].")


WITHOUT_ROS = """
import sys

from intent_recognition.cli.main import main
from intent_recognition.nodes import start

class NoRos:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0].endswith(("rclpy", "_msgs", "_interfaces", "_srvs")):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, NoRos())
for line in sys.stdin:
    name, *words = sys.argv = line.split()
    assert (main(words) if name == "intent" else getattr(start, name)()) == 1, line
"""
