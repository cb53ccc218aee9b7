# SPDX-License-Identifier: Apache-2.0
"""The demo's report: key numbers beside the paper's, figures of what was measured, the table."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from intent_recognition.evaluation import (
    CM_PER_M,
    CONDITIONS,
    FIXED_PLACE,
    PAPER_HAND_ERROR,
    PAPER_RECOGNISED,
    DemoSummary,
    HandError,
    InteractionRecord,
    Trace,
    reliability_bins,
    summary_line,
    usable,
)
from intent_recognition.promp import NONE
from intent_recognition.report import figures_session
from intent_recognition.report.drawing import readable, to_svg
from intent_recognition.report.figures_calibration import confusion_shares_figure
from intent_recognition.report.figures_evaluation import reliability_figure
from intent_recognition.report.figures_interaction import (
    joint_figure,
    posterior_over_time_figure,
    transfer_figure,
    wrist_figure,
)
from intent_recognition.report.html import (
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
from intent_recognition.report.interaction_table import cells, fields_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

LARGEST_FORCE_N = 15.0
"""That a person may have to bear in a transfer [N] (docs/transfer.md)."""
TITLE = "Toolbox assembly with a simulated coworker"
PLUS_MINUS = "\N{PLUS-MINUS SIGN}"
COLOURS = "Green: an aim is met, such as the paper's hand error; red: missed; blue: no aim."


def write_demo_report(
    path: str | Path,
    records: Sequence[InteractionRecord],
    summary: DemoSummary,
    traces: Sequence[Trace] = (),
    settings: Mapping[str, object] | None = None,
) -> Path:
    """Write the demo's report as one HTML file.

    Args:
        path: of the file; its folder is made if it is missing.
        records: all interactions, in order.
        summary: of these records.
        traces: arrays of as many interactions as there are (keys: `traces.Trace`); figures
            without data are left out.
        settings: name and value of what the session was run with, shown at the end.

    Raises:
        ResourceBusyError: the file cannot be written.
        ShapeError: arrays of a trace that belong together have different lengths.
    """
    return write_page(path, demo_page(records, summary, traces, settings or {}))


def demo_page(
    records: Sequence[InteractionRecord],
    summary: DemoSummary,
    traces: Sequence[Trace],
    settings: Mapping[str, object],
) -> ReportPage:
    """The report's content; arguments as of `write_demo_report`."""
    by_index = {trace["index"]: usable(trace) for trace in traces}
    labels = [label for trace in by_index.values() for label in trace.get("labels", ())]
    unchanged = [record for record in records if not record.changed_from]
    remarks = (Paragraph(COLOURS, small=True), Paragraph(CONDITIONS, small=True))
    sections = [
        Section("Result", (_key_numbers(summary), *remarks)),
        *([Section("People", (_people(summary),))] if summary.people else []),
        Section("Accuracy and timing", _figures_of_records(unchanged, summary, labels)),
        Section("Recognition", _figures_of_posteriors(unchanged, by_index)),
        *_details(records, by_index),
        Section("All interactions", (_table(records, summary),)),
        Section("Settings", _settings(settings)),
    ]
    count = f"{len(records)} interaction{'' if len(records) == 1 else 's'},"
    subtitle = (
        f"{count} recognised from the motion of the wrist alone; everything is"
        " measured on the ROS 2 topics, and the true task is used for scoring only."
    )
    return ReportPage(TITLE, subtitle, tuple(sections), summary_line(summary))


