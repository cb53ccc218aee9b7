# SPDX-License-Identifier: Apache-2.0
"""What the tests of the commands share."""

import argparse
import importlib

import pytest
from cli.recorded import DOFS, TRUTH, write_all
from model_builder import learned_model

from intent_recognition.cli.main import main
from intent_recognition.cli.options import add_module
from intent_recognition.model import save_model


@pytest.fixture(autouse=True, scope="module")
def rough(laid_out_roughly) -> None:
    """Of the figures in reports nothing is looked at."""


@pytest.fixture
def parse():
    """Arguments of one command, as its own parser reads them."""

    def read(command: str, *arguments: object) -> argparse.Namespace:
        parser = argparse.ArgumentParser(prog="intent")
        subparsers = parser.add_subparsers(dest="command")
        module = importlib.import_module(f"intent_recognition.cli.{command}")
        add_module(subparsers, command, module)
        return parser.parse_args([command, *map(str, arguments)])

    return read


@pytest.fixture
def run_command(parse, capsys):
    """Run one command in this process; returns its exit code and what it printed."""

    def run(command: str, *arguments: object) -> tuple[int, str]:
        args = parse(command, *arguments)
        code = args.run(args)
        return code, capsys.readouterr().out

    return run


@pytest.fixture
def ended(capsys):
    """Let the parser end the program with a code; returns what is on both streams."""

    def run(code: int, *words: object):
        with pytest.raises(SystemExit) as end:
            main([*map(str, words)])
        assert end.value.code == code
        return capsys.readouterr()

    return run


@pytest.fixture
def refused(ended):
    """Let the parser refuse the words of a command; returns what it says."""
    return lambda *words: ended(2, *words).err


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Folder of recordings of two tasks, and their DOF file."""
    folder = tmp_path_factory.mktemp("recorded")
    write_all(folder)
    return folder


@pytest.fixture
def train(run_command, recorded, tmp_path):
    """Train with eight basis functions; returns the model's file and what was printed."""

    def run(*arguments, dofs="dofs.yaml"):
        path = tmp_path / f"model_{len(list(tmp_path.iterdir()))}.npz"
        options = ("--dofs", recorded / dofs, "--basis", 8, "--output", path)
        code, text = run_command("train", *arguments, *options)
        assert code == 0
        return path, text

    return run


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """File of a model of those tasks."""
    path = tmp_path_factory.mktemp("model") / "model.npz"
    save_model(path, learned_model(DOFS, TRUTH))
    return path
