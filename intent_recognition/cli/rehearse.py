# SPDX-License-Identifier: Apache-2.0
"""Run a model on labelled recordings that it was not trained on, as the nodes would: wrong and
missed actions, decision times, the worst moments, what to demonstrate next.

model M.npz        model that `intent train` wrote
bags BAG...        a labelled bag, a folder of them, or a session bag; any number
--max-wrong SHARE  share of interactions that may be acted on wrongly, as the parameter `max_wrong`
                   of primitive_activation (default: %(default)s)
--report OUT.html  write an HTML report
--json OUT         the numbers

# before the robot moves
intent rehearse bracket.npz holdout --report rehearsal.html
"""

import argparse

from rich.console import Console

from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, progress_bar, say
from intent_recognition.cli.options import number
from intent_recognition.cli.recordings import read_all
from intent_recognition.cli.rejections import print_doubtful, print_dropped, print_left_out
from intent_recognition.evaluation import (
    rehearsal_to_json,
    rehearse,
    suggest_next,
    where_both_were_recorded,
)
from intent_recognition.learning import Trained
from intent_recognition.model import load_trained
from intent_recognition.recognition import MAX_WRONG, decision_settings
from intent_recognition.report import rehearsal_page, rehearsal_tables
from intent_recognition.signals import Demonstration, stream_doubts, summarise

OPTIONS = {"max_wrong": {"type": number(float, 0.001, 0.5), "default": MAX_WRONG}}


def run(args: argparse.Namespace) -> int:
    """Rehearse, print the results and write the requested files."""
    console = output.console_beside(args, "report")
    model, trained = load_trained(args.model)
    found, rejections = read_all(args.bags, model.dofs, console, of_model=True)
    print_left_out(console, rejections)
    print_dropped(console, found)
    print_doubtful(console, stream_doubts([*map(summarise, found)]))
    recordings = _movements(console, trained, found)
    settings = decision_settings(model.library, args.max_wrong)
    with progress_bar(console) as bar:
        runs = bar.track(recordings, description="rehearsing")
        rehearsal = rehearse(model.library, runs, settings)
    suggestions = suggest_next(trained, rehearsal, 5)
    output.write_json(args.json, rehearsal_to_json(rehearsal, suggestions))
    worst = rehearsal.worst(10)
    tables = rehearsal_tables(rehearsal, suggestions, worst)
    shown = output.table_console(args)
    say(shown, settings.risk or "the model holds no risk: tasks are acted on from 0.9")
    for title, (names, *rows) in tables.items():
        table = boxed_table(title, *names)
        for row in rows:
            table.add_row(*row)
        shown.print(table)
    if args.report:
        output.write_report(console, args.report, rehearsal_page, tables, worst)
    return 0


def _movements(
    console: Console, trained: Trained, found: list[Demonstration]
) -> list[Demonstration]:
    """Labelled recordings, cut to the movement; reports those that the model was trained on."""
    bags = trained.library.provenance.get("bags")
    known = {*bags} if isinstance(bags, (list, tuple)) else set()
    if again := sum(one.name in known for one in found):
        text = "recordings have names of what the model was trained on; if they are the same, the"
        say(console, f"{again} {text} numbers flatter", "yellow")
    print_left_out(console, [f"{one.name}: it has no label" for one in found if one.task is None])
    labelled = [one for one in found if one.task is not None]
    return [where_both_were_recorded(trained.preprocessing.cut(one)) for one in labelled]
