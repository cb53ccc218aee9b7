# SPDX-License-Identifier: Apache-2.0
"""Figures in the demo's report: accuracy, timing, recognition, single interactions."""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.evaluation import (
    CM_PER_M,
    PAPER_HAND_ERROR,
    DemoSummary,
    InteractionRecord,
    Trace,
    confusion_counts,
    reliability_bins,
)
from intent_recognition.promp import NONE
from intent_recognition.report import figures_session
from intent_recognition.report.drawing import readable, svg_figure
from intent_recognition.report.figures_evaluation import confusion_shares_figure, reliability_figure
from intent_recognition.report.figures_interaction import (
    POSTERIOR,
    posterior_over_time_figure,
    transfer_figure,
)
from intent_recognition.report.html import Block, Paragraph, Row, Section

POSTERIORS = (
    "Probability of each task while the human moves: thin lines are interactions, bold lines their"
    " median, ticks at the top the decisions."
)
RELIABILITY = (
    "Are the probabilities calibrated? All posteriors since the onset was detected, pooled;"
    " those of one interaction are not independent."
)
TRANSFER = (
    "The object changes hands: the person's true force on it, the load that the robot feels,"
    " and the force of its fingers; below, where the robot gives: the person's share of the load,"
    " as felt."
)


def figures_of_records(
    records: Sequence[InteractionRecord], summary: DemoSummary, labels: Sequence[str]
) -> tuple[Block, ...]:
    """Figures of hand errors, decision times and arrivals, coloured by task."""
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
        fixed = dict.fromkeys(summary.tasks_apart, "(place is fixed)")
        figure = figures_session.hand_error_figure(errors_cm, paper, fixed, labels)
        caption = "Measured hand to the place the demonstrator's rule gives, in cm."
        drawn.append(svg_figure(figure, caption))
    if shares:
        percent = {task: [100.0 * share for share in own] for task, own in shares.items()}
        what = "share of the human's movement passed at the decision [%]"
        figure = figures_session.histogram_figure(percent, what, 100.0, "{:.0f} %", labels)
        caption = "How early: 100 % is the end of the human's movement."
        if summary.people:
            caption += " One person may wait while the arm helps the other."
        drawn.append(svg_figure(figure, caption))
    if arrivals:
        what = "robot's arrival after the end of the human's movement [s]"
        figure = figures_session.histogram_figure(arrivals, what, 0.0, "{:+.2f} s", labels)
        drawn.append(svg_figure(figure, "Zero is the end of the human's movement."))
    return (Row(tuple(drawn)),) if drawn else ()


def figures_of_posteriors(
    records: Sequence[InteractionRecord], by_index: Mapping[int, Trace]
) -> tuple[Block, ...]:
    """Figures of recognised tasks and posteriors; traces are by index of the interaction."""
    if not records:
        return ()
    true, recognised = [r.task for r in records], [r.recognised for r in records]
    rows, columns, counts = confusion_counts(true, recognised)
    figure = confusion_shares_figure(counts, rows, columns)
    confusion = svg_figure(figure, "What each task was recognised as.")
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
    noticed = [p[p[:, -1] < 1.0] for p in probabilities]  # without estimates before the onset
    truth = [
        np.tile([label == r.task for label in labels], (len(p), 1))
        for (r, _), p in zip(both, noticed, strict=True)
    ]
    bins = reliability_bins(
        np.concatenate([p.ravel() for p in noticed]), np.concatenate([t.ravel() for t in truth])
    )
    reliability = svg_figure(reliability_figure(*bins), RELIABILITY)
    return svg_figure(figure, POSTERIORS), Row((confusion, reliability))


def details(records: Sequence[InteractionRecord], by_index: Mapping[int, Trace]) -> list[Section]:
    """A typical interaction of each task, and all missed interactions."""
    chosen = {}
    for task in sorted({r.task for r in records}):
        own = [r for r in records if r.task == task and r.index in by_index]
        measured = [r for r in own if r.hand_error_m is not None]
        if measured:
            measured.sort(key=lambda r: r.hand_error_m or 0.0)
            typical = measured[(len(measured) - 1) // 2]
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
    blocks: list[Block] = [Paragraph(_sentence(record))]
    if _has_posterior(trace):
        figure = posterior_over_time_figure(trace, record.movement_s)
        blocks.append(svg_figure(figure, POSTERIOR))
    if "transfer_s" in trace:
        blocks.append(svg_figure(transfer_figure(trace), TRANSFER))
    return tuple(blocks)


def _sentence(record: InteractionRecord) -> str:
    found = record.recognised not in ("", NONE)
    helps = ("helped with", "not helped"), ("recognised as", "not recognised")
    known, missed = helps[not record.person]
    parts = [f"{known} {readable(record.recognised)}" if found else missed]
    if record.observations is not None:
        parts.append(f"after {record.observations} observations")
    if record.decision_share is not None:
        parts.append(f"at {100 * record.decision_share:.0f} % of the movement")
    if record.hand_error_m is not None:
        parts.append(f"hand error {CM_PER_M * record.hand_error_m:.1f} cm")
    if record.arrival_s is not None:
        parts.append(f"arrival {record.arrival_s:+.2f} s after the end of the movement")
    if record.transfer_s is not None and record.largest_force_n is not None:
        when = f"{record.transfer_s:+.2f} s after the movement"
        parts.append(f"handed over {when} with at most {record.largest_force_n:.1f} N")
    text = ", ".join(parts)
    return f"{text[0].upper()}{text[1:]}. {record.note}".strip()


def _per_task(records: Sequence[InteractionRecord], name: str) -> dict[str, list[float]]:
    """Values per task in the order of the labels: all tasks with a record, or none of them."""
    values: dict[str, list[float]] = {task: [] for task in sorted({r.task for r in records})}
    for record in records:
        value = getattr(record, name)
        if value is not None and record.right:
            values[record.task].append(value)
    return values if any(values.values()) else {}


def _has_posterior(trace: Trace | None) -> bool:
    return trace is not None and "probabilities" in trace
