# SPDX-License-Identifier: Apache-2.0
"""`intent import`: demonstrations from CSV, NPZ, Parquet, LeRobot data sets and C3D."""

import argparse
from pathlib import Path

import yaml
from rich.table import Table

from intent_recognition.cli.console import busy, escape, make_console, plain_table, say
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, a_path
from intent_recognition.cli.recordings import DOFS
from intent_recognition.cli.rejections import nothing_of, print_left_out
from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import ResourceBusyError
from intent_recognition.signals import Rejection
from intent_recognition.tables import (
    ImportedDemonstration,
    import_demonstrations,
    load_map,
    write_demonstration,
)


def add_parser(subparsers: Subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "import",
        help="make bags from CSV, NPZ, Parquet, C3D or LeRobot data sets",
        description="Write each demonstration of a file, a folder of files or a LeRobot data set"
        " as a bag, and a DOF file beside them. The map says which columns are which degrees of"
        " freedom, where times come from, and where a demonstration begins and ends:"
        " docs/import.md.",
        **examples(
            (
                "two files for each recording, as the map says",
                "intent import handover_csv --map config/maps/baton.yaml --output out/baton",
            ),
            (
                "then score them",
                "intent evaluate out/baton --dofs out/baton/dofs.yaml --protocol kfold:5",
            ),
        ),
    )
    parser.add_argument(
        "source", type=a_path, metavar="SOURCE", help="a file, a folder of files, or a data set"
    )
    parser.add_argument(
        "--map", type=a_path, required=True, metavar="MAP.yaml", help="map of the columns"
    )
    parser.add_argument(
        "--output", type=a_path, required=True, metavar="BAGS", help="folder of the new bags"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Import, write the bags and the DOF file, print what was found and what was left out.

    Raises:
        DofError: the map is wrong.
        BagError: nothing at all could be imported.
        ResourceBusyError: a bag of that name exists already.
    """
    console = make_console()
    mapping = load_map(args.map)
    left_out: list[Rejection] = []
    table = plain_table("bag", "task", ">samples", ">dropped")
    count = n_unlabelled = 0
    with busy(console, "importing"):
        for found in import_demonstrations(args.source, mapping):
            if isinstance(found, Rejection):
                left_out.append(found)
                continue
            write_demonstration(args.output, found)
            count += 1
            n_unlabelled += "task" not in found.custom_data
            _add_row(table, found)
    if not count:
        raise nothing_of(str(args.source), "demonstrations", left_out, "Correct the map.")
    _write_dofs(args.output / DOFS, mapping.dofs)
    console.print(table)
    print_left_out(console, left_out)
    dofs = args.output / DOFS
    say(console, f"{count} demonstrations in {args.output}; learn from them with --dofs {dofs}")
    if n_unlabelled:
        cure = "name it under task or files in the map, or learn with --unlabelled"
        say(console, f"{n_unlabelled} without a task: {cure}", "yellow")
    return 0


def _add_row(table: Table, found: ImportedDemonstration) -> None:
    samples = " + ".join(str(part.stamps_ns.size) for part in found.samples)
    row = (escape(found.name), escape(found.custom_data.get("task", "-")), samples)
    table.add_row(*row, str(found.n_dropped))


def _write_dofs(path: Path, dofs: DofSpec) -> None:
    text = yaml.safe_dump(dofs.to_dict(), sort_keys=False, allow_unicode=True, width=100)
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        cure = "Import into another folder."
        raise ResourceBusyError.about(str(path), "the same DOF file", "another one", cure)
    path.write_text(text, encoding="utf-8")
