# SPDX-License-Identifier: Apache-2.0
"""`--unlabelled` of `intent train` and `intent evaluate`: finds the tasks in the recordings."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from intent_recognition.cli.console import boxed_table, busy, progress_bar
from intent_recognition.cli.options import add_options
from intent_recognition.cli.recordings import provenance_of, read_all
from intent_recognition.cli.rejections import print_dropped, print_left_out, with_found
from intent_recognition.demonstrations import load_dofs, settle_orientations
from intent_recognition.errors import ArgumentError
from intent_recognition.learning import (
    MAX_COMPONENTS,
    Relabelled,
    TrainingReport,
    TrainingSettings,
    label_by_components,
    learn_components,
)
from intent_recognition.model import Model, merge_frames
from intent_recognition.signals import Demonstration, stream_doubts, summarise


def add_unlabelled_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that can find the tasks themselves."""
    add_options(
        parser,
        """
        recordings without labels:
        --unlabelled         find the tasks in the recordings, whatever their labels: a mixture of
                             primitives
        --components auto|K  with --unlabelled: how many tasks, or `auto` by left-out prediction
                             (default: auto)
        """,
        components={"default": "auto"},
    )


def n_components(args: argparse.Namespace) -> int | None:
    """Number of components from `--components`, None for `auto`."""
    text = args.components
    if text != "auto" and not (text.isdecimal() and len(text) < 10 and int(text) > 0):
        raise ArgumentError.about("--components", "`auto` or a number", text, "Try auto.")
    if text != "auto" and not args.unlabelled:
        cure = "Add --unlabelled."
        raise ArgumentError.about("--components", "--unlabelled with it", "none", cure)
    return None if text == "auto" else int(text)


def check_alone(args: argparse.Namespace) -> None:
    """Refuse options that `train` cannot combine with `--unlabelled`."""
    clashes = {"--add": args.add, "--scheduler": args.scheduler, "--jobs": args.jobs > 1}
    for option, given in clashes.items():
        if given:
            got = "--unlabelled, which reads all recordings at once"
            cure = f"Leave {option} out, or label the recordings."
            raise ArgumentError.about(option, "labelled recordings", got, cure)


def train_unlabelled(
    bags: list[Path],
    dofs_path: Path | None,
    settings: TrainingSettings,
    wanted: int | None,
    console: Console,
) -> tuple[Model, TrainingReport]:
    """Read bags, find the components and learn them as tasks; print the result."""
    dofs = settle_orientations(load_dofs(dofs_path), bags)
    demonstrations, rejections = read_all(bags, dofs, console)
    found = find_components(demonstrations, settings, wanted, console)
    frames = merge_frames(recorded.frames for recorded in found.demonstrations)
    provenance = provenance_of([recorded.name for recorded in found.demonstrations], frames)
    provenance["components"] = [recorded.task for recorded in found.demonstrations]
    with busy(console, "learning"):
        report = learn_components(found, settings, provenance)
    print_left_out(console, rejections)
    print_left_out(console, [f"{name}: {reason}" for name, reason in report.rejected])
    print_dropped(console, demonstrations)
    report = report._replace(rejected=(*found.rejected, *report.rejected))
    doubts = stream_doubts([*map(summarise, found.demonstrations)])
    return Model(report.library, dofs), with_found(report, rejections, doubts)


def find_components(
    demonstrations: Sequence[Demonstration],
    settings: TrainingSettings,
    wanted: int | None,
    console: Console,
) -> Relabelled:
    """Find the components of recordings with a progress bar; print candidates and choice."""
    with progress_bar(console) as bar:
        task = bar.add_task("looking for components", total=MAX_COMPONENTS)
        found = label_by_components(
            demonstrations,
            settings,
            np.random.default_rng(0),  # reproducible
            n_components=wanted,
            progress=lambda done: bar.update(task, completed=done),
        )
    print_left_out(console, [f"{name}: {reason}" for name, reason in found.rejected])
    print_components(console, found)
    return found


def print_components(console: Console, found: Relabelled) -> None:
    """Print the candidates, the choice, and its purity where labels are known."""
    titles = (">components", ">nll [nats per sample]", ">error [std]", ">")
    table = boxed_table("left-out prediction", *titles)
    for tried in found.choice.tried:
        taken = "taken" if tried is found.choice.chosen else ""
        table.add_row(
            str(tried.n_components), f"{tried.nll.mean():.3f}", f"{tried.rmse.mean():.3f}", taken
        )
    console.print(table)
    sizes = np.bincount(found.choice.chosen.labels)
    text = f"{len(sizes)} components of {', '.join(map(str, sizes))} demonstrations"
    if found.purity is not None:
        text += f"; purity {found.purity:.3f} by the labels they have"
    console.print(text)
