# SPDX-License-Identifier: Apache-2.0
"""`intent rehearse`: what a model would do with people, before it is deployed."""

import argparse

import numpy as np
from rich.console import Console

from intent_recognition.cli.console import boxed_table, busy, escape, progress_bar, say
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, a_path, number
from intent_recognition.cli.output import (
    PRINTED,
    add_json_option,
    check_output,
    console_beside,
    write_json,
)
from intent_recognition.cli.recordings import read_all
from intent_recognition.cli.rejections import print_dropped, print_left_out
from intent_recognition.evaluation import (
    Rehearsal,
    Rehearsed,
    Suggestion,
    rehearse,
    suggest_next,
    where_both_were_recorded,
)
from intent_recognition.learning import Trained
from intent_recognition.model import load_trained
from intent_recognition.recognition import MAX_WRONG, decision_settings
from intent_recognition.report import write_rehearsal_report
from intent_recognition.signals import Demonstration

MOST_WORST = 10
"""Worst moments that are shown. Convention."""
N_SUGGESTED = 5
"""Demonstrations that are suggested."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "rehearse",
        description="Follow labelled recordings that a model was not trained on as the nodes would:"
        " how many are acted on wrongly or missed, how long a decision takes, the worst moments,"
        " and what to demonstrate next.",
        **examples(
            (
                "before the robot moves",
                "intent rehearse bracket.npz holdout --report rehearsal.html",
            ),
        ),
    )
    parser.add_argument(
        "model", type=a_path, metavar="M.npz", help="model that `intent train` wrote"
    )
    parser.add_argument(
        "bags",
        nargs="+",
        type=a_path,
        metavar="BAG",
        help="a labelled bag, a folder of them, or a session bag; any number",
    )
    parser.add_argument(
        "--max-wrong",
        type=number(float, 0.001, 0.5),
        default=MAX_WRONG,
        metavar="SHARE",
        help="share of interactions that may be acted on wrongly, as the parameter `max_wrong` of"
        " primitive_activation (default: %(default)s)",
    )
    add_json_option(parser, "the numbers")
    parser.add_argument("--report", type=a_path, metavar="OUT.html", help="write an HTML report")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Rehearse, print, write what was asked for."""
    console = console_beside(args.json, {"--report": args.report})
    check_output("--report", args.report)
    model, trained = load_trained(args.model)
    found, rejections = read_all(args.bags, model.dofs, console)
    print_left_out(console, rejections)
    print_dropped(console, found)
    recordings = _movements(console, trained, found)
    settings = decision_settings(model.library, args.max_wrong)
    with progress_bar(console) as bar:
        task = bar.add_task("rehearsing", total=len(recordings))
        rehearsal = rehearse(
            model.library, recordings, settings, lambda done: bar.update(task, completed=done)
        )
    suggestions = suggest_next(trained, rehearsal, N_SUGGESTED)
    write_json(args.json, to_json(rehearsal, suggestions))
    if settings.risk is not None and args.json != PRINTED:
        say(console, settings.risk)
    texts = summary(rehearsal)
    rows = [_row(rehearsal, one) for one in suggestions]
    worst = rehearsal.worst(MOST_WORST)
    if args.json != PRINTED:
        _print(console, texts, rows, worst)
    if args.report:
        with busy(console, "writing the report"):
            write_rehearsal_report(args.report, rehearsal, texts, rows, worst)
        say(console, f"wrote {args.report}")
    return 0


def summary(rehearsal: Rehearsal) -> dict[str, str]:
    """The numbers as texts, by name."""
    n = len(rehearsal.runs)
    low, high = rehearsal.wrong_interval()
    decided_s = [run.decided_s for run in rehearsal.runs if not run.missed]
    computed_s = np.concatenate([run.computed_s for run in rehearsal.runs])
    texts = {
        "acted on wrongly": f"{rehearsal.n_wrong} of {n} (95 %: {low:.1%} to {high:.1%})",
        "missed": f"{rehearsal.n_missed} of {n}",
    }
    if decided_s:
        middle, late = np.percentile(decided_s, [50, 90])
        texts["decision"] = f"after {middle:.2f} s (median), {late:.2f} s (90 %)"
    if computed_s.size:
        middle, late = 1e3 * np.percentile(computed_s, [50, 99])
        texts["computation"] = f"{middle:.2f} ms (median), {late:.1f} ms (99 %)"
    return texts


def to_json(rehearsal: Rehearsal, suggestions: list[Suggestion]) -> dict[str, object]:
    """As plain values."""
    low, high = rehearsal.wrong_interval()
    return {
        "n": len(rehearsal.runs),
        "wrong": rehearsal.n_wrong,
        "wrong_interval": [low, high],
        "missed": rehearsal.n_missed,
        "runs": [
            {
                "recording": run.recorded.name,
                "task": run.task,
                "activated": list(run.activated),
                "decided_s": None if run.missed else run.decided_s,
                "computed_ms_99": 1e3 * float(np.percentile(run.computed_s, 99))
                if run.computed_s.size
                else None,
            }
            for run in rehearsal.runs
        ],
        "suggestions": [
            {
                "task": one.task,
                "like": rehearsal.runs[one.like].recorded.name,
                "prevented": one.prevented,
            }
            for one in suggestions
        ],
    }


def _movements(
    console: Console, trained: Trained, found: list[Demonstration]
) -> list[Demonstration]:
    """Labelled recordings, cut to the movement; says which the model was trained on."""
    bags = trained.library.provenance.get("bags")
    known = {*bags} if isinstance(bags, (list, tuple)) else set()
    again = [one.name for one in found if one.name in known]
    if again:
        text = "recordings have names of what the model was trained on; if they are the same, the"
        say(console, f"{len(again)} {text} numbers flatter", "yellow")
    labelled = [one for one in found if one.task is not None]
    return [where_both_were_recorded(trained.preprocessing.cut(one)) for one in labelled]


def _row(rehearsal: Rehearsal, one: Suggestion) -> tuple[str, str, float]:
    """Task, which movement to be like and from where to where, and what it prevents."""
    run = rehearsal.runs[one.like]
    first, last = (np.concatenate([signal.values[k] for signal in _during(run)]) for k in (0, -1))
    where = " to ".join(f"({', '.join(f'{x:.2f}' for x in point)})" for point in (first, last))
    group = run.recorded.metadata.get("group", "")
    who = f" of {group}" if group else ""
    return one.task, f"{run.recorded.name}{who}: {where}", one.prevented


def _during(run: Rehearsed) -> list:
    recorded = run.recorded
    return [one.between(recorded.start_ns, recorded.end_ns) for one in recorded.observed]


def _print(
    console: Console,
    texts: dict[str, str],
    rows: list[tuple[str, str, float]],
    worst: list[Rehearsed],
) -> None:
    table = boxed_table("rehearsal", "", "")
    for name, text in texts.items():
        table.add_row(name, text)
    console.print(table)
    table = boxed_table(
        "the worst moments", "recording", "task", "acted on", ">at [s]", "taken for"
    )
    for run in worst:
        best = run.labels[int(np.argmax(run.probabilities[run.worst]))]
        acted = ", ".join(run.activated) or "-"
        at = f"{run.times_s[run.worst]:.2f}"
        table.add_row(*map(escape, (run.recorded.name, run.task, acted, at, best)))
    console.print(table)
    table = boxed_table("what to demonstrate next", "task", "like", ">failures fewer")
    for task, like, prevented in rows:
        table.add_row(escape(task), escape(like), f"{prevented:.2f}")
    console.print(table)
