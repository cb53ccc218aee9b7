# SPDX-License-Identifier: Apache-2.0
"""Train on a part of the recordings and score on the rest, in turn.

what is scored:
--protocol P     loo (default): leave one recording out at a time; kfold:K: K folds, by index modulo
                 K; logo:KEY: leave one group out at a time, by a key of custom_data; temporal:F:
                 train on the first share F (0.7 if not given) of each task's recordings, by name;
                 holdout:FOLDER: train on BAG and test on FOLDER
--test FOLDER    the same as --protocol holdout:FOLDER
--start-posture  whether predictions use the posture in which the controlled agent starts (default:
                 off)
--unknown-tasks  also leave each task out in turn: are its movements taken for others? (default:
                 on)

what is written:
--report OUT.html  write an HTML report
--json OUT         the numbers

# leave one out
intent evaluate demos --dofs my_dofs.yaml --report evaluation.html
# faster, in five parts
intent evaluate demos --protocol kfold:5 --json numbers.json
# learn from one folder, score on another
intent evaluate bags/toolbox/train --test bags/toolbox/test
# leave one person out at a time, by the key `person` of custom_data
intent evaluate demos --protocol logo:person
"""

import argparse
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from rich.console import Console

from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, progress_bar, say
from intent_recognition.cli.recordings import add_recording_options, read_all, training_settings
from intent_recognition.cli.rejections import (
    print_doubtful,
    print_dropped,
    print_left_out,
    print_mixed_frames,
)
from intent_recognition.cli.unlabelled import add_unlabelled_options, find_components, n_components
from intent_recognition.demonstrations import load_dofs, settle_orientations
from intent_recognition.errors import ArgumentError, first_of
from intent_recognition.evaluation import PHASES, Fold, evaluate, make_folds, remarks_on
from intent_recognition.learning import Relabelled
from intent_recognition.model import merge_frames
from intent_recognition.report import evaluation_page
from intent_recognition.signals import Demonstration, Rejection, StreamFinding

OPTIONS = {
    "start_posture": {"choices": ("on", "off"), "default": "off"},
    "unknown_tasks": {"choices": ("on", "off"), "default": "on"},
}
MORE = (partial(add_recording_options, segmentation="recording"), add_unlabelled_options)


def run(args: argparse.Namespace) -> int:
    """Evaluate, print the tables and write the requested files."""
    console = output.console_beside(args, "report")
    wanted = n_components(args)
    dofs = settle_orientations(load_dofs(args.dofs), args.bags)
    recorded, rejections = read_all(args.bags, dofs, console)
    held_out: list[Demonstration] = []
    if (test := _test_folder(args)) is not None:
        held_out, more = read_all([test], dofs, console)
        rejections += more
    mixture = {}
    if args.unlabelled:
        found = find_components(recorded, training_settings(args), wanted, console)
        purity = found.purity  # None if no recording had a label
        mixture = {"mixture": {"n_components": found.choice.n_components, "purity": purity}}
        if not _labelled(recorded):
            return _finish_unlabelled(args, mixture, found, rejections, console)
    unlabelled = [d.name for d in recorded + held_out if d.task is None]
    unread: list[Rejection | StreamFinding]
    unread = [*rejections, *(StreamFinding(name, "it has no label `task`") for name in unlabelled)]
    print_left_out(console, unread)
    usable = _labelled(recorded) + _labelled(held_out)
    if test is None:
        folds = make_folds(usable, args.protocol or "loo")
    else:
        folds = _train_and_test(len(_labelled(recorded)), len(usable))
    print_dropped(console, usable)
    print_mixed_frames(console, merge_frames(one.frames for one in usable))
    with progress_bar(console) as bar:
        unknown = args.unknown_tasks == "on" and len({d.task for d in usable}) > 1
        n_scored = sum(len(test) for _, test in folds)
        task = bar.add_task("scoring", total=2 * n_scored + unknown * len(usable))
        result = evaluate(
            usable,
            folds,
            training_settings(args),
            start_posture=args.start_posture == "on",
            unknown_tasks=unknown,
            online=True,
            progress=lambda done: bar.update(task, completed=done),
        )
    print_left_out(console, [*map(_line, result["left_out"])])
    print_doubtful(console, [*map(_line, result["doubtful"])])
    result |= {"left_out": [*map(_as_json, unread), *result["left_out"]]} | mixture
    print_result(output.table_console(args), result)
    return _write(args, result, _title(args.bags, test), console)


def _finish_unlabelled(
    args: argparse.Namespace,
    mixture: dict,
    found: Relabelled,
    rejections: list[Rejection],
    console: Console,
) -> int:
    """Print and write the results for recordings without any label."""
    print_left_out(console, rejections)
    console.print("no recording has a label: recognition and prediction are not scored")
    unread: list[Rejection | StreamFinding]
    unread = [*rejections, *(StreamFinding(*one) for one in found.rejected)]
    left_out = [*map(_as_json, unread)]
    result = {"n_demonstrations": len(found.demonstrations), "tasks": [], "left_out": left_out}
    return _write(args, result | mixture, _title(args.bags, None), console)


def _write(args: argparse.Namespace, result: dict, title: str, console: Console) -> int:
    output.write_json(args.json, result)
    if args.report:
        output.write_report(console, args.report, evaluation_page, result, title)
    return 0


def _labelled(demonstrations: list[Demonstration]) -> list[Demonstration]:
    return [d for d in demonstrations if d.task is not None]


