# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks`: one line per benchmark; exit code 0 whatever comes out.

Every number is from this machine and this run. Times are medians where the remark says nothing
else. Ratios are taken in turn in the same run, and hold better from machine to machine than times
do.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.measure import Result

REAL_DATA = Path("../shared/data")
EVALUATE = f"intent evaluate {REAL_DATA}/SET --dofs {REAL_DATA}/SET/dofs.yaml [--protocol kfold:5]"


def results(minutes: float, soak_minutes: float) -> Iterator[str | Result]:
    """All of them under their headings; the libraries they are beside are loaded only now."""
    from benchmarks.everything import everything

    return everything(minutes, soak_minutes)


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
    parser.add_argument(
        "--minutes",
        type=float,
        default=8.0,
        help="end the longest run then, of a million observations (default: %(default)s)",
    )
    parser.add_argument(
        "--soak",
        type=float,
        default=10.0,
        metavar="MINUTES",
        help="let the simulated cell work so long, nodes being killed (default: %(default)s)",
    )
    args = parser.parse_args(arguments)
    measured, start_s = [], time.monotonic()
    for result in results(args.minutes, args.soak):
        if isinstance(result, Result):
            measured.append(result)
        if args.json != "-":
            _print(result.line().rstrip() if isinstance(result, Result) else f"\n{result}")
    if args.json != "-":
        _print(_summary(measured, time.monotonic() - start_s))
    content = json.dumps([result.to_dict() for result in measured], indent=2) + "\n"
    if args.json == "-":
        sys.stdout.write(content)
    elif args.json:
        Path(args.json).write_text(content, encoding="utf-8")
    return 0


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _summary(measured: list[Result], taken_s: float) -> str:
    held = sum(result.verdict == "ok" for result in measured)
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    lines = [f"\n{held} of {len(measured)} hold; {taken_s:.0f} s, load {load}"]
    lines += [f"  falls short: {one.name}" for one in measured if one.verdict != "ok"]
    if REAL_DATA.is_dir():
        lines.append(f"prediction on real recordings, with its tables: {EVALUATE}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
