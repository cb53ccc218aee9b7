# SPDX-License-Identifier: Apache-2.0
"""What the commands that read recordings share: options, progress, what was left out."""

import argparse
import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from intent_recognition.demonstrations import DofSpec, find_bags, iter_demonstrations
from intent_recognition.errors import BagError, ResourceBusyError, describe
from intent_recognition.learning import SEGMENTATIONS, Reference, TrainingSettings
from intent_recognition.model import FromBags, Run, accumulate_bags, list_bags
from intent_recognition.signals import Demonstration, Rejection

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
    group = parser.add_argument_group("how to learn")
    group.add_argument(
        "--dofs", type=Path, metavar="F", help="DOF file (default: the shipped config/dofs.yaml)"
    )
    group.add_argument(
        "--basis",
        type=int,
        default=DEFAULTS.n_basis,
        metavar="N",
        help="basis functions per DOF (default: %(default)s)",
    )
    group.add_argument(
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
    """A progress bar that leaves nothing behind, and is not there where no terminal is."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


@contextmanager
def busy(console: Console, what: str) -> Iterator[None]:
    """A bar that only says that, and for how long, work of unknown length goes on."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        bar.add_task(what, total=None)
        yield


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
        raise nothing_read(rejections)
    return demonstrations, rejections


def accumulate_all(
    paths: Sequence[Path],
    dofs: DofSpec,
    settings: TrainingSettings,
    console: Console,
    *,
    run: Run = map,
    reference: Reference | None = None,
) -> FromBags:
    """Statistics of all recordings with a progress bar, in memory that does not grow with them.

    Raises:
        BagError: a path does not exist, or nothing at all could be read.
    """
    total = len(list_bags(paths)[0])
    with progress_bar(console) as bar:
        task = bar.add_task("reading bags", total=total)
        found = accumulate_bags(
            paths,
            dofs,
            settings,
            reference=reference,
            run=run,
            progress=lambda n_bags: bar.update(task, advance=n_bags),
        )
    if not found.accumulated.n_used and not found.accumulated.n_rejected:
        raise nothing_read(found.rejections)
    return found


def nothing_read(rejections: Sequence[Rejection]) -> BagError:
    """The error that no recording could be read."""
    reasons = "; ".join(str(r) for r in rejections[:3]) or "nothing found"
    return BagError(
        describe(
            "BAG", "recordings with the topics of the DOF file", reasons, "Check path and DOFs."
        )
    )


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


def print_left_out(
    console: Console, left_out: Sequence[object], n_left_out: int | None = None
) -> None:
    """Say what could not be used and why: a rejection, or a sentence, each on its line.

    Args:
        console: where to.
        left_out: what.
        n_left_out: how many there are in all, where those listed are only the first of very many.
    """
    lines = [f"left out {item}" for item in left_out]
    if n_left_out is not None and n_left_out > len(lines):
        lines.append(f"left out {n_left_out - len(lines)} more")
    for text in lines:
        console.print(text, style="yellow", highlight=False, markup=False, soft_wrap=True)


def all_left_out(found: FromBags) -> tuple[tuple[str, str], ...]:
    """(recording, reason) of what could not be read and of what could not be learned from."""
    unread = [(r.path, f"{r.topic}: {r.reason}" if r.topic else r.reason) for r in found.rejections]
    return (*unread, *found.accumulated.rejected)


def print_found(console: Console, found: FromBags) -> None:
    """Say what of the bags could not be used and why."""
    accumulated = found.accumulated
    print_left_out(console, found.rejections, found.n_rejections)
    reasons = [f"{name}: {reason}" for name, reason in accumulated.rejected]
    print_left_out(console, reasons, accumulated.n_rejected)
    print_dropped_counts(console, found.dropped)


def print_dropped(console: Console, demonstrations: Sequence[Demonstration]) -> None:
    """Say how many messages were dropped in all, by reason."""
    total: Counter[str] = Counter()
    for demonstration in demonstrations:
        total.update(demonstration.rejected)
    print_dropped_counts(console, total)


def print_dropped_counts(console: Console, total: Mapping[str, int]) -> None:
    """The same, counted."""
    if total:
        parts = ", ".join(f"{count} {reason}" for reason, count in sorted(total.items()))
        console.print(f"messages dropped: {parts}", style="yellow", highlight=False)
