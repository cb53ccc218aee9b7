# SPDX-License-Identifier: Apache-2.0
"""`intent inspect`: what is in a bag, a folder of bags or a model."""

import argparse
from pathlib import Path

from rich.console import Console
from rich.progress import track

from intent_recognition.cli.console import busy, make_console
from intent_recognition.cli.help import examples
from intent_recognition.cli.inspect_bag import bag_json, print_bag, print_folder
from intent_recognition.cli.inspect_model import model_json, print_model
from intent_recognition.cli.inspect_streams import print_faults, stream_faults
from intent_recognition.cli.options import Subparsers
from intent_recognition.cli.output import print_json
from intent_recognition.demonstrations import (
    BagSummary,
    DofSpec,
    find_bags,
    inspect_bag,
    load_dofs,
)
from intent_recognition.errors import BagError, describe
from intent_recognition.model import load_model

CURE = "Give a bag, a folder of bags, or a model that `intent train` wrote."


def add_parser(subparsers: Subparsers) -> None:
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
    parser.add_argument(
        "--dofs",
        type=Path,
        metavar="F",
        help="DOF file: check the streams it names (default: all tracked bodies and joint_states)",
    )
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
            print_json(model_json(model))
        else:
            print_model(console, args.path, model)
        return 0
    dofs = None if args.dofs is None else load_dofs(args.dofs)
    bags = find_bags(args.path)
    if not bags:
        raise BagError(describe(str(args.path), "recordings", "none in this folder", CURE))
    if bags == [args.path]:
        with busy(Console(stderr=True), "reading"):
            summary = inspect_bag(args.path)
            faults = stream_faults([(args.path, summary)], args.path.parent, dofs)
        if args.json:
            print_json(bag_json(summary) | {"streams": [f.reason for f in faults[args.path]]})
        else:
            print_bag(console, summary)
            print_faults(console, faults)
        return 0
    return _inspect_folder(console, args.path, bags, dofs, args.json)


def _inspect_folder(
    console: Console, root: Path, bags: list[Path], dofs: DofSpec | None, as_json: bool
) -> int:
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
    faults = stream_faults(found, root, dofs)
    if as_json:
        print_json(
            [
                bag_json(got) | {"streams": [f.reason for f in faults[bag]]}
                if isinstance(got, BagSummary)
                else {"path": str(bag), "error": str(got)}
                for bag, got in found
            ]
        )
    else:
        print_folder(console, root, found)
        print_faults(console, faults)
    return int(any(isinstance(got, BagError) for _, got in found))