def _key_numbers(summary: DemoSummary) -> KeyNumbers:
    share, arrival = summary.median_decision_share, summary.median_arrival_s
    numbers = [
        KeyNumber(
            "tasks recognised",
            f"{summary.recognised_right}/{summary.n}",
            "{}/{}".format(*PAPER_RECOGNISED),
            not summary.too_many_missed,
        ),
        KeyNumber(
            "decided before the human's end",
            f"{summary.decided_before_end}/{summary.n}",
            good=summary.decided_before_end == summary.n,
        ),
        KeyNumber(
            "median decision",
            _absent(share, lambda x: f"{100 * x:.0f} %"),
            good=None if share is None else share <= 0.5,
            note="of the human's movement had passed",
        ),
        KeyNumber("hand error", hand_error_text(summary.hand_error), note=_who(summary)),
    ]
    for task, error in summary.hand_error_by_task.items():
        paper = PAPER_HAND_ERROR.get(task)
        apart = task in summary.tasks_apart
        numbers.append(
            KeyNumber(
                f"hand error, {readable(task)}",
                hand_error_text(error),
                hand_error_text(paper) if paper else "",
                _meets(error, paper),
                f"n = {error.n}; {FIXED_PLACE}" if apart else f"n = {error.n}",
            )
        )
    numbers.append(
        KeyNumber(
            "robot's arrival after the human's end",
            _absent(arrival, lambda x: f"{x:+.2f} s"),
            note=_absent(summary.latest_arrival_s, lambda x: f"median; latest {x:+.2f} s"),
        )
    )
    if summary.n_transfers:
        all_of_them = summary.handed_over == summary.n_transfers
        numbers += [
            KeyNumber(
                "objects handed over by force",
                f"{summary.handed_over}/{summary.n_transfers}",
                good=all_of_them,
            ),
            KeyNumber(
                "largest force of the person",
                _absent(summary.largest_force_n, lambda x: f"{x:.1f} N"),
                good=(summary.largest_force_n or 0.0) <= LARGEST_FORCE_N,
                note=f"at most {LARGEST_FORCE_N:g} N is required",
            ),
        ]
    if summary.n_changed:
        numbers.append(
            KeyNumber(
                "changes of mind followed",
                f"{summary.changes_followed}/{summary.n_changed}",
                note=f"hand error {hand_error_text(summary.changed_hand_error)}",
            )
        )
    return KeyNumbers(tuple(numbers))


def _people(summary: DemoSummary) -> TableBlock:
    counts = ("recognised", "helped", "handed over", "wrong helps")
    columns = (
        Column("person", align="left"),
        *map(Column, counts),
        Column("arrival", "s"),
        Column("largest force", "N"),
    )
    rows = tuple(
        (
            one.person,
            *(f"{n}/{one.n}" for n in (one.recognised, one.helped, one.handed_over)),
            str(one.wrong_helps),
            _absent(one.median_arrival_s, lambda x: f"{x:+.2f}"),
            _absent(one.largest_force_n, lambda x: f"{x:.1f}"),
        )
        for one in summary.people
    )
    caption = (
        "recognised: the most probable task at the end of the movement. helped: the arm did that"
        " task for this person. wrong helps: begun while the person neither moved nor waited."
        " arrival: median, after the end of the movement; the arm helps one at a time."
    )
    return TableBlock(columns, rows, caption)


def _figures_of_records(
    records: Sequence[InteractionRecord], summary: DemoSummary, labels: Sequence[str]
) -> tuple[Block, ...]:
    errors_m, shares, arrivals = (
        _per_task(records, name) for name in ("hand_error_m", "decision_share", "arrival_s")
    )
    drawn = []
    if errors_m:
        errors_cm = {task: [CM_PER_M * e for e in errors] for task, errors in errors_m.items()}
        paper = {
            t: (e.mean_cm, e.two_std_cm)
            for t, e in PAPER_HAND_ERROR.items()
            if e.mean_cm is not None and e.two_std_cm is not None
        }
        figure = figures_session.hand_error_figure(
            errors_cm, paper, dict.fromkeys(summary.tasks_apart, "(place is fixed)"), labels
        )
        drawn.append(
            _figure(figure, "Measured hand to the place the demonstrator's rule gives, in cm.")
        )
    if shares:
        figure = figures_session.decision_share_figure(shares, labels=labels)
        drawn.append(_figure(figure, "How early: 100 % is the end of the human's movement."))
    if arrivals:
        figure = figures_session.arrival_figure(arrivals, labels)
        drawn.append(_figure(figure, "Zero is the end of the human's movement."))
    decided = [r for r in records if r.decision_time_s is not None]
    decisions = _per_task(decided, "decision_time_s")
    if decisions:
        movements = _per_task(decided, "movement_s")
        figure = figures_session.timing_figure(movements, decisions, labels)
        caption = "When each was decided: below the solid line, before the human's end."
        drawn.append(_figure(figure, caption))
    return (Row(tuple(drawn)),) if drawn else ()


