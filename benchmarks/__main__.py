# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks`: one line per benchmark; exit code 0 whatever comes out.

Every number is from this machine and this run, on the shipped bags. Ratios are taken in turn in
the same run, and hold better from machine to machine than times do.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.bank import bank
from benchmarks.measure import Result
from benchmarks.node import node
from benchmarks.offline import evaluation, training
from benchmarks.online import online
from benchmarks.reading import reading
from benchmarks.recognition import unknown_tasks
from intent_recognition.share import share_path
from intent_recognition.storage import load_dofs, read_demonstrations

HELD_OUT = "bags/toolbox/test/plate_handover_00"


def results() -> Iterator[Result]:
    """All of them, as they are measured."""
    bags = share_path("bags/toolbox/train")
    trained, library, demonstrations = training(bags)
    yield from trained
    (recorded,), _ = read_demonstrations(share_path(HELD_OUT), load_dofs())
    yield from online(library, recorded)
    yield from node(library, [recorded])
    yield from bank()
    yield from reading()
    yield evaluation(demonstrations)
    yield from unknown_tasks(demonstrations)


def main(arguments: list[str] | None = None) -> int:
    """Print lines, or JSON with `--json`; `--json OUT` does both."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--json",
        nargs="?",
        const="-",
        metavar="OUT",
        help="print JSON instead of lines; with OUT print lines and write JSON to OUT",
    )
    args = parser.parse_args(arguments)
    measured = []
    for result in results():
        measured.append(result.to_dict())
        if args.json != "-":
            sys.stdout.write(result.line().rstrip() + "\n")
            sys.stdout.flush()
    content = json.dumps(measured, indent=2) + "\n"
    if args.json == "-":
        sys.stdout.write(content)
    elif args.json:
        Path(args.json).write_text(content, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
