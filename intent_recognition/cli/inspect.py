# SPDX-License-Identifier: Apache-2.0
"""`intent inspect`: what is in a bag, a folder of bags or a model."""

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

from rich.console import Console
from rich.progress import track

from intent_recognition.cli.console import make_console
from intent_recognition.cli.help import examples
from intent_recognition.cli.inspect_tables import print_bag, print_folder, print_model
from intent_recognition.cli.recordings import busy
from intent_recognition.demonstrations import BagSummary, find_bags, inspect_bag
from intent_recognition.errors import BagError, describe
from intent_recognition.model import Model, load_model
from intent_recognition.promp import AlignedPrimitives, least_end_std

CURE = "Give a bag, a folder of bags, or a model that `intent train` wrote."


def add_parser(subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "inspect",
        help="what is in a recording or a model",
        description="Show what is in a bag (topics, rates, gaps, outliers, labels), in each bag of"
        " a folder, or in a model (tasks, degrees of freedom, timing, noise, where it came from).",
        **examples(
            ("one line per recording", "intent inspect bags/toolbox/test"),
            (
                "one recording: topics, rates, gaps, outliers",
                "intent inspect demos/give_bracket_00",
            ),
            ("a model, for a script", "intent inspect bracket.npz --json"),
        ),
    )
    parser.add_argument("path", type=Path, metavar="BAG|MODEL", help="bag, folder, or model file")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print it.

    Raises:
        BagError: there is nothing that could be a recording.
        ModelError: the model file cannot be used.
    """
    console = make_console()
    if args.path.suffix == ".npz":
        model = load_model(args.path)
        if args.json:
            _print_json(model_json(model))
        else:
            print_model(console, args.path, model)
        return 0
    bags = find_bags(args.path)
    if not bags:
        raise BagError(describe(str(args.path), "recordings", "none in this folder", CURE))
    if bags == [args.path]:
        with busy(Console(stderr=True), "reading"):
            summary = inspect_bag(args.path)
        if args.json:
            _print_json(bag_json(summary))
        else:
            print_bag(console, summary)
        return 0
    return _inspect_folder(console, args.path, bags, args.json)


def bag_json(summary: BagSummary) -> dict:
    """A bag's summary as plain values."""
    topics = tuple(replace(t, rejected=dict(t.rejected)) for t in summary.topics)
    return asdict(replace(summary, topics=topics)) | {
        "duration_s": summary.duration_s,
        "message_count": summary.message_count,
    }


def model_json(model: Model) -> dict:
    """What a model holds as plain values, its large arrays left out."""
    library = model.library
    names = (*library.observed_names, *library.controlled_names)
    return {
        "tasks": {
            label: {
                "n_demonstrations": int(library.n_demonstrations[k]),
                "median_duration_s": float(library.durations_s[k]),
                "log_duration_std": float(library.log_duration_std[k]),
                "prior": float(library.task_prior[k]),
                "least_end_std": least_end_std(library.primitives, k),
            }
            for k, label in enumerate(library.labels)
        },
        "observed": dict(zip(library.observed_names, library.observed_units, strict=True)),
        "controlled": dict(zip(library.controlled_names, library.controlled_units, strict=True)),
        "noise_std": dict(zip(names, map(float, library.noise_variance**0.5), strict=True)),
        "n_basis": library.basis.n_basis,
        "noise_scale": library.noise_scale,
        "recognition_noise_scale": library.recognition_noise_scale,
        "aligned": _aligned_json(library.aligned),
        "correlation_time_s": library.correlation_time_s,
        "none_prior": library.none_prior,
        "dofs": model.dofs.to_dict(),
        "provenance": dict(library.provenance),
    }


def _aligned_json(primitives: AlignedPrimitives | None) -> dict | None:
    """The primitives over reference phase as plain values."""
    if primitives is None:
        return None
    return {
        "n_basis": primitives.basis.n_basis,
        "noise_scale": primitives.noise_scale,
        "largest_lead_std": float(primitives.phase_deviation.deviation_std.max()),
        "lead_correlation": primitives.phase_deviation.correlation,
    }


def _inspect_folder(console: Console, root: Path, bags: list[Path], as_json: bool) -> int:
    """One line (or JSON object) per bag; an unreadable bag gets one too, and exit code 1."""
    found: list[tuple[Path, BagSummary | BagError]] = []
    stderr = Console(stderr=True)
    for bag in track(
        bags, "reading", console=stderr, transient=True, disable=not stderr.is_terminal
    ):
        try:
            found.append((bag, inspect_bag(bag)))
        except BagError as error:
            found.append((bag, error))
    if as_json:
        _print_json(
            [
                bag_json(got)
                if isinstance(got, BagSummary)
                else {"path": str(bag), "error": str(got)}
                for bag, got in found
            ]
        )
    else:
        print_folder(console, root, found)
    return int(any(isinstance(got, BagError) for _, got in found))


def _print_json(content: object) -> None:
    sys.stdout.write(json.dumps(content, indent=2, default=str) + "\n")
