# SPDX-License-Identifier: Apache-2.0
"""`intent experiments`: the papers' tables and figures, each beside the paper's own."""

import argparse
import sys
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from intent_recognition import __version__
from intent_recognition.cli.completion import offer
from intent_recognition.cli.console import busy, escape, say
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, a_path, number
from intent_recognition.cli.output import (
    PRINTED,
    add_json_option,
    check_output,
    console_beside,
    write_json,
)
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.share import source_tree

if TYPE_CHECKING:
    from experiments.catalogue import Experiment
    from experiments.results import ExperimentResult
    from experiments.runs import ExperimentRun

MARKS = {True: "[green]yes[/]", False: "[red]no[/]", None: "other conditions"}


def are_here() -> bool:
    """Whether the experiments can be imported: a source tree has them, an installation has not."""
    root = source_tree()
    if root is None or not (root / "experiments" / "catalogue.py").is_file():
        return False
    if str(root) not in sys.path:
        sys.path.append(str(root))
    return True


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "experiments",
        description="Run the experiments of the papers on recordings of the simulation, print what"
        " came out beside the paper's figure, and write one report that opens without network.",
        **examples(
            ("what there is", "intent experiments --list"),
            ("a first look at all of them", "intent experiments --quick"),
            (
                "one of them, its numbers for a script",
                "intent experiments alignment --json numbers.json",
            ),
        ),
    )
    names = parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="experiment to run (default: all; --list shows them)",
    )
    if are_here():
        from experiments.catalogue import EXPERIMENTS

        offer(names, tuple(entry.name for entry in EXPERIMENTS))
    parser.add_argument(
        "--output",
        type=a_path,
        default=Path("out/experiments"),
        metavar="DIR",
        help="folder of report.html, numbers.json and figures/ (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=number(int, 0), default=1, help="seed of all random variation (default: 1)"
    )
    parser.add_argument(
        "--seeds",
        type=number(int, 1),
        default=3,
        metavar="N",
        help="draws of the recordings of pointing, pole and toolbox, to show their spread: the"
        " shipped ones and N - 1 made anew, minutes each (default: %(default)s; docs/experiments.md"
        " shows ten)",
    )
    parser.add_argument("--quick", action="store_true", help="run a fast subset of each experiment")
    parser.add_argument(
        "--bags",
        type=a_path,
        metavar="DIR",
        help="folder of recordings (default: the shipped ones)",
    )
    parser.add_argument(
        "--jobs", type=number(int, 1), default=2, help="number of processes (default: %(default)s)"
    )
    parser.add_argument("--list", action="store_true", help="show the names and stop")
    add_json_option(parser, "the numbers")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run them; 1 if one broke off.

    Raises:
        ArgumentError: a name is unknown, or the recordings are no folder.
        IntentError: the experiments are not here.
        ResourceBusyError: the report cannot be written.
    """
    if not are_here():
        what = "the source tree, in which the experiments lie beside the package"
        cure = "Clone the repository, install it with `pip install -e .[all]`, and run this there."
        raise IntentError.about("intent experiments", what, "an installed package", cure)
    from experiments.catalogue import EXPERIMENTS, chosen
    from experiments.runs import run_all
    from experiments.settings import Settings

    console = console_beside(args.json)
    if args.list:
        if args.json != PRINTED:
            _print_list(console, EXPERIMENTS)
        listed = [{"name": e.name, "source": e.source, "summary": e.summary} for e in EXPERIMENTS]
        write_json(args.json, listed)
        return 0
    check_output("--output", args.output / "report.html")
    if args.bags is not None and not args.bags.is_dir():
        cure = "Check the path, or leave it out for the shipped ones."
        raise ArgumentError.about("--bags", "a folder of recordings", args.bags, cure)
    entries = chosen(args.names)
    started = time.monotonic()
    settings = Settings(args.seed, args.seeds, args.quick, args.bags)
    runs = run_all(entries, settings, args.jobs, console)
    failures = {name: run.failure for name, run in runs.items() if run.failure}
    outcomes = {name: run.outcome for name, run in runs.items() if run.outcome}
    for name, outcome in outcomes.items() if args.json != PRINTED else ():
        _print_outcome(console, name, outcome, runs[name].seconds)
    numbers = numbers_json(runs, args.seed, args.quick)
    with busy(console, "writing the report"):
        report = _write(args.output, outcomes, failures, numbers, args.json)
    for name, reason in failures.items():
        sys.stderr.write(f"intent experiments: {name} broke off: {reason}\n")
    taken_s = time.monotonic() - started
    say(console, f"{len(outcomes)} experiments in {taken_s:.0f} s, report: {report}")
    console.file.write(summary_line(outcomes.values()) + "\n")
    return 1 if failures else 0


def summary_line(outcomes: Iterable["ExperimentResult"]) -> str:
    """How many of the papers' figures are met."""
    findings = [finding.holds for outcome in outcomes for finding in outcome.findings]
    return (
        f"summary: {findings.count(True)} of {len(findings)} figures met or beaten,"
        f" {findings.count(False)} missed, {findings.count(None)} not like for like"
    )


def numbers_json(runs: Mapping[str, "ExperimentRun"], seed: int, quick: bool) -> dict:
    """All numbers and findings, ready for JSON."""
    content: dict = {"version": __version__, "seed": seed, "quick": quick, "experiments": {}}
    for name, run in runs.items():
        if run.outcome is None:
            content["experiments"][name] = {"failure": run.failure}
            continue
        findings = [vars(finding) for finding in run.outcome.findings]
        content["experiments"][name] = {"findings": findings, "numbers": dict(run.outcome.numbers)}
    return content


def _write(
    folder: Path,
    outcomes: Mapping[str, "ExperimentResult"],
    failures: Mapping[str, str],
    numbers: dict,
    extra: Path | None,
) -> Path:
    from experiments.report import write_experiments_report, write_figures

    folder.mkdir(parents=True, exist_ok=True)
    for name, outcome in outcomes.items():
        write_figures(folder / "figures", name, outcome)
    for path in (folder / "numbers.json", extra):
        write_json(path, numbers)
    mode = ", quick" if numbers["quick"] else ""
    footer = f"intent_recognition {__version__}, seed {numbers['seed']}{mode}."
    return write_experiments_report(folder / "report.html", outcomes, failures, footer)


def _print_list(console: Console, entries: Iterable["Experiment"]) -> None:
    table = Table(box=None, header_style="bold")
    for title in ("name", "stands beside", "what"):
        table.add_column(title)
    for entry in entries:
        table.add_row(entry.name, entry.source, entry.summary)
    console.print(table)


def _print_outcome(
    console: Console, name: str, outcome: "ExperimentResult", seconds: float
) -> None:
    title = f"\n[bold]{outcome.title}[/] ({name}; {outcome.source}; {seconds:.0f} s)"
    console.print(title, highlight=True)
    table = Table(box=None, header_style="dim", pad_edge=False)
    for title in ("", "paper", "ours", "met", ""):
        table.add_column(title, overflow="fold")
    for f in outcome.findings:
        cells = (escape(f.quantity), f.paper or "-", f.ours, MARKS[f.holds])
        table.add_row(*cells, f"[dim]{escape(f.remark)}[/]")
    console.print(table)
