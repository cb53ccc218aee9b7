# SPDX-License-Identifier: Apache-2.0
"""Run the experiments of the papers on simulated recordings, print the results beside the paper's,
and write one report that opens without network.

names NAME    experiment to run (default: all; --list shows them)
--output DIR  folder of report.html, numbers.json and figures/ (default: %(default)s)
--seed SEED   seed of all random variation (default: 1)
--seeds N     draws of the recordings of pointing, pole and toolbox; the first are the shipped ones,
              each other takes minutes (default: %(default)s)
--quick       run a fast subset of each experiment
--bags DIR    folder of recordings (default: the shipped ones)
--jobs JOBS   number of processes (default: %(default)s)
--list        show the names and stop
--json OUT    the numbers

# what there is
intent experiments --list
# a first look at all of them
intent experiments --quick
# one of them, its numbers for a script
intent experiments alignment --json numbers.json
"""

import argparse
import sys
import time
from pathlib import Path

from intent_recognition.cli.completion import offer
from intent_recognition.cli.console import busy, say
from intent_recognition.cli.options import number
from intent_recognition.cli.output import check_output, console_beside, table_console, write_json
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.share import source_tree


def are_here() -> bool:
    """Whether the experiments can be imported: a source tree has them, an installation has not."""
    root = source_tree()
    if root is None or not (root / "experiments" / "catalogue.py").is_file():
        return False
    if str(root) not in sys.path:
        sys.path.append(str(root))
    return True


def offer_names(parser: argparse.ArgumentParser) -> None:
    """Complete the names of experiments."""
    if are_here():
        from experiments.catalogue import EXPERIMENTS

        offer(parser, "names", tuple(entry.name for entry in EXPERIMENTS))


OPTIONS = {
    "names": {"nargs": "*"},
    "output": {"default": Path("out/experiments")},
    "seed": {"type": number(int, 0), "default": 1},
    "seeds": {"type": number(int, 1), "default": 3},
    "jobs": {"type": number(int, 1), "default": 2},
}
MORE = (offer_names,)


def run(args: argparse.Namespace) -> int:
    """Run the experiments; 1 if one failed."""
    if not are_here():
        what = "the source tree, in which the experiments lie beside the package"
        cure = "Clone the repository, install it with `pip install -e .[all]`, and run this there."
        raise IntentError.about("intent experiments", what, "an installed package", cure)
    from experiments import output
    from experiments.catalogue import EXPERIMENTS, chosen
    from experiments.report import write_report
    from experiments.runs import run_all
    from experiments.settings import Settings

    console = console_beside(args)
    if args.list:
        output.print_list(table_console(args), EXPERIMENTS)
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
    for name, outcome in outcomes.items():
        output.print_outcome(table_console(args), name, outcome, runs[name].seconds)
    numbers = output.numbers_json(runs, args.seed, args.quick)
    with busy(console, "writing the report"):
        report = write_report(args.output, outcomes, failures, numbers)
        for path in (args.output / "numbers.json", args.json):
            write_json(path, numbers)
    for name, reason in failures.items():
        sys.stderr.write(f"intent experiments: {name} broke off: {reason}\n")
    taken_s = time.monotonic() - started
    say(console, f"{len(outcomes)} experiments in {taken_s:.0f} s, report: {report}")
    say(console, output.summary_line(outcomes.values()))
    return 1 if failures else 0
