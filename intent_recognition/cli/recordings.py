# SPDX-License-Identifier: Apache-2.0
"""What the commands that read recordings share: options, progress, what was left out."""

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from intent_recognition.errors import BagError, ResourceBusyError, describe
from intent_recognition.promp.training_settings import SEGMENTATIONS, TrainingSettings
from intent_recognition.storage.demonstration import Demonstration, Rejection
from intent_recognition.storage.demonstrations import find_bags, iter_demonstrations
from intent_recognition.storage.dofs import DofSpec

DEFAULTS = TrainingSettings()


def add_recording_options(parser: argparse.ArgumentParser, segmentation: str) -> None:
    """Options of `train` and `evaluate`: the bags, the DOF file and how to learn."""
    parser.add_argument(
        "bags",
        nargs="+",
        metavar="BAG",
        type=Path,
        help="a bag, a folder of bags, or a session bag; any number",
    )
    parser.add_argument(
        "--dofs", type=Path, metavar="F", help="DOF file (default: the shipped config/dofs.yaml)"
    )
    parser.add_argument(
        "--basis",
        type=int,
        default=DEFAULTS.n_basis,
        metavar="N",
        help="basis functions per DOF (default: %(default)s)",
    )
    parser.add_argument(
        "--segment",
        choices=SEGMENTATIONS,
        default=segmentation,
        help="learn from the movement alone, cut as the online detector would, or from the whole"
        " recording (default: %(default)s)",
    )


def training_settings(args: argparse.Namespace) -> TrainingSettings:
    """Settings of the learner from the options."""
    return TrainingSettings(n_basis=args.basis, segmentation=args.segment)


def progress_bar(console: Console) -> Progress:
    """A progress bar that leaves nothing behind."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )


def read_all(
    paths: Sequence[Path], dofs: DofSpec, console: Console
) -> tuple[list[Demonstration], list[Rejection]]:
    """Read all recordings with a progress bar.

    Raises:
        BagError: a path does not exist, or nothing at all could be read.
    """
    demonstrations, rejections = [], []
    total = sum(len(find_bags(path)) for path in paths)
    with progress_bar(console) as bar:
        task = bar.add_task("reading bags", total=total)
        for found in iter_demonstrations(paths, dofs):
            if isinstance(found, Demonstration):
                demonstrations.append(found)
                console_path = found.source
            else:
                rejections.append(found)
                console_path = found.path
            bar.update(task, advance=1, description=f"reading {Path(console_path).name}")
    if not demonstrations:
        reasons = "; ".join(str(r) for r in rejections[:3]) or "nothing found"
        raise BagError(
            describe(
                "BAG", "recordings with the topics of the DOF file", reasons, "Check path and DOFs."
            )
        )
    return demonstrations, rejections


def check_output(option: str, path: Path | None) -> None:
    """Find out before long work that its result could not be written.

    Raises:
        ResourceBusyError: the path is a folder, or its folder cannot be made or written to.
    """
    if path is None:
        return
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    problem = ""
    if path.is_dir():
        problem = "a folder"
    elif not folder.is_dir():
        problem = f"{folder}, which is no folder"
    elif not os.access(folder, os.W_OK):
        problem = f"{folder}, which is write-protected"
    if problem:
        raise ResourceBusyError(
            describe(f"{option} {path}", "a file that can be written", problem, "Choose another.")
        )


def write_json(path: Path, content: object, indent: int | None = None) -> None:
    """Write JSON; its folder is made if it is missing.

    Raises:
        ResourceBusyError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=indent) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResourceBusyError(
            describe(f"--json {path}", "a file that can be written", error, "Choose another.")
        ) from error


def print_left_out(console: Console, left_out: Sequence[object]) -> None:
    """Say what could not be used and why: a rejection, or a sentence, each on its line."""
    for item in left_out:
        text = f"left out {item}"
        console.print(text, style="yellow", highlight=False, markup=False, soft_wrap=True)


def print_dropped(console: Console, demonstrations: Sequence[Demonstration]) -> None:
    """Say how many messages were dropped in all, by reason."""
    total: dict[str, int] = {}
    for demonstration in demonstrations:
        for reason, count in demonstration.rejected.items():
            total[reason] = total.get(reason, 0) + count
    if total:
        parts = ", ".join(f"{count} {reason}" for reason, count in sorted(total.items()))
        console.print(f"messages dropped: {parts}", style="yellow", highlight=False)
