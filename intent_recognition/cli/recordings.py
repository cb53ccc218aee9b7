# SPDX-License-Identifier: Apache-2.0
"""Shared options and reading of the commands that learn from recordings."""

import argparse
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

from rich.console import Console

from intent_recognition import __version__
from intent_recognition.cli.console import progress_bar
from intent_recognition.cli.options import add_options, number
from intent_recognition.cli.rejections import nothing_of
from intent_recognition.demonstrations import DofSpec, find_bags, load_dofs, read_demonstrations
from intent_recognition.errors import BagError
from intent_recognition.learning import SEGMENTATIONS, Preprocessing, TrainingSettings
from intent_recognition.model import FRAMES, Frames, FromBags, Run, accumulate_bags, list_bags
from intent_recognition.signals import Demonstration, Rejection

DEFAULTS = TrainingSettings()
DOFS = "dofs.yaml"
"""Name of the DOF file that `intent import` writes beside its bags."""


def add_recording_options(parser: argparse.ArgumentParser, segmentation: str) -> None:
    """Add the options of `train` and `evaluate`: bags, DOF file and learning."""
    add_options(
        parser,
        """
        bags BAG...  a bag, a folder of bags, or a session bag; any number

        how to learn:
        --dofs F   DOF file (default: the shipped config/dofs.yaml)
        --basis N  basis functions per DOF (default: %(default)s)
        --segment  learn from the movement alone, cut as the online detector would, or from the
                   whole recording (default: %(default)s)
        """,
        basis={"type": number(int, 3, 200), "default": DEFAULTS.n_basis},
        segment={"choices": SEGMENTATIONS, "default": segmentation},
    )


def training_settings(args: argparse.Namespace) -> TrainingSettings:
    """Settings of learning from the options."""
    return TrainingSettings(n_basis=args.basis, segmentation=args.segment)


def read_all(
    paths: Sequence[Path], dofs: DofSpec, console: Console, *, of_model: bool = False
) -> tuple[list[Demonstration], list[Rejection]]:
    """Read all recordings with a progress bar. `of_model`: the DOFs come from a model."""
    demonstrations: list[Demonstration] = []
    rejections: list[Rejection] = []
    bags = {bag.resolve(): bag for path in paths for bag in find_bags(path) or [path]}.values()
    with progress_bar(console) as bar:
        task = bar.add_task("reading bags", total=len(bags))
        for bag in bags:
            bar.update(task, description=f"reading {bag.name}")
            usable, left_out = read_demonstrations(bag, dofs)
            demonstrations += usable
            rejections += left_out
            bar.advance(task)
    if not demonstrations:
        raise nothing_read(paths, None if of_model else dofs, rejections)
    return demonstrations, rejections


def accumulate_all(
    paths: Sequence[Path],
    dofs: DofSpec,
    settings: TrainingSettings,
    console: Console,
    *,
    run: Run = map,
    preprocessing: Preprocessing | None = None,
) -> FromBags:
    """Statistics of all recordings, with a progress bar; memory does not grow with their number."""
    total = len(list_bags(paths)[0])
    with progress_bar(console) as bar:
        task = bar.add_task("reading bags", total=total)
        found = accumulate_bags(
            paths,
            dofs,
            settings,
            preprocessing=preprocessing,
            run=run,
            progress=lambda n_bags: bar.update(task, advance=n_bags),
        )
    if not found.accumulated.n_used and not found.accumulated.n_rejected:
        raise nothing_read(paths, dofs if preprocessing is None else None, found.rejections)
    return found


def nothing_read(
    paths: Sequence[Path], dofs: DofSpec | None, rejections: Sequence[Rejection]
) -> BagError:
    """The error that no recording could be read with these DOFs; None: the DOFs of a model."""
    cure = "Check path and DOFs."
    if dofs is None:
        cure = "Give recordings of what the model was learned from."
    elif dofs == load_dofs() and any(one.topic and not one.cure for one in rejections):
        near = [folder / DOFS for path in paths for folder in (path, path.parent)]
        own = next((f"--dofs {path}" for path in near if path.is_file()), "another with --dofs")
        cure = f"The shipped DOF file was used: give {own}."
    return nothing_of("BAG", "recordings with the topics of the DOF file", rejections, cure)


def provenance_of(bags: list[str], frames: Frames) -> dict[str, object]:
    """Provenance of a model: package version, date, names of recordings, and frames."""
    created = datetime.now(timezone.utc).isoformat(timespec="seconds")
    return {"package_version": __version__, "created": created, "bags": bags, FRAMES: frames}
