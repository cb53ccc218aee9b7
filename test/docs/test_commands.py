# SPDX-License-Identifier: Apache-2.0
"""Every command that README and docs show is right, and those that can be run are run."""

import importlib.util
import re
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from docs.shown import ROOT, commands, inline_commands, nodes

from intent_recognition.cli import main as cli
from intent_recognition.nodes.graph import GRAPHS

REPOSITORY = ("bags", "config", "docs", "launch", "test", "benchmarks")
WRITTEN = ("--output", "--report", "--json", "--record")
SYSTEM = {
    "cd", "eval", "git", "mkdir", "python3", "python3.11", "rosdep", "source", "sudo", "touch",
}  # fmt: skip
"""Other people's programs: their options are theirs."""
ROS2 = {"bag": ("record", "play", "info"), "topic": ("list", "hz", "echo"), "node": ("list",)}
ROS2 |= {"param": ("set", "get", "describe", "list"), "lifecycle": ("set", "get", "nodes")}

NOT_RUN = {
    "demo": "takes minutes; test/cli/test_demo.py",
    "experiments": "takes minutes; test/cli/test_experiments.py (but `--list`, which is run)",
    "record": "needs a running graph; test/cli/test_record_play.py",
    "play": "needs a running graph; test/cli/test_record_play.py",
    "teach": "needs a running graph; test/cli/test_teach.py",
    "undo": "needs a library that was taught; test/cli/test_teach.py",
    "warp": "needs meshes of one's own; test/cli/test_warp.py",
}
"""Commands that are only parsed, and why. Nothing but `intent` is run."""

SHOWN = commands()
NODES = nodes()


@pytest.mark.parametrize("shown", SHOWN, ids=str)
def test_it_is_right(shown):
    words = shown.words
    check = {
        "intent": check_intent,
        "make": check_make,
        "pip": check_pip,
        "python": check_python,
        "ros2": check_ros2,
    }.get(words[0])
    if check:
        check(words)
    elif words[0] in NODES:
        check_node(words[0], words[1:])
    else:
        assert words[0] in SYSTEM, f"{words[0]} is no command of ours, and not in SYSTEM"
    check_paths(words)


@pytest.mark.parametrize("shown", sorted(set(inline_commands()), key=str), ids=str)
def test_what_stands_in_the_text_exists(shown):
    program, command, *rest = shown.words
    if program == "make":
        check_make(shown.words)
        return
    if command.startswith("--") or command == "COMMAND":
        parser = cli.make_parser(())
        rest = [command, *rest]
    else:
        parser = subparsers()[command]
    options = {word.partition("=")[0] for word in rest if word.startswith("--")}
    assert options <= set(parser._option_string_actions)


def test_all_exceptions_are_needed():
    shown = {words[1] for words in (s.words for s in SHOWN) if words[0] == "intent"}
    assert set(NOT_RUN) <= shown & set(cli.COMMANDS)
    assert {s.words[0] for s in SHOWN} >= SYSTEM


def subparsers():
    return next(a for a in cli.make_parser()._actions if a.dest == "command").choices


def check_intent(words):
    if words[1] not in ("--help", "--version", "--print-completion"):
        cli.make_parser(words[1:2]).parse_args(words[1:])


def check_make(words):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(rf"^{words[1]}:", makefile, re.MULTILINE)
    for word in words[2:]:
        name, _, value = word.partition("=")
        assert re.search(rf"^{name} \?=", makefile, re.MULTILINE)
        if name == "DEMO_ARGS":
            cli.make_parser(("demo",)).parse_args(["demo", *value.split()])


def check_pip(words):
    assert words[1] == "install"
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    for word in words[2:]:
        for extra in re.findall(r"\.\[([\w,]+)\]", word):
            assert all(f'"{name}": [' in setup for name in extra.split(","))


def check_python(words):
    if words[1:3] == ("-m", "colcon"):
        return
    if words[1] == "-m":
        assert importlib.util.find_spec(words[2])
    else:
        assert (ROOT / words[1]).is_file()