def _figures_of_posteriors(
    records: Sequence[InteractionRecord], by_index: Mapping[int, Trace]
) -> tuple[Block, ...]:
    if not records:
        return ()
    rows, columns, counts = figures_session.confusion_counts(
        [r.task for r in records], [r.recognised for r in records]
    )
    figure = confusion_shares_figure(counts, rows, columns)
    confusion = _figure(figure, "What each task was recognised as.")
    both = [(r, by_index[r.index]) for r in records if _has_posterior(by_index.get(r.index))]
    if not both:
        return (Row((confusion,)),)
    labels = list(both[0][1]["labels"])
    both = [(r, t) for r, t in both if list(t["labels"]) == labels]
    probabilities = [np.asarray(t["probabilities"], dtype=float) for _, t in both]
    figure = figures_session.posterior_figure(
        [r.task for r, _ in both],
        labels,
        [np.asarray(t["share"], dtype=float) for _, t in both],
        probabilities,
        [r.decision_share for r, _ in both],
    )
    noticed = [p[p[:, -1] < 1.0] for p in probabilities]  # before the onset was, none is certain
    truth = [
        np.tile([label == r.task for label in labels], (len(p), 1))
        for (r, _), p in zip(both, noticed, strict=True)
    ]
    bins = reliability_bins(
        np.concatenate([p.ravel() for p in noticed]), np.concatenate([t.ravel() for t in truth])
    )
    return (
        _figure(
            figure,
            "Probability of each task while the human moves: thin lines are interactions, bold"
            " lines their median, ticks at the top the decisions.",
        ),
        Row(
            (
                confusion,
                _figure(
                    reliability_figure(*bins),
                    "Are the probabilities to be believed? Every posterior since the onset was"
                    " noticed, pooled; those of one interaction are not independent.",
                ),
            )
        ),
    )


def _details(records: Sequence[InteractionRecord], by_index: Mapping[int, Trace]) -> list[Section]:
    """A typical interaction of each task, and what was missed."""
    chosen = {}
    for task in sorted({r.task for r in records}):
        measured = [
            r
            for r in records
            if r.task == task and r.hand_error_m is not None and r.index in by_index
        ]
        if measured:
            typical = sorted(measured, key=lambda r: r.hand_error_m or 0.0)[
                (len(measured) - 1) // 2
            ]
            name = readable(task)
            heading = f"Typical: {name}" if len(measured) > 1 else name.capitalize()
            chosen[typical.index] = (heading, typical)
    missed = [r for r in records if (not r.right or r.handed_over is False) and r.index in by_index]
    for record in missed[:3]:
        chosen[record.index] = (f"Missed: {readable(record.task)}", record)
    sections = [
        Section(f"{name} (interaction {record.index})", _detail(record, by_index[record.index]))
        for name, record in chosen.values()
    ]
    return [section for section in sections if len(section.blocks) > 1]


