# SPDX-License-Identifier: Apache-2.0
"""Learn the plan of an assembly from a few sessions: its steps, their order, who does them and what
they take. Pass it to the estimator as the parameter `plan` (docs/plans.md).

# from session bags in which boxes are built one after the other
intent plan learn bags/sessions --first plate_handover --output box.yaml
# from written sessions
intent plan learn sessions.yaml --output shelf.yaml
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, make_console, say
from intent_recognition.cli.options import a_path, add_actions, add_command, number
from intent_recognition.cli.rejections import print_left_out
from intent_recognition.demonstrations import read_task_sequences
from intent_recognition.durable import write_text
from intent_recognition.plans import (
    Assembly,
    DoneTask,
    WorkPlan,
    begun_with,
    learn_plan,
    read_assemblies,
    read_plan,
    write_plan,
)
from intent_recognition.recognition import FORGET_AFTER_S
from intent_recognition.untrusted import Content, read_named

YAML = (".yaml", ".yml")


def _add_actions(parser: argparse.ArgumentParser) -> None:
    add_command(
        add_actions(parser),
        "learn",
        _learn,
        """
        Learn a plan; relations written by hand into an older one are kept.

        sessions SESSIONS...  session bags, folders of them, or YAML files (docs/plans.md)
        --first TASK          cut sessions before each time that it is done
        --pause S             a longer pause in a bag ends an assembly [s] (default: %(default)g)
        """,
        first={"default": ""},
        pause={"type": number(float, 0.0), "default": FORGET_AFTER_S},
    ).add_argument(
        *("-o", "--output"), type=a_path, required=True, metavar="PLAN.yaml", help="plan to write"
    )


MORE = (_add_actions,)


def _learn(args: argparse.Namespace) -> int:
    console = make_console()
    output.check_output("--output", args.output)
    by_hand = _read(args.output, read_plan).by_hand if args.output.exists() else {}
    assemblies = _assemblies(args.sessions, args.pause, console)
    if args.first and assemblies:
        assemblies = begun_with(assemblies, args.first)
    plan = learn_plan(assemblies, np.random.default_rng(0), by_hand)
    write_text(args.output, write_plan(plan))
    print_plan(console, plan)
    say(console, f"wrote {args.output}")
    return 0


def print_plan(console: Console, plan: WorkPlan) -> None:
    """Print a table of the steps and of their predecessors."""
    relations = {**plan.order, **plan.by_hand}
    hand = {pair for pair, p in plan.by_hand.items() if p > 0.0}
    title = f"{len(plan.steps)} steps, from {plan.n_assemblies} assemblies"
    table = boxed_table(title, "step", ">done in", ">time [s]", "after", "who", "takes")
    for step in plan.steps:
        before = [
            f"{first} (by hand)" if (first, then) in hand else f"{first} {p:.2f}"
            for (first, then), p in relations.items()
            if then == step.name and p > 0.0
        ]
        table.add_row(
            step.name,
            f"{step.share:.0%}",
            f"{step.duration_s:.1f}" if step.duration_s else "-",
            ", ".join(before) or "-",
            ", ".join(f"{who} {share:.0%}" for who, share in step.who.items()) or "-",
            ", ".join(f"{n:g} {kind}" for kind, n in step.objects.items()) or "-",
        )
    console.print(table)


def _assemblies(paths: Sequence[Path], pause_s: float, console: Console) -> tuple[Assembly, ...]:
    found = [one for path in paths if path.suffix in YAML for one in _read(path, read_assemblies)]
    bags = [path for path in paths if path.suffix not in YAML]
    sequences, rejections = read_task_sequences(bags, pause_s)
    print_left_out(console, rejections)
    for sequence in sequences:
        done = zip(sequence.tasks, sequence.durations_s, strict=True)
        found.append(tuple(DoneTask(task, duration_s=time_s) for task, time_s in done))
    return tuple(found)


def _read(path: Path, parse: Callable[[str], Content]) -> Content:
    return read_named(path, "", "Name a YAML file (docs/plans.md).", parse)
