# SPDX-License-Identifier: Apache-2.0
"""The commands that README and docs show are run, as far as they can be.

Those of `intent` in this process; nodes, recorder and player as processes that come up and end on
Ctrl-C; completion in a shell. What stays unrun, and why, is in `NOT_RUN` and `test_commands.py`.
"""

import shutil
import signal
import socket
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from docs.shown import ROOT, commands, launched
from programs import output_of
from ros_harness import NodeProcess

from intent_recognition.cli import main as cli
from intent_recognition.evaluation import evaluate
from intent_recognition.nodes.graph import GRAPHS, resolve
from intent_recognition.registry import NODES

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("laid_out_roughly")]

LONG_S = 120.0
WRITTEN = ("--output", "--report", "--json", "--record")
NOT_RUN = {
    "demo": "takes minutes; test/cli/test_demo_arms.py",
    "experiments": "takes minutes; test/cli/test_experiments.py (but `--list`, which is run)",
    "improve": "takes minutes, or a person; test/cli/test_warp_and_improve.py",
    "teach": "needs a person and a running graph; test/cli/test_teach.py",
    "keep": "needs an execution that was corrected; test/nodes/test_task_teacher.py",
    "undo": "needs a library that was taught; test/cli/test_teach.py",
}
"""Commands of `intent` that are only parsed, and why."""
UNTIL_CTRL_C = {"record": "bag_recorder", "play": "bag_player"}
"""Commands of `intent` that are a node."""

INTENT = "intent_recognition.cli.main"
IN_A_WORKSPACE = ("ros2", "run", "intent_recognition", "intent")
EVERY = {shown.words for shown in commands()}
SHOWN = sorted(w[3:] if w[:4] == IN_A_WORKSPACE else w for w in EVERY)


def runs_here(words):
    """Whether it is a command of `intent` that ends by itself."""
    if words[0] != "intent" or {">", "|"} & set(words) or words[1] == "--print-completion":
        return False
    if words[1:] == ("experiments", "--list"):
        return True
    if words[1:] == ("inspect", "tasks"):  # a folder that was taught
        return False
    return words[1] not in NOT_RUN and words[1] not in UNTIL_CTRL_C


def one_of_a_kind(commands, kind):
    """Of those that differ in names and values alone one, the last; `test_commands.py` has all."""
    return list({kind(words): words for words in commands if kind(words)}.values())


def kind_of(words):
    """Command and options of what runs here; None of others."""
    if not runs_here(words):
        return None
    return words[1], frozenset(word for word in words if word.startswith("--"))


def faster(words):
    """The same command with what makes it take seconds, beside that there are few recordings."""
    if words[0] != "evaluate":
        return words
    words = ["logo:index" if word == "logo:person" else word for word in words]  # nobody is named
    return (*words, "--unknown-tasks", "off", "--basis", "8")


def evaluate_one_fold(demonstrations, folds, *args, **options):
    """In place of `evaluate`."""
    return evaluate(demonstrations, folds[:1], *args, **options)


@pytest.mark.parametrize("words", one_of_a_kind(SHOWN, kind_of), ids=" ".join)
def test_it_runs(words, bench, monkeypatch, capsys):
    monkeypatch.chdir(bench)
    monkeypatch.setattr("intent_recognition.cli.evaluate.evaluate", evaluate_one_fold)
    for segment in bench.glob("demos/session_*"):  # both ways of cutting write there
        shutil.rmtree(segment)
    if words[1] == "import":  # others use what it writes, and it overwrites nothing
        shutil.rmtree(bench / words[words.index("--output") + 1], ignore_errors=True)
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


def node_of(words):
    """Name of the node that a command is, and what follows; None for other commands."""
    if words[0] == "intent" and words[1] in UNTIL_CTRL_C:
        return UNTIL_CTRL_C[words[1]], words[1:]
    if words[:3] == ("ros2", "run", "intent_recognition"):
        return words[3], words[4:]
    return (words[0], words[1:]) if words[0] in NODES else None


@pytest.mark.parametrize(
    "words", one_of_a_kind(SHOWN, lambda words: (node_of(words) or [None])[0]), ids=" ".join
)
def test_it_comes_up_and_ends_on_ctrl_c(words, bench, tmp_path, monkeypatch, harness):
    name, arguments = node_of(words)
    monkeypatch.chdir(tmp_path if words[:2] == ("intent", "record") else bench)
    module = INTENT if words[0] == "intent" else NODES[name].module
    heard = harness.collect(DiagnosticArray, "/diagnostics")
    named = (word.removeprefix("__node:=") for word in words if word.startswith("__node:="))
    known_as = next(named, name)
    with NodeProcess(module, *arguments, *free_port(name)) as node:
        harness.spin_until(
            lambda: (
                node.process.poll() is not None
                or any(status.name == known_as for message in heard for status in message.status)
            ),
            deadline_s=LONG_S,
            what=f"diagnostics of {known_as}",
        )
        if node.process.poll() is None:
            node.process.send_signal(signal.SIGINT)
        assert node.wait(LONG_S) == 0, node.errors
    assert "Traceback" not in node.errors


def free_port(name):
    """Arguments for a port that nothing listens on; of a parameter given twice the last counts."""
    if name != "dashboard":
        return ()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return "--ros-args", "-p", f"port:={probe.getsockname()[1]}"


LAUNCHED = [words for words in SHOWN if words[:2] == ("ros2", "launch")]


@pytest.mark.parametrize("words", LAUNCHED, ids=" ".join)
def test_what_is_launched_is_complete(words, bench):
    """Launch itself is not installable here; with these arguments it has all that it needs."""
    graph, own = launched(words[3])
    given = dict(word.split(":=", 1) for word in words[4:])
    calls = resolve(graph, {name: value for name, value in given.items() if name not in own})
    assert {call.name for call in calls} <= set(GRAPHS[graph].nodes)
    for name in ("model", "dofs", "params_file"):
        assert name not in given or (bench / given[name]).exists()


MODULES: dict[str, set[str]] = {}
for line in (ROOT / "bags" / "README.md").read_text(encoding="utf-8").splitlines():
    if line.startswith("    python -m "):
        _, _, name, *given = line.split()
        MODULES.setdefault(name, set()).update(word for word in given if word.startswith("--"))


@pytest.mark.parametrize("name", MODULES)
def test_generators_take_the_options_shown(name):
    """They take minutes to an hour: test/experiments runs parts of them."""
    said = output_of(sys.executable, "-m", name, "--help")
    assert all(option in said for option in MODULES[name])