def check_ros2(words):
    kind, *rest = words[1:]
    if kind == "launch":
        assert rest[0] == "intent_recognition"
        assert (ROOT / "launch" / rest[1]).is_file()
        declared = {a.name for a in GRAPHS[rest[1].removesuffix(".launch.py")].arguments()}
        assert {word.partition(":=")[0] for word in rest[2:]} <= declared
    elif kind == "run":
        assert rest[0] == "intent_recognition"
        check_node(rest[1], rest[2:])
    elif kind == "service":
        assert rest[0] == "call"
        node, _, service = rest[1].strip("/").partition("/")
        assert f"~/{service}" in NODES[node].services
    else:
        assert rest[0] in ROS2[kind]
        if kind in ("param", "lifecycle") and len(rest) > 1:
            assert rest[1].strip("/") in NODES
            assert kind != "param" or rest[2] in NODES[rest[1].strip("/")].parameters


def check_node(node, words):
    for option, value in pairwise(words):
        name = value.partition(":=")[0]
        if option == "-p":
            assert name in NODES[node].parameters | {"use_sim_time"}
        elif option == "-r":
            assert name in NODES[node].topics | {"__ns", "__node"}


def check_paths(words):
    """What lies in the repository exists; what is written does not have to."""
    for before, word in pairwise(("", *words)):
        path = word.rpartition(":=")[2].rpartition(":")[2]
        if path.partition("/")[0] in REPOSITORY and "/" in path and before not in WRITTEN:
            assert (ROOT / path).exists(), path


def can_be_run(words):
    redirected = {">", "|"} & set(words)
    if words[0] != "intent" or redirected or words[1] == "--print-completion":
        return False
    return words[1] not in NOT_RUN or words[1:] == ("experiments", "--list")


RUN = sorted({s.words for s in SHOWN if can_be_run(s.words)})
MODELS = re.compile(r"\w+\.npz")


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder where everything the commands name is there, with few recordings of each task."""
    folder = tmp_path_factory.mktemp("bench")
    toolbox = ROOT / "bags" / "toolbox"
    bags = sorted(bag for bag in (toolbox / "train").iterdir() if re.search(r"_0[0-2]$", bag.name))
    two_tasks = [bag for bag in bags if not bag.name.startswith("screw")]
    for target, found in (
        ("bags/toolbox/train", bags),
        ("bags/toolbox/test", sorted(toolbox.glob("test/*_00"))),
        ("demos", two_tasks),
    ):
        (folder / target).mkdir(parents=True)
        for bag in found:
            (folder / target / bag.name).symlink_to(bag)
    for name in sorted(
        {w for words in RUN for w in words if "give_bracket" in w or w == "new_bag"}
    ):
        if not name.endswith("_saved"):
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).symlink_to(toolbox / "test" / "plate_handover_00")
    (folder / "config").symlink_to(ROOT / "config")
    shutil.copy(ROOT / "config" / "dofs.yaml", folder / "my_dofs.yaml")
    model = folder / "learned_first.npz"
    train = ["train", *map(str, bags), "--output", str(model)]
    assert cli.main(train) == 0
    for name in sorted({w for words in RUN for w in words if MODELS.fullmatch(w)}):
        shutil.copy(model, folder / name)
    return folder


def faster(words):
    """The same command with what makes it take seconds, beside that there are few recordings."""
    if words[0] != "evaluate":
        return words
    folds = () if "--protocol" in words else ("--protocol", "kfold:2")
    return (*words, "--unknown-tasks", "off", "--basis", "8", *folds)


@pytest.mark.parametrize("words", RUN, ids=" ".join)
def test_it_runs(words, bench, monkeypatch, capsys):
    monkeypatch.chdir(bench)
    if words[1] in ("--help", "--version"):
        with pytest.raises(SystemExit) as ended:
            cli.main(words[1:])
        code = ended.value.code
    else:
        code = cli.main(faster(words[1:]))
    assert code == 0, capsys.readouterr().err
    assert capsys.readouterr().out
    for before, word in pairwise(words):
        if before in WRITTEN and not word.startswith("--"):
            assert Path(word).exists(), word
