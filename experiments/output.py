# SPDX-License-Identifier: Apache-2.0
"""Results of experiments in the terminal and as JSON."""

from collections.abc import Iterable, Mapping

from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.catalogue import Experiment
from experiments.results import ExperimentResult
from experiments.runs import ExperimentRun
from intent_recognition import __version__

MARKS = {True: Text("yes", "green"), False: Text("no", "red"), None: Text("other conditions")}


def summary_line(outcomes: Iterable[ExperimentResult]) -> str:
    """How many of the papers' figures are met."""
    findings = [finding.holds for outcome in outcomes for finding in outcome.findings]
    met, missed, unlike = map(findings.count, (True, False, None))
    return (
        f"summary: {met} of {met + missed} figures met or beaten,"
        f" {missed} missed, {unlike} not like for like"
    )


def numbers_json(runs: Mapping[str, ExperimentRun], seed: int, quick: bool) -> dict:
    """All numbers and findings, ready for JSON."""
    content: dict = {"version": __version__, "seed": seed, "quick": quick, "experiments": {}}
    for name, run in runs.items():
        if run.outcome is None:
            content["experiments"][name] = {"failure": run.failure}
            continue
        findings = [vars(finding) for finding in run.outcome.findings]
        content["experiments"][name] = {"findings": findings, "numbers": dict(run.outcome.numbers)}
    return content


def print_list(console: Console, entries: Iterable[Experiment]) -> None:
    """Print name, source and summary of each."""
    table = Table(box=None, header_style="bold")
    for title in ("name", "compared with", "what"):
        table.add_column(title)
    for entry in entries:
        table.add_row(entry.name, entry.source, entry.summary)
    console.print(table)


def print_outcome(console: Console, name: str, outcome: ExperimentResult, seconds: float) -> None:
    """Print the findings of one experiment."""
    head = console.render_str(f"\n{outcome.title}", style="bold")
    console.print(head, f"({name}; {outcome.source}; {seconds:.0f} s)", highlight=True)
    table = Table(box=None, header_style="dim", pad_edge=False)
    for title in ("", "paper or wanted", "ours", "met", ""):
        table.add_column(title, overflow="fold")
    table.columns[-1].style = "dim"
    for f in outcome.findings:
        table.add_row(f.quantity, f.paper or "-", f.ours, MARKS[f.holds], f.remark)
    console.print(table)
