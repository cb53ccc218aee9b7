# SPDX-License-Identifier: Apache-2.0
"""Say why each decision in a recording was taken: the evidence against the runner-up by time and
degree of freedom, and what would have been decided without each signal.

bag BAG            bag directory or .mcap file
--model M.npz      model that `intent train` wrote
--report OUT.html  write an HTML report
--json OUT         the evidence

# as tables, and as figures in a page
intent explain demos/give_bracket_00 --model bracket.npz --report why.html
"""

import argparse
from collections import Counter
from itertools import pairwise

import numpy as np
from rich.console import Console

from intent_recognition.bags import BagReader
from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, busy, say
from intent_recognition.evaluation import Explanation, explain
from intent_recognition.model import load_model
from intent_recognition.report import explanation_page, heading, without_rows

PARTS = 3
"""Number of intervals into which the table divides the time until a decision."""


OPTIONS = {"model": {"required": True}}


def run(args: argparse.Namespace) -> int:
    """Explain the decisions of one recording."""
    console = output.console_beside(args, "report")
    model, reader = load_model(args.model), BagReader(args.bag)
    rejected: Counter[str] = Counter()
    with busy(console, "explaining"):
        found = explain(reader, model, rejected)
    output.write_json(args.json, [one.to_json() for one in found])
    shown = output.table_console(args)
    for one in found:
        print_explanation(shown, one)
    if not found:
        say(shown, "no movement was found: `intent inspect` shows what is in the recording")
    if args.report:
        title = f"Decisions in {args.bag.name}"
        output.write_report(console, args.report, explanation_page, found, title)
    return 0


def print_explanation(console: Console, one: Explanation) -> None:
    """Print each DOF's evidence in each interval, and the decision without that DOF."""
    found = one.evidence
    edges = np.linspace(0.0, found.times_s[-1], PARTS + 1)
    part = np.clip(np.searchsorted(edges, found.times_s, side="left") - 1, 0, PARTS - 1)
    sums = np.array([found.by_dof[part == k].sum(axis=0) for k in range(PARTS)])
    times = (f">{a:.2f}-{b:.2f} s" for a, b in pairwise(edges))
    table = boxed_table(f"{heading(one)}: nats", "signal", *times, ">in all", "without it")
    table.columns[0].overflow = "fold"  # names differ at their ends
    by_name = dict(zip(found.names, sums.T, strict=True))
    table.add_row("expected before", *[""] * PARTS, _signed(found.expected), "")
    for name, total, instead in without_rows(one):
        cells = [_signed(value) for value in by_name.get(name, ())] or [""] * PARTS
        table.add_row(name, *cells, "" if total is None else _signed(total), instead)
    totals = map(_signed, sums.sum(axis=1))
    table.add_row("log odds", *totals, _signed(found.log_odds), "")
    console.print(table)


def _signed(value: float) -> str:
    return f"{round(value, 1) + 0.0:+.1f}"  # not -0.0
