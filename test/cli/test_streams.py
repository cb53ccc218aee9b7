# SPDX-License-Identifier: Apache-2.0
"""Bags whose streams do not belong together are named by evaluate, train and inspect alike."""

import json
from dataclasses import replace

import pytest
import yaml
from cli.recorded import DOFS, TRUTH, write_all
from model_builder import perform, write_recording
from rich.console import Console

from intent_recognition.cli.rejections import print_left_out
from intent_recognition.signals import Rejection, StreamFinding

PER_TASK = 4
SPOILED = ("off", "part", "shifted")


def changed(seed: int, shift_s: float, share: float = 1.0):
    """A recording whose robot is on a clock of its own, and stops after a share of the time."""
    recorded = perform(TRUTH, 0, seed, rest_before_s=1.5, rest_after_s=1.5)
    last_ns = recorded.start_ns + round(share * (recorded.end_ns - recorded.start_ns))
    robot = [s.between(recorded.start_ns, last_ns) for s in recorded.controlled]
    shift_ns = round(shift_s * 1e9)
    robot = [replace(s, stamps_ns=s.stamps_ns + shift_ns) for s in robot]
    return replace(recorded, controlled=tuple(robot))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("streams")
    write_all(folder)
    for name, recorded in zip(
        SPOILED, (changed(30, 300.0), changed(31, 0.0, 0.6), changed(32, 0.5)), strict=True
    ):
        write_recording(folder / "bags" / name, recorded, DOFS)
    return folder


def reasons(listed: list[dict]) -> dict[str, str]:
    return {one["recording"]: one["reason"] for one in listed}


def check_lines(text: str, *, left_out: str) -> None:
    lines = [line for line in text.splitlines() if line.startswith(("left out", "doubtful"))]
    assert len(lines) == 3
    off, part, shifted = (next(line for line in lines if f"{name}:" in line) for name in SPOILED)
    assert off.startswith(left_out) and "does not overlap" in off and "two clocks" in off
    assert part.startswith(left_out) and "covers 60%" in part and "stopped early" in part
    assert shifted.startswith("doubtful") and "0.50 s later" in shifted and "two clocks" in shifted


@pytest.mark.slow
def test_evaluate(run_command, folder, tmp_path):
    output, options = tmp_path / "scores.json", ("--dofs", folder / "dofs.yaml", "--basis", 8)
    fast = ("--protocol", "temporal", "--unknown-tasks", "off", "--json", output)
    code, text = run_command("evaluate", folder / "bags", *options, *fast)
    result = json.loads(output.read_text())
    assert code == 0 and 0 < result["n_demonstrations"] < PER_TASK
    assert set(reasons(result["left_out"])) == {"off", "part"}
    assert set(reasons(result["doubtful"])) == {"shifted"}
    check_lines(text, left_out="left out")


@pytest.mark.slow
def test_train(run_command, folder, tmp_path):
    output = ("--output", tmp_path / "m.npz", "--json", tmp_path / "learned.json")
    code, text = run_command("train", folder / "bags", "--dofs", folder / "dofs.yaml", *output)
    learned = json.loads((tmp_path / "learned.json").read_text())
    assert code == 0 and learned["n_used"] == 2 * PER_TASK + 1 and len(learned["left_out"]) == 2
    assert set(reasons(learned["doubtful"])) == {"shifted"}
    check_lines(text, left_out="left out")


@pytest.mark.slow
@pytest.mark.parametrize("with_dofs", [True, False])
def test_inspect(run_command, folder, with_dofs):
    options = ("--dofs", folder / "dofs.yaml") if with_dofs else ()
    code, text = run_command("inspect", folder / "bags", *options)
    assert code == 0
    check_lines(text, left_out="doubtful")
    _, text = run_command("inspect", folder / "bags", *options, "--json")
    named = {bag["path"].split("/")[-1]: bag["streams"] for bag in json.loads(text)}
    assert {name for name, faults in named.items() if faults} == set(SPOILED)


@pytest.mark.parametrize("command", ["inspect", "train", "evaluate"])
def test_a_misspelt_label_is_named(command, run_command, tmp_path):
    labels = ["give_cup"] * 6 + ["give_cpu"]
    for number, label in enumerate(labels):
        recorded = replace(perform(TRUTH, 0, number, rate_hz=25.0), task=label)
        write_recording(tmp_path / "bags" / f"reach_{number}", recorded, DOFS, task=label)
    (tmp_path / "dofs.yaml").write_text(yaml.safe_dump(DOFS.to_dict()))
    options = {
        "inspect": (),
        "train": ("--basis", 8, "--output", tmp_path / "m.npz"),
        "evaluate": ("--basis", 8, "--protocol", "temporal", "--unknown-tasks", "off"),
    }[command]
    options = ("--dofs", tmp_path / "dofs.yaml", *options)
    code, text = run_command(command, tmp_path / "bags", *options)
    said = "1 with the task give_cpu, 6 with give_cup. Did you mean give_cup?"
    assert code == 0 and " ".join(text.split()).count(f"doubtful reach_6: {said}") == 1


def test_recordings_with_one_fault_are_one_line(capsys):
    """Twelve in degrees: their names, one reason and its factor; two others as they are."""
    said = "q is at {} rad. Likely degrees for radians (a factor of 57.3): record radians."
    alike = [Rejection(f"bags/a{k:02}", "", 0, said.format(140 + k)) for k in range(12)]
    others = [StreamFinding(name, "the clock of 2 s is off") for name in "bc"]
    print_left_out(Console(width=1000), [*alike, *others, others[0]])
    first, *rest = capsys.readouterr().out.splitlines()
    names = ", ".join(["bags/a00", *(f"a{k:02}" for k in range(1, 10))])
    assert first == f"left out {names} and 2 more: {said.format(140)}"
    assert rest == [f"left out {name}: the clock of 2 s is off" for name in "bcb"]
