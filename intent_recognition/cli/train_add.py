# SPDX-License-Identifier: Apache-2.0
"""`intent train --add`: adds demonstrations to a model without its old bags."""

import argparse
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from intent_recognition.cli.console import busy, say
from intent_recognition.cli.recordings import DEFAULTS, accumulate_all
from intent_recognition.cli.rejections import print_found, with_found
from intent_recognition.demonstrations import load_dofs
from intent_recognition.errors import ArgumentError, TrainingError, first_of
from intent_recognition.learning import (
    Accumulated,
    Trained,
    TrainingReport,
    TrainingSettings,
    add_statistics,
    choose_again,
)
from intent_recognition.model import Model, Run, check_dofs, load_trained, with_frames


def check_adding(args: argparse.Namespace) -> None:
    """Refuse options that need `--add` if it is missing."""
    if args.choose_again and args.add is None:
        cure = "Leave it out: training anew always chooses."
        raise ArgumentError.about("--choose-again", "--add with it", "none", cure)


def add_to_model(
    args: argparse.Namespace, settings: TrainingSettings, console: Console, run: Run
) -> tuple[Model, TrainingReport]:
    """The model of `--add` with the bags' demonstrations added; prints what was left out."""
    model, trained = load_trained(args.add)
    _check_settings(args.add, settings, trained.preprocessing.settings)
    dofs = model.dofs
    if args.dofs is not None:
        given = check_dofs(model, load_dofs(args.dofs), str(args.dofs))
        dofs = replace(dofs, extrinsics=given.extrinsics)
    found = accumulate_all(
        args.bags, dofs, settings, console, run=run, preprocessing=trained.preprocessing
    )
    print_found(console, found)
    accumulated = found.accumulated
    if not accumulated.n_used:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in accumulated.rejected[:3])
        cure = "Check the labels."
        raise TrainingError.about("BAG", "a demonstration that can be added", reasons, cure)
    _print_known(console, trained, accumulated)
    with busy(console, "adding"):
        more = add_statistics(trained, accumulated.tasks, accumulated.used)
    tried: tuple = ()
    if args.choose_again:
        with busy(console, "choosing the regularisation"):
            more, tried = choose_again(more)
    more = with_frames(more, found.frames)
    report = TrainingReport(
        accumulated.used,
        accumulated.rejected,
        more.chosen,
        tried,
        sum(task.n for task in more.tasks.values()),
        accumulated.n_rejected,
        more,
    )
    return Model(more.library, dofs), with_found(report, found.rejections, found.doubts(more))


def _print_known(console: Console, trained: Trained, accumulated: Accumulated) -> None:
    """Warn of recordings with names that the model knows: it can compare nothing but names."""
    before = trained.library.provenance.get("bags")
    known = {*before} if isinstance(before, (list, tuple)) else set()
    if again := [name for name in accumulated.used if name in known]:
        names = first_of(again)
        say(console, f"the model already has recordings of these names: {names}", "yellow")
        say(console, "Those that are the same recordings are now counted twice.", "yellow")


def _check_settings(path: Path, given: TrainingSettings, kept: TrainingSettings) -> None:
    """Refuse options that contradict the model; options at their default take the model's value."""
    for option, name in (("--basis", "n_basis"), ("--segment", "segmentation")):
        value, ours = getattr(given, name), getattr(kept, name)
        if value not in (ours, getattr(DEFAULTS, name)):
            cure = "Leave it out, or train anew."
            raise ArgumentError.about(option, f"{ours}, as in {path}", value, cure)
