# SPDX-License-Identifier: Apache-2.0
"""The report on the papers' experiments: each figure beside the paper's own."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from experiments.results import ExperimentResult
from intent_recognition.report import (
    Block,
    Column,
    Figure,
    KeyNumber,
    KeyNumbers,
    Paragraph,
    ReportPage,
    Row,
    Section,
    TableBlock,
    write_page,
)

TITLE = "The papers' experiments, regenerated"
SUBTITLE = (
    "Every result of the interaction primitive papers again, from this package and from"
    " demonstrations made by its own physics, beside what the paper reports."
)
VERDICTS = {True: "yes", False: "no", None: "not like for like"}


def write_report(
    folder: Path,
    results: Mapping[str, ExperimentResult],
    failures: Mapping[str, str],
    numbers: Mapping,
) -> Path:
    """Write report.html into a folder, and each figure as a file of its own below figures/.

    `failures` has the reason of each experiment that broke off, `numbers` is of `numbers_json`.
    """
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for name, result in results.items():
        for number, figure in enumerate(_figures(result.blocks), 1):
            path = folder / "figures" / f"{name}_{number}.{figure.suffix}"
            path.write_bytes(figure.data)
    sections = [_overview(results, failures)]
    sections += [_section(result) for result in results.values()]
    mode = ", quick" if numbers["quick"] else ""
    footer = f"intent_recognition {numbers['version']}, seed {numbers['seed']}{mode}."
    page = ReportPage(TITLE, SUBTITLE, tuple(sections), footer)
    return write_page(folder / "report.html", page)


def _findings_table(result: ExperimentResult) -> TableBlock:
    columns = (
        Column("", align="left"),
        Column("paper or wanted"),
        Column("ours"),
        Column("met", align="center"),
        Column("remark", align="left"),
    )
    rows = (
        (f.quantity, f.paper or None, f.ours, VERDICTS[f.holds], f.remark or None)
        for f in result.findings
    )
    missed = [k for k, f in enumerate(result.findings) if f.holds is False]
    return TableBlock(columns, rows, marked=missed)


def _overview(results: Mapping[str, ExperimentResult], failures: Mapping[str, str]) -> Section:
    findings = [f for result in results.values() for f in result.findings]
    met = sum(f.holds is True for f in findings)
    missed = sum(f.holds is False for f in findings)
    good = not missed if met + missed else None
    blocks: list[Block] = [
        KeyNumbers(
            (
                KeyNumber("experiments", str(len(results))),
                KeyNumber("figures met or beaten", f"{met} of {met + missed}", good=good),
                KeyNumber("not like for like", str(len(findings) - met - missed)),
            )
        )
    ]
    columns = (
        Column("experiment", align="left"),
        Column("compared with", align="left"),
        Column("met"),
        Column("missed"),
        Column("not like for like"),
    )
    rows = []
    for result in results.values():
        verdicts = [f.holds for f in result.findings]
        rows.append((result.title, result.source, *map(verdicts.count, (True, False, None))))
    blocks.append(TableBlock(columns, rows))
    blocks += [Paragraph(f"{name} broke off: {reason}") for name, reason in failures.items()]
    return Section("Overview", tuple(blocks))


def _section(result: ExperimentResult) -> Section:
    blocks: list[Block] = [
        Paragraph(result.question),
        Paragraph(f"Compared with: {result.source}.", small=True),
        _findings_table(result),
        *result.blocks,
    ]
    if result.conditions:
        blocks.append(
            Paragraph("Conditions that differ. " + " ".join(result.conditions), small=True)
        )
    return Section(result.title, tuple(blocks))


def _figures(blocks: Sequence[Block]) -> list[Figure]:
    found: list[Figure] = []
    for block in blocks:
        if isinstance(block, Figure):
            found.append(block)
        elif isinstance(block, Row):
            found += block.figures
    return found
