# SPDX-License-Identifier: Apache-2.0
"""Learn a library of tasks from labelled demonstrations, write it to one file, and name what could
not be used.

what is written:
--output M.npz  model file to write
--json OUT      what was learned and left out

the order of tasks:
--sessions DIR...  session bags, or folders of them, from which to learn which task follows which

more demonstrations for an existing model:
--add M.npz     add the bags to this model, which keeps its DOFs, basis, onset thresholds and
                regularisation
--choose-again  with --add: choose the regularisation again

# learn from the shipped recordings
intent train bags/toolbox/train --output toolbox.npz
# with DOFs of your own
intent train demos --dofs my_dofs.yaml --output bracket.npz
# add one more demonstration
intent train --add bracket.npz demos/give_bracket_20 --output bracket2.npz
# find the tasks in recordings without labels
intent train demos --unlabelled --output tasks.npz
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, busy, say
from intent_recognition.cli.inspect_model import print_transitions
from intent_recognition.cli.recordings import (
    accumulate_all,
    add_recording_options,
    provenance_of,
    training_settings,
)
from intent_recognition.cli.rejections import (
    print_doubtful,
    print_found,
    print_left_out,
    print_mixed_frames,
    with_found,
)
from intent_recognition.cli.train_add import add_to_model, check_adding
from intent_recognition.cli.train_workers import add_worker_options, workers
from intent_recognition.cli.unlabelled import (
    add_unlabelled_options,
    check_alone,
    n_components,
    train_unlabelled,
)
from intent_recognition.demonstrations import (
    find_bags,
    load_dofs,
    read_task_sequences,
    settle_orientations,
)
from intent_recognition.errors import BagError
from intent_recognition.learning import (
    TrainingReport,
    TrainingSettings,
    count_transitions,
    learn_accumulated,
    smoothed_transitions,
)
from intent_recognition.model import Model, Run, frames_of, save_model
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import FORGET_AFTER_S
from intent_recognition.signals import stream_doubts

PACE_WORDS = {
    "steady": "at steady progress",
    "own": "at the human's pace",
    "shared": "at a shared pace",
    "aligned": "aligned in time",
}
"""Words with which `PACES` are printed."""


OPTIONS = {"output": {"required": True}, "sessions": {"default": []}}
MORE = (
    partial(add_recording_options, segmentation="movement"),
    add_unlabelled_options,
    add_worker_options,
)


def run(args: argparse.Namespace) -> int:
    """Train, write the model, and print what was learned and left out."""
    console = output.console_beside(args, "output")
    settings = training_settings(args)
    wanted = n_components(args)
    check_adding(args)
    for path in args.sessions:
        find_bags(path)
    if args.unlabelled:
        check_alone(args)
        model, report = train_unlabelled(args.bags, args.dofs, settings, wanted, console)
        return finish(args, model, report, console)
    with workers(args.jobs, args.scheduler) as run_elsewhere:
        if args.add is None:
            model, report = train(args.bags, args.dofs, settings, console, run_elsewhere)
        else:
            model, report = add_to_model(args, settings, console, run_elsewhere)
    return finish(args, model, report, console)


def finish(args: argparse.Namespace, model: Model, report: TrainingReport, console: Console) -> int:
    """Print what was learned, add transitions, and write the model."""
    print_library(output.table_console(args), model.library, report)
    print_mixed_frames(console, frames_of(model.library))
    print_doubtful(console, report.doubtful)
    model = with_sessions(model, args.sessions, console)
    save_model(args.output, model, report.trained)
    output.write_json(args.json, report_json(model, report) | {"output": str(args.output)})
    say(console, f"wrote {args.output}")
    return 0


def report_json(model: Model, report: TrainingReport) -> dict:
    """What was learned, from which recordings, and what was left out, as plain values."""
    library = model.library
    return {
        "n_used": report.n_used,
        "left_out": [{"recording": name, "reason": reason} for name, reason in report.rejected],
        "doubtful": [{"recording": one.name, "reason": one.reason} for one in report.doubtful],
        "tasks": {
            label: {
                "n_demonstrations": int(library.n_demonstrations[k]),
                "median_duration_s": float(library.durations_s[k]),
            }
            for k, label in enumerate(library.labels)
        },
        "regularisation": {
            name: value if isinstance(value, str) or not np.isnan(value) else None
            for name, value in report.chosen._asdict().items()
        },
    }


def train(
    bags: list[Path],
    dofs_path: Path | None,
    settings: TrainingSettings,
    console: Console,
    run: Run = map,
) -> tuple[Model, TrainingReport]:
    """Read bags and learn; print what was left out."""
    dofs = settle_orientations(load_dofs(dofs_path), bags)
    found = accumulate_all(bags, dofs, settings, console, run=run)
    provenance = provenance_of(list(found.accumulated.used), found.frames)
    with busy(console, "learning"):
        report = learn_accumulated(found.accumulated, provenance)
    print_found(console, found)
    doubts = stream_doubts(found.summaries)
    return Model(report.library, dofs), with_found(report, found.rejections, doubts)


def print_library(console: Console, library: TaskLibrary, report: TrainingReport) -> None:
    """Print a table of the tasks, the regularisation, and warnings about poor predictions."""
    titles = ("task", ">demonstrations", ">duration [s]", ">std of duration")
    table = boxed_table(f"learned from {report.n_used} demonstrations", *titles)
    for index, label in enumerate(library.labels):
        table.add_row(
            label,
            str(library.n_demonstrations[index]),
            f"{library.durations_s[index]:.2f}",
            f"x {np.exp(library.log_duration_std[index]):.2f}",
        )
    console.print(table)
    chosen = report.chosen
    how = f"{PACE_WORDS[chosen.pace]}, noise variance x {chosen.noise_scale:g}"
    if library.coupling is not None and np.any(library.coupling.gain):
        how += ", residuals coupled"
    if not report.tried:
        console.print(f"settings kept: {how}")
        return
    console.print(
        f"chosen from {len(report.tried)} candidates by cross-validation: {how}"
        f" (log loss {chosen.log_loss:.3f} nats, squared error of the controlled agent"
        f" {chosen.error:.3f} of its variance)"
    )
    if library.n_tasks > 1 and chosen.log_loss > np.log(library.n_tasks):
        console.print(
            f"Guessing would recognise the tasks better (log loss"
            f" {np.log(library.n_tasks):.3f}): a label may be wrong, or tasks look alike."
            " `intent evaluate` names recordings that are taken for another task.",
            style="yellow",
        )
    if chosen.error > 1.0:
        console.print(
            "A constant posture would predict the controlled agent better: record more"
            " demonstrations, and look at these with `intent inspect`.",
            style="yellow",
        )


def with_sessions(model: Model, sessions: Sequence[Path], console: Console) -> Model:
    """The model with a transition prior from recorded sessions; unchanged without sessions."""
    if not sessions:
        return model
    library = model.library
    sequences, rejections = read_task_sequences(sessions, FORGET_AFTER_S)
    print_left_out(console, rejections)
    counts = count_transitions([sequence.tasks for sequence in sequences], library.labels)
    if not counts.sum():
        seen = sorted({task for sequence in sequences for task in sequence.tasks})
        expected = f"recordings in which {', '.join(library.labels)} follow one another"
        got = f"labels {', '.join(seen)}" if seen else f"{len(rejections)} bags without labels"
        cure = "Give session bags with `demonstration` or `intent/active_task` labels."
        raise BagError.about("--sessions", expected, got, cure)
    names = [Path(sequence.source).name for sequence in sequences]
    provenance = {
        **library.provenance,
        "sessions": list(dict.fromkeys(names)),
        "transition_counts": counts.astype(int).tolist(),
    }
    learned = replace(library, transition_prior=smoothed_transitions(counts), provenance=provenance)
    unknown = {t for sequence in sequences for t in sequence.tasks} - set(library.labels)
    for label in sorted(unknown):
        say(console, f"ignored in sessions: {label}, which is no task of the model", "yellow")
    print_transitions(console, learned, f"from {int(counts.sum())} tasks in sessions")
    return replace(model, library=learned)
