# SPDX-License-Identifier: Apache-2.0
"""The report on the papers' experiments: each figure beside the paper's own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from intent_recognition.report.html import (
    Block,
    Column,
    Figure,
    KeyNumber,
    KeyNumbers,
    Page,
    Row,
    Section,
    Table,
    Text,
    write_page,
)

TITLE = "The papers' experiments, regenerated"
SUBTITLE = (
    "Every result of the interaction primitive papers again, from this package and from"
    " demonstrations made by its own physics, beside what the paper reports."
)
VERDICTS = {True: "yes", False: "no", None: "not like for like"}
SUFFIXES = {"image/svg+xml": "svg", "image/png": "png"}


class FindingLike(Protocol):
    """A figure of the paper and ours."""

    quantity: str
    paper: str
    ours: str
    holds: bool | None
    remark: str


class OutcomeLike(Protocol):
    """Numbers and figures of one experiment."""

    title: str
    source: str
    question: str
    findings: Sequence[FindingLike]
    blocks: Sequence[Block]
    conditions: Sequence[str]


def write_experiments_report(
    path: str | Path, outcomes: Mapping[str, OutcomeLike], failures: Mapping[str, str], footer: str
) -> Path:
    """Write the report.

    Args:
        path: of the HTML file.
        outcomes: per experiment, in order.
        failures: per experiment that broke off, why.
        footer: where the numbers came from.

    Raises:
        ResourceBusyError: the file cannot be written.
    """
    sections = [_overview(outcomes, failures)]
    sections += [_section(outcome) for outcome in outcomes.values()]
    return write_page(path, Page(TITLE, SUBTITLE, tuple(sections), footer))


def write_figures(folder: Path, name: str, outcome: OutcomeLike) -> list[Path]:
    """Write an experiment's figures as files of their own, named after it and numbered."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, figure in enumerate(_figures(outcome.blocks), 1):
        path = folder / f"{name}_{number}.{SUFFIXES[figure.media_type]}"
        path.write_bytes(figure.data)
        written.append(path)
    return written


def findings_table(outcome: OutcomeLike) -> Table:
    """The paper's figures and ours."""
    columns = (
        Column("", align="left"),
        Column("paper"),
        Column("ours"),
        Column("met", align="center"),
        Column("remark", align="left"),
    )
    rows = tuple(
        (f.quantity, f.paper or None, f.ours, VERDICTS[f.holds], f.remark or None)
        for f in outcome.findings
    )
    missed = frozenset(k for k, f in enumerate(outcome.findings) if f.holds is False)
    return Table(columns, rows, marked=missed)


def _overview(outcomes: Mapping[str, OutcomeLike], failures: Mapping[str, str]) -> Section:
    findings = [f for outcome in outcomes.values() for f in outcome.findings]
    met = sum(f.holds is True for f in findings)
    missed = sum(f.holds is False for f in findings)
    blocks: list[Block] = [
        KeyNumbers(
            (
                KeyNumber("experiments", str(len(outcomes))),
                KeyNumber("figures met or beaten", f"{met} of {len(findings)}", good=not missed),
                KeyNumber("not like for like", str(len(findings) - met - missed)),
            )
        )
    ]
    columns = (
        Column("experiment", align="left"),
        Column("stands beside", align="left"),
        Column("met"),
        Column("missed"),
        Column("not like for like"),
    )
    rows = []
    for outcome in outcomes.values():
        verdicts = [f.holds for f in outcome.findings]
        counts = (str(verdicts.count(v)) for v in (True, False, None))
        rows.append((outcome.title, outcome.source, *counts))
    blocks.append(Table(columns, tuple(rows)))
    blocks += [Text(f"{name} broke off: {reason}") for name, reason in failures.items()]
    return Section("Overview", tuple(blocks))


def _section(outcome: OutcomeLike) -> Section:
    blocks: list[Block] = [
        Text(outcome.question),
        Text(f"Stands beside: {outcome.source}.", small=True),
        findings_table(outcome),
        *outcome.blocks,
    ]
    if outcome.conditions:
        blocks.append(Text("Conditions that differ. " + " ".join(outcome.conditions), small=True))
    return Section(outcome.title, tuple(blocks))


def _figures(blocks: Sequence[Block]) -> list[Figure]:
    found: list[Figure] = []
    for block in blocks:
        if isinstance(block, Figure):
            found.append(block)
        elif isinstance(block, Row):
            found += block.figures
    return found