def _detail(record: InteractionRecord, trace: Trace) -> tuple[Block, ...]:
    small = []
    if "wrist_m" in trace:
        small.append(
            _figure(wrist_figure(trace), "The wrist, observed and predicted at the decision.")
        )
    if _has_posterior(trace):
        figure = posterior_over_time_figure(trace, record.movement_s)
        small.append(
            _figure(figure, "Task posterior; solid vertical line: decision; dotted: human's end.")
        )
    blocks: list[Block] = [Paragraph(_sentence(record))]
    if small:
        blocks.append(Row(tuple(small)))
    if "predicted_rad" in trace or "joint_rad" in trace:
        blocks.append(
            _figure(
                joint_figure(trace), "The robot's joints: predicted at the decision, and measured."
            )
        )
    if "transfer_s" in trace:
        caption = (
            "The object changes hands: the person's force on it in truth, the load that the robot"
            " feels, and the force of its fingers; below: the person's share of the load, as felt."
        )
        blocks.append(_figure(transfer_figure(trace), caption))
    return tuple(blocks)


def _sentence(record: InteractionRecord) -> str:
    found = record.recognised not in ("", NONE)
    parts = [f"recognised as {readable(record.recognised)}" if found else "not recognised"]
    if record.observations is not None:
        parts.append(f"after {record.observations} observations")
    if record.decision_share is not None:
        parts.append(f"at {100 * record.decision_share:.0f} % of the movement")
    if record.hand_error_m is not None:
        parts.append(f"hand error {CM_PER_M * record.hand_error_m:.1f} cm")
    if record.transfer_s is not None and record.largest_force_n is not None:
        when = f"{record.transfer_s:+.2f} s after the human's end"
        parts.append(f"handed over {when} with at most {record.largest_force_n:.1f} N")
    if record.arrival_s is not None:
        parts.append(f"arrival {record.arrival_s:+.2f} s after the human's end")
    text = ", ".join(parts)
    return f"{text[0].upper()}{text[1:]}. {record.note}".strip()


def _table(records: Sequence[InteractionRecord], summary: DemoSummary) -> TableBlock:
    fields = fields_of(records)
    columns = [Column(field.title, field.unit, field.align) for field in fields]
    missed = [row for row, record in enumerate(records) if not record.right]
    of_changed = summary.n_changed - summary.changes_followed
    caption = (
        "decided: after onset. share: of the human's movement at the decision. arrival: after the"
        f" human's end. {summary.missed + of_changed} missed."
    )
    return TableBlock(columns, (cells(one, fields) for one in records), caption, missed)


def _settings(settings: Mapping[str, object]) -> tuple[Block, ...]:
    if not settings:
        return ()
    rows = tuple((str(name), str(value)) for name, value in settings.items())
    return (TableBlock((Column("setting", align="left"), Column("value", align="left")), rows),)


def _per_task(records: Sequence[InteractionRecord], name: str) -> dict[str, list[float]]:
    """Values per task in order of the labels; every task that has a record is there, or none."""
    values: dict[str, list[float]] = {task: [] for task in sorted({r.task for r in records})}
    for record in records:
        value = getattr(record, name)
        if value is not None and record.right:
            values[record.task].append(value)
    return values if any(values.values()) else {}


def _has_posterior(trace: Trace | None) -> bool:
    return trace is not None and "probabilities" in trace


def _figure(figure: "Drawing", caption: str) -> Figure:
    return Figure(to_svg(figure), caption)


def hand_error_text(error: HandError) -> str:
    """As `3.2 +- 2.6 cm`, or what is known of it."""
    return _absent(error.mean_cm, lambda _: error.short.replace("+-", PLUS_MINUS))


def _absent(value: float | None, form: Callable[[float], str]) -> str:
    return "\N{EN DASH}" if value is None else form(value)


def _meets(error: HandError, paper: HandError | None) -> bool | None:
    """Whether an error is no larger than the paper's; None where one of them is no mean of many."""
    if paper is None or paper.mean_cm is None or error.mean_cm is None or error.n < 2:
        return None
    return error.mean_cm <= paper.mean_cm


def _who(summary: DemoSummary) -> str:
    tasks = [readable(t) for t in summary.hand_error_by_task if t not in summary.tasks_apart]
    together = f"{' and '.join(tasks)} together, " if len(tasks) > 1 else ""
    return f"{together}n = {summary.hand_error.n}"
