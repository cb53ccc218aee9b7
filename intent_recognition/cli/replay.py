# SPDX-License-Identifier: Apache-2.0
"""Run the online estimator over a recording, and print the probabilities of the tasks over time and
when a task became active.

bag BAG            bag directory or .mcap file
--model M.npz      model that `intent train` wrote
--report OUT.html  write an HTML report of the decisions, as `intent explain` does
--json OUT         every observation

# the posterior over time, and when the robot would have acted
intent replay demos/give_bracket_00 --model bracket.npz
# every observation, for a script
intent replay demos/give_bracket_00 --model bracket.npz --json rows.json
"""

import argparse
from collections import Counter
from itertools import pairwise

from rich.console import Console

from intent_recognition.bags import BagReader
from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, progress_bar, say
from intent_recognition.cli.rejections import print_dropped_counts
from intent_recognition.evaluation import explain, replay
from intent_recognition.model import load_model
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.report import explanation_page

OPTIONS = {"model": {"required": True}}


def run(args: argparse.Namespace) -> int:
    """Replay one recording."""
    console = output.console_beside(args, "report")
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
    output.write_json(args.json, rows, indent=None)
    print_rows(output.table_console(args), model.library, rows)
    active = {row["active_task"] for row in rows}
    for reason in (reason for task, reason in held_back.items() if task not in active):
        say(console, f"not activated: {reason}", "yellow")
    print_dropped_counts(console, rejected)
    if args.report:
        found, title = explain(reader, model), f"Decisions in {args.bag.name}"
        output.write_report(console, args.report, explanation_page, found, title)
    return 0


def print_rows(console: Console, library: TaskLibrary, rows: list[dict]) -> None:
    """Print about twenty lines of the posterior over time, and when each task became active."""
    labels = (*library.labels, NONE)
    titles = (f">{column}" for column in ("time [s]", *labels, "phase", "active"))
    step = max(1, len(rows) // 20)
    shown = f", one in {step} of them shown (all with --json)" if step > 1 else ""
    table = boxed_table(f"{len(rows)} observations{shown}", *titles)
    for row in rows[::step]:
        best = max(row["probabilities"], key=row["probabilities"].get)
        table.add_row(
            _since(rows, row),
            *(f"{row['probabilities'][label]:.2f}" for label in labels),
            f"{row['phase'][best]:.2f}",
            row["active_task"] or "-",
        )
    console.print(table)
    begun = [
        f"{row['active_task']} after {_since(rows, row)} s"
        for before, row in pairwise([{"active_task": ""}, *rows])
        if row["active_task"] not in ("", before["active_task"])
    ]
    say(console, f"became active: {', '.join(begun)}" if begun else "no task became active")


def _since(rows: list[dict], row: dict) -> str:
    """Seconds since the first observation, as text."""
    return f"{(row['stamp'] - rows[0]['stamp']) * 1e-9:.2f}"
