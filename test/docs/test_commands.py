# SPDX-License-Identifier: Apache-2.0
"""Every command that README and docs show is right: names, options, files; see test_run.py."""

import importlib.util
import re
from itertools import pairwise

import pytest
from docs.shown import ROOT, commands, inline_commands, launched, nodes

from intent_recognition.cli import main as cli
from intent_recognition.extras import requirements
from intent_recognition.nodes.graph import GRAPHS

REPOSITORY = ("bags", "config", "docs", "launch", "test", "benchmarks")
WRITTEN = ("--output", "--report", "--json", "--record")
SYSTEM = {
    "cd", "eval", "git", "mkdir", "python3", "python3.11", "rosdep", "source", "sudo", "touch",
}  # fmt: skip
"""Other people's programs: their options are theirs."""
ROS2 = {
    "bag": ("record", "play", "info"),
    "topic": ("list", "hz", "echo", "pub"),
    "node": ("list",),
}
ROS2 |= {"param": ("set", "get", "describe", "list"), "lifecycle": ("set", "get", "nodes")}

SHOWN = commands()
NODES = nodes()


def test_every_command_is_right():
    for shown in SHOWN:
        check_command(shown)


def check_command(shown):
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


@pytest.mark.slow
def test_what_stands_in_the_text_exists():
    for shown in sorted(set(inline_commands()), key=str):
        check_options(shown)


def check_options(shown):
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
    for word in words[2:]:
        for extra in re.findall(r"\.\[([\w,]+)\]", word):
            assert set(extra.split(",")) <= set(requirements())


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
        graph, own = launched(rest[1])
        declared = {a.name for a in GRAPHS[graph].arguments()}
        assert {word.partition(":=")[0] for word in rest[2:]} <= declared | own
    elif kind == "run":
        assert rest[0] == "intent_recognition"
        if rest[1] == "intent":
            check_intent(rest[1:])
        else:
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
