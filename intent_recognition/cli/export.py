# SPDX-License-Identifier: Apache-2.0
"""Write the degrees of freedom of all demonstrations as one table, with a row for each stamp that
training would use, and beside it the map by which `intent import` reads it again:
docs/import.md.

bags BAG...    a bag, a folder of bags, or a session bag; any number
--dofs F       DOF file (default: the shipped config/dofs.yaml)
--output FILE  table to write, .csv or .parquet; a name without ending is a LeRobot data set

# for pandas, polars or R
intent export demos --output demos.csv
# a LeRobot data set of version 3; needs pyarrow
intent export demos --output demos_lerobot
# smaller and typed; needs pyarrow
intent export demos --dofs my_dofs.yaml --output demos.parquet
"""

import argparse

import yaml

from intent_recognition.cli import output
from intent_recognition.cli.console import make_console, say
from intent_recognition.cli.recordings import read_all
from intent_recognition.cli.rejections import print_dropped, print_left_out
from intent_recognition.demonstrations import load_dofs, settle_orientations
from intent_recognition.tables import export_columns, export_map, write_lerobot, write_table

OPTIONS = {"output": {"required": True}}


def run(args: argparse.Namespace) -> int:
    """Read the bags, write the table and its map, and print what was left out."""
    console = make_console()
    output.check_output("--output", args.output)
    dofs = settle_orientations(load_dofs(args.dofs), args.bags)
    demonstrations, rejections = read_all(args.bags, dofs, console)
    columns = export_columns(demonstrations)
    path, lerobot = args.output.with_suffix(".map.yaml"), not args.output.suffix
    content = export_map(dofs, columns, lerobot)
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)
    output.check_new(path, text)
    args.output.parent.mkdir(parents=True, exist_ok=True)
    if lerobot:
        write_lerobot(args.output, columns, dofs)
    else:
        write_table(args.output, columns)
    path.write_text(text, encoding="utf-8")
    print_left_out(console, rejections)
    print_dropped(console, demonstrations)
    rows = next(iter(columns.values())).size
    count = f"{len(demonstrations)} demonstration{'s' * (len(demonstrations) != 1)}"
    say(console, f"{count}, {rows} rows in {args.output}, map {path}")
    return 0
