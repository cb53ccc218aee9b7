# SPDX-License-Identifier: Apache-2.0
"""`intent train`: learn a library of interaction primitives from bags."""

import argparse
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from intent_recognition import __version__
from intent_recognition.cli.adding import add_adding_options, add_to_model
from intent_recognition.cli.console import make_console
from intent_recognition.cli.recordings import (
    add_recording_options,
    check_output,
    gather_all,
    print_found,
    training_settings,
)
from intent_recognition.cli.transitions import add_sessions_option, with_sessions
from intent_recognition.cli.unlabelled import (
    add_unlabelled_options,
    check_alone,
    n_components,
    train_unlabelled,
)
from intent_recognition.cli.workers import add_worker_options, workers
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.training import TrainingReport, TrainingSettings, learn_gathered
from intent_recognition.storage.dofs import load_dofs
from intent_recognition.storage.gather import Run
from intent_recognition.storage.model import Model, save_model


def add_parser(subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "train", help="learn from demonstrations", description="Learn from demonstrations."
    )
    add_recording_options(parser, "movement")
    parser.add_argument(
        "--output", type=Path, required=True, metavar="M.npz", help="model file to write"
    )
    add_unlabelled_options(parser)
    add_sessions_option(parser)
    add_adding_options(parser)
    add_worker_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Train, write the model, print what was learned and what was left out."""
    console = make_console()
    check_output("--output", args.output)
    settings = training_settings(args)
    wanted = n_components(args)
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
    """Print what was learned, add transitions, write the model."""
    print_library(console, model.library, report)
    model = with_sessions(model, args.sessions, console)
    save_model(args.output, model, report.trained)
    console.print(f"wrote {args.output}", highlight=False)
    return 0


def train(
    bags: list[Path],
    dofs_path: Path | None,
    settings: TrainingSettings,
    console: Console,
    run: Run = map,
) -> tuple[Model, TrainingReport]:
    """Read bags and learn; what was left out is printed to the console.

    Args:
        bags: bags, folders of bags or session bags.
        dofs_path: DOF file, None for the shipped one.
        settings: how to learn.
        console: where to print to.
        run: where bags are read, see `workers`.

    Raises:
        IntentError: nothing can be read or learned.
    """
    dofs = load_dofs(dofs_path)
    found = gather_all(bags, dofs, settings, console, run=run)
    provenance = {
        "package_version": __version__,
        "created": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "bags": list(found.gathered.used),
    }
    library, report = learn_gathered(found.gathered, provenance)
    print_found(console, found)
    return Model(library, dofs), report


def print_library(console: Console, library: TaskLibrary, report: TrainingReport) -> None:
    """A table of the tasks and one line on the regularisation."""
    table = Table(title=f"learned from {report.n_used} demonstrations")
    for column in ("task", "demonstrations", "duration [s]", "spread of duration"):
        table.add_column(column, justify="left" if column == "task" else "right")
    for index, label in enumerate(library.labels):
        table.add_row(
            label,
            str(library.n_demonstrations[index]),
            f"{library.durations_s[index]:.2f}",
            f"x {np.exp(library.log_duration_std[index]):.2f}",
        )
    console.print(table)
    chosen = report.chosen
    strength, scale, kind = chosen.strength, chosen.noise_scale, "at steady progress"
    if chosen.aligned:
        strength, scale, kind = chosen.aligned_strength, chosen.aligned_noise_scale, "aligned"
    console.print(
        f"regularisation by leave-one-out, {kind}: target worth {strength:g} demonstrations,"
        f" noise variance x {scale:g} ({len(report.tried)} pairs tried; steady error"
        f" {chosen.score:.3f} of the variance)",
        highlight=False,
    )
