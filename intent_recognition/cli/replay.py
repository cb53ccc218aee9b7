# SPDX-License-Identifier: Apache-2.0
"""`intent replay`: the online estimator over a recording, without ROS."""

import argparse
from collections import Counter

from rich.console import Console

from intent_recognition.bags import BagReader
from intent_recognition.cli.console import boxed_table, progress_bar
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, a_path
from intent_recognition.cli.output import (
    PRINTED,
    add_json_option,
    console_beside,
    write_json,
)
from intent_recognition.errors import BagError
from intent_recognition.evaluation import replay
from intent_recognition.model import load_model
from intent_recognition.promp import NONE, TaskLibrary

PRINTED_ROWS = 20
"""Rows of the printed table, about. Convention: one screen."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "replay",
        help="run the online estimator over a recording",
        description="Print the task posterior over time, as the nodes would publish it.",
        **examples(
            (
                "the posterior over time, and when the robot would have acted",
                "intent replay demos/give_bracket_00 --model bracket.npz",
            ),
            (
                "every observation, for a script",
                "intent replay demos/give_bracket_00 --model bracket.npz --json rows.json",
            ),
        ),
    )
    parser.add_argument("bag", type=a_path, metavar="BAG", help="bag directory or .mcap file")
    parser.add_argument(
        "--model", type=a_path, required=True, metavar="M.npz", help="written by `intent train`"
    )
    add_json_option(parser, "every observation")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Replay one recording."""
    console = console_beside(args.json)
    model = load_model(args.model)
    reader = BagReader(args.bag)
    rejected: Counter[str] = Counter()
    held_back: dict[str, str] = {}
    observed = [entry.topic.lstrip("/") for entry in model.dofs.observed]
    counts = {name.lstrip("/"): info.message_count for name, info in reader.topics.items()}
    with progress_bar(console) as bar:
        total = sum(counts.get(topic, 0) for topic in observed)
        steps = replay(reader, model, rejected, held_back=held_back)
        rows = list(bar.track(steps, total=total, description="replaying"))
    dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(rejected.items()))
    if not rows:
        raise BagError.about(
            str(args.bag),
            f"observations on {', '.join(entry.topic for entry in model.dofs.observed)}",
            f"only {dropped}" if dropped else f"topics {', '.join(reader.topics) or 'none'}",
            "Replay a recording with the topics of the model's DOF file, in the frame that"
            " `intent inspect` shows for the model.",
        )
    write_json(args.json, rows, indent=None)
    if args.json != PRINTED:
        print_rows(console, model.library, rows)
    active = {row["active_task"] for row in rows}
    for reason in (reason for task, reason in held_back.items() if task not in active):
        console.print(f"not activated: {reason}", style="yellow")
    if dropped:
        console.print(f"messages dropped: {dropped}", style="yellow")
    return 0


def print_rows(console: Console, library: TaskLibrary, rows: list[dict]) -> None:
    """About twenty lines of the posterior over time."""
    labels = (*library.labels, NONE)
    titles = (f">{column}" for column in ("time [s]", *labels, "phase", "active"))
    table = boxed_table(f"{len(rows)} observations", *titles)
    for row in rows[:: max(1, len(rows) // PRINTED_ROWS)]:
        best = max(row["probabilities"], key=row["probabilities"].get)
        table.add_row(
            f"{(row['stamp'] - rows[0]['stamp']) * 1e-9:.2f}",
            *(f"{row['probabilities'][label]:.2f}" for label in labels),
            f"{row['phase'][best]:.2f}",
            row["active_task"] or "-",
        )
    console.print(table)