def _test_folder(args: argparse.Namespace) -> Path | None:
    """The folder to test on; None if the protocol splits the recordings."""
    protocol, _, folder = (args.protocol or "").partition(":")
    if args.test is None:
        return Path(folder) if protocol == "holdout" and folder else None
    if args.protocol is not None:
        cure = "Leave one of them out."
        raise ArgumentError.about("--test", "no --protocol with it", args.protocol, cure)
    return args.test


def _title(bags: list[Path], test: Path | None) -> str:
    """Title of the report: what was scored, and the training recordings if they differ."""
    names = ", ".join(path.name for path in bags)
    return f"Evaluation on {f'{test.name}, learned from ' if test else ''}{names}"


def _train_and_test(n_train: int, n: int) -> list[Fold]:
    """One fold: the first n_train recordings to train on, the others to test on."""
    if not 0 < n_train < n:
        expected = "labelled recordings to train and to test on"
        cure = "Check labels and folder."
        raise ArgumentError.about("--protocol", expected, f"{n_train} and {n - n_train}", cure)
    return [(list(range(n_train)), list(range(n_train, n)))]


def _line(faulty: dict[str, str]) -> str:
    return f"{faulty['recording']}: {faulty['reason']}"


def _as_json(left_out: Rejection | StreamFinding) -> dict[str, str]:
    name = left_out.name if isinstance(left_out, StreamFinding) else Path(left_out.path).name
    return {"recording": name, "reason": left_out.reason}


def print_result(console: Console, result: dict) -> None:
    """Print tables of recognition, prediction and decision."""
    console.print(
        f"{result['n_demonstrations']} demonstrations of {', '.join(result['tasks'])};"
        f" errors in {result['unit']}"
    )
    for kind in ("recognition", "prediction"):
        for phase in PHASES:
            rows = {f"{float(share):.0%}": row for share, row in result[kind][phase].items()}
            title = f"{kind}, {phase}".replace("_", " ")
            _print_scores(console, title, f"{result['segment']} observed", rows)
    for line in remarks_on(result):
        console.print(line)
    if mistaken := result["mistaken"]:
        taken = (f"{m['recording']} ({m['true']}) for {m['recognised']}" for m in mistaken)
        say(console, f"taken for another task at the end: {first_of([*taken])}", "yellow")
    print_reactive(console, result["reactive"], result["unit"])
    _print_none(console, result["none"])
    online = {phase.removesuffix("_phase"): dict(row) for phase, row in result["online"].items()}
    for row in online.values():
        n = row.pop("n")
        row |= {name: _of(row[name], n) for name in ("recognised", "acted_on", "wrongly_acted_on")}
        row["median_share_at_decision"] = _cell(row["median_share_at_decision"], "{:.0%}")
    _print_scores(console, "online, as the nodes run", "phase", online, "{}")


def _print_scores(
    console: Console, title: str, head: str, scores: Mapping[str, Mapping], form: str = "{:.3f}"
) -> None:
    """Print a table with one row per score and one column per case."""
    table = boxed_table(title, head, *(f">{case}" for case in scores))
    for name in next(iter(scores.values())):
        cells = (_cell(values[name], form) for values in scores.values())
        table.add_row(name.replace("_", " "), *cells)
    console.print(table)


def print_reactive(console: Console, reactive: dict, unit: str | list[str]) -> None:
    """Print a table of the errors of the controlled agent's pose a little ahead, by task."""
    names = list(next(iter(next(iter(reactive.values())).values())))
    of = f" [{unit}²]" if isinstance(unit, str) else ""
    title = f"reactive: squared error{of} of the pose at every moment, unknown task and phase"
    table = boxed_table(title, "task", ">ahead", *(f">{name.replace('_', ' ')}" for name in names))
    for label, rows in reactive.items():
        for ahead, row in rows.items():
            cells = [_cell(row[name], "{:.3g}", "²") for name in names]
            table.add_row(label, f"{float(ahead):g} s", *cells)
    console.print(table)


def _print_none(console: Console, none: dict) -> None:
    """Print how movements of known tasks and of left-out tasks are recognised."""
    if none["area"] is None:
        return
    console.print(
        f"tasks left out in turn: area under the ROC of known against unknown movements"
        f" {none['area']:.3f}"
    )
    for kind in ("known", "unknown"):
        n = none["n_" + kind]
        words = {"above the threshold": "above_threshold", "recognised": "recognised"}
        words |= {"held back by an uncertain end": "held_back", "activated": "activated"}
        shares = (f"{said} {_of(none[f'{name}_{kind}'], n)}" for said, name in words.items())
        console.print(f"{kind} movements: {n}, {', '.join(shares)}")
    if none["held_back_known"]:
        end_std = none["end_std_known"]
        console.print(
            f"ends of recognised movements are predicted to a standard deviation of"
            f" {end_std['0.5']:.2f} (median; 10 % below {end_std['0.1']:.2f}, 90 % below"
            f" {end_std['0.9']:.2f}) once all was seen, more than demonstrations of their task"
            " allow to ask for (docs/recognition.md)."
        )


def _of(share: float, n: int) -> str:
    return f"{round(share * n)} of {n}"


def _cell(value: object, form: str, power: str = "") -> str:
    if isinstance(value, dict):
        return ", ".join(f"{_cell(number, form)} {unit}{power}" for unit, number in value.items())
    return "-" if value is None else form.format(value)
