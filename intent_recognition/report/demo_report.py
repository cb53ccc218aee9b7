# SPDX-License-Identifier: Apache-2.0
"""Reports of the demo: one arm's results beside the paper's, or several arms' results."""

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Literal, NamedTuple

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
    summarise,
    summary_line,
    usable,
)
from intent_recognition.report import html
from intent_recognition.report.demo_figures import (
    details,
    figures_of_posteriors,
    figures_of_records,
)
from intent_recognition.report.drawing import readable, svg_figure
from intent_recognition.report.figures_session import hand_error_figure

LARGEST_FORCE_N = 15.0
"""Largest acceptable force on a person in a transfer [N] (docs/transfer.md)."""
COLOURS = "Green: an aim is met; red: missed; blue: no aim."


class Field(NamedTuple):
    """One column: heading, unit, alignment, and its text for a record."""

    title: str
    unit: str
    align: Literal["left", "right"]
    cell: Callable[[InteractionRecord], str | None]


def _number(value: float | None, factor: float = 1.0, form: str = ".1f") -> str | None:
    return None if value is None else format(factor * value, form)


def _note(record: InteractionRecord) -> str:
    began = f"began as {record.changed_from}" if record.changed_from else ""
    missed = "" if record.right else "MISSED"
    kept = "NOT HANDED OVER" if record.handed_over is False else ""
    wrong = "WRONG HELP" if record.wrong_helps else ""
    return " ".join(filter(None, (record.person, missed, wrong, kept, began, record.note)))


FIELDS = (
    Field("#", "", "right", lambda r: str(r.index)),
    Field("true task", "", "left", lambda r: readable(r.task)),
    Field("recognised", "", "left", lambda r: readable(r.recognised)),
    Field("observations", "", "right", lambda r: _number(r.observations, form=".0f")),
    Field("decided", "s", "right", lambda r: _number(r.decision_time_s, form=".2f")),
    Field("share", "%", "right", lambda r: _number(r.decision_share, 100.0, ".0f")),
    Field("movement", "s", "right", lambda r: _number(r.movement_s, form=".2f")),
    Field("hand error", "cm", "right", lambda r: _number(r.hand_error_m, CM_PER_M)),
    Field("arrival", "s", "right", lambda r: _number(r.arrival_s, form="+.2f")),
    Field("handed over", "s", "right", lambda r: _number(r.transfer_s, form="+.2f")),
    Field("note", "", "left", _note),
)
"""Columns; "decided" counts from onset, "share" is of the human's movement, "arrival" counts from
its end."""


def fields_of(records: Sequence[InteractionRecord]) -> tuple[Field, ...]:
    """Columns of a session's table, without those that are empty for all records."""
    return tuple(field for field in FIELDS if any(map(field.cell, records)))


def demo_page(
    records: Sequence[InteractionRecord],
    summary: DemoSummary,
    traces: Sequence[Trace],
    settings: Mapping[str, object],
) -> html.ReportPage:
    """The demo's report.

    Args:
        records: all interactions, in order.
        summary: summary of the records.
        traces: arrays of any of the interactions (keys: `evaluation.Trace`); figures without data
            are left out.
        settings: names and values of the session's settings, listed at the end.
    """
    by_index = {trace["index"]: usable(trace) for trace in traces}
    labels = [label for trace in by_index.values() for label in trace.get("labels", ())]
    unchanged = [record for record in records if not record.changed_from]
    tasks_of_paper = {*PAPER_HAND_ERROR, *summary.tasks_apart}
    of_paper = any(record.task in tasks_of_paper for record in records)
    texts = (COLOURS, CONDITIONS) if of_paper else (COLOURS,)
    remarks = (html.Paragraph(text, small=True) for text in texts)
    sections = [
        html.Section("Result", (_key_numbers(summary, of_paper), *remarks)),
        *([html.Section("People", (_people(summary),))] if summary.people else []),
        html.Section("Accuracy and timing", figures_of_records(unchanged, summary, labels)),
        html.Section("Recognition", figures_of_posteriors(unchanged, by_index)),
        *details(records, by_index),
        html.Section("All interactions", (_table(records, summary),)),
        html.Section("Settings", _settings(settings)),
    ]
    count = f"{len(records)} interaction{'' if len(records) == 1 else 's'},"
    subtitle = (
        f"{count} recognised from the motion of the wrist alone; everything is"
        " measured on the ROS 2 topics, and the true task is used for scoring only."
    )
    names = " and ".join(one.person for one in summary.people)
    job = "Toolbox assembly" if of_paper else "Assembly"
    title = f"{job} of {names} with one arm" if names else f"{job} with a simulated coworker"
    return html.ReportPage(title, subtitle, tuple(sections), summary_line(summary))


def _key_numbers(summary: DemoSummary, of_paper: bool) -> html.KeyNumbers:
    n, share = summary.n, summary.median_decision_share
    helped, known = "recognised", "decided before"
    if summary.people:
        helped, known = "helped with", "recognised at"
    right, good = f"{summary.recognised_right}/{n}", not summary.too_many_missed
    paper_right = "{}/{}".format(*PAPER_RECOGNISED) if of_paper else ""
    numbers = [
        html.KeyNumber(f"tasks {helped}", right, paper_right, good),
        _all_of(f"{known} the end of the movement", summary.decided_before_end, n),
    ]
    if not summary.people:
        text = _absent(share, lambda x: f"{100 * x:.0f} %")
        early = None if share is None else share <= 0.5
        note = "of the human's movement had passed"
        numbers.append(html.KeyNumber("median decision", text, good=early, note=note))
    text = hand_error_text(summary.hand_error)
    numbers.append(html.KeyNumber("hand error", text, note=_who(summary)))
    for task, error in summary.hand_error_by_task.items():
        paper = PAPER_HAND_ERROR.get(task)
        title, ours = f"hand error, {readable(task)}", hand_error_text(error)
        theirs = hand_error_text(paper) if paper else ""
        note = f"n = {error.n}; {FIXED_PLACE}" if task in summary.tasks_apart else f"n = {error.n}"
        numbers.append(html.KeyNumber(title, ours, theirs, _meets(error, paper), note))
    text = _absent(summary.median_arrival_s, lambda x: f"{x:+.2f} s")
    note = _absent(summary.latest_arrival_s, lambda x: f"median; latest {x:+.2f} s")
    numbers.append(html.KeyNumber("robot's arrival after the movement", text, note=note))
    if summary.n_transfers:
        given = _all_of("objects handed over by force", summary.handed_over, summary.n_transfers)
        force, note = summary.largest_force_n, f"aim: at most {LARGEST_FORCE_N:g} N"
        text, good = _absent(force, lambda x: f"{x:.1f} N"), (force or 0.0) <= LARGEST_FORCE_N
        numbers += [given, html.KeyNumber("largest force of the person", text, "", good, note)]
    if summary.people:
        wrong = sum(one.wrong_helps for one in summary.people)
        note = "begun while the person neither moved nor waited"
        numbers.append(html.KeyNumber("wrong helps", str(wrong), good=not wrong, note=note))
    if summary.n_changed:
        text = f"{summary.changes_followed}/{summary.n_changed}"
        note = f"hand error {hand_error_text(summary.changed_hand_error)}"
        numbers.append(html.KeyNumber("changes of mind followed", text, note=note))
    return html.KeyNumbers(tuple(numbers))


def _all_of(label: str, count: int, n: int) -> html.KeyNumber:
    """A count out of n, coloured good if it is n."""
    return html.KeyNumber(label, f"{count}/{n}", good=count == n)


def _people(summary: DemoSummary) -> html.TableBlock:
    counts = html.text_columns("person", ">recognised", ">helped", ">handed over", ">wrong helps")
    measured = (
        html.Column("arrival", "s", form="+.2f"),
        html.Column("largest force", "N", form=".1f"),
    )
    rows = tuple(
        (
            one.person,
            *(f"{n}/{one.n}" for n in (one.recognised, one.helped, one.handed_over)),
            str(one.wrong_helps),
            one.median_arrival_s,
            one.largest_force_n,
        )
        for one in summary.people
    )
    caption = (
        "recognised: the most probable task at the end of the movement. helped: the arm did that"
        " task for this person. wrong helps: begun while the person neither moved nor waited."
        " arrival: median, after the end of the movement; the arm helps one at a time."
    )
    return html.TableBlock((*counts, *measured), rows, caption)


def _table(records: Sequence[InteractionRecord], summary: DemoSummary) -> html.TableBlock:
    fields = fields_of(records)
    columns = [html.Column(field.title, field.unit, field.align) for field in fields]
    missed = [row for row, record in enumerate(records) if not record.right]
    of_changed = summary.n_changed - summary.changes_followed
    caption = (
        "decided: after onset. share: of the human's movement at the decision. arrival, handed"
        f" over: after its end. {summary.missed + of_changed} missed."
    )
    rows = [[field.cell(one) for field in fields] for one in records]
    return html.TableBlock(columns, rows, caption, missed)


def _settings(settings: Mapping[str, object]) -> tuple[html.Block, ...]:
    if not settings:
        return ()
    rows = tuple((str(name), str(value)) for name, value in settings.items())
    return (html.TableBlock(html.text_columns("setting", "value"), rows),)


def hand_error_text(error: HandError) -> str:
    """Text such as `3.2 +- 2.6 cm`, or a part of it if the rest is not known."""
    return _absent(error.mean_cm, lambda _: str(error).replace("+-", "\N{PLUS-MINUS SIGN}"))


def _absent(value: float | None, form: Callable[[float], str]) -> str:
    return "\N{EN DASH}" if value is None else form(value)


def _meets(error: HandError, paper: HandError | None) -> bool | None:
    """Whether an error is at most the paper's; None if either has no mean and spread."""
    if paper is None or paper.mean_cm is None or error.mean_cm is None or error.n < 2:
        return None
    return error.mean_cm <= paper.mean_cm


def _who(summary: DemoSummary) -> str:
    tasks = [readable(t) for t in summary.hand_error_by_task if t not in summary.tasks_apart]
    together = f"{' and '.join(tasks)} together, " if len(tasks) > 1 else ""
    return f"{together}n = {summary.hand_error.n}"


OF_ARM: tuple[tuple[html.Column, Callable[[DemoSummary, list[float]], object]], ...] = (
    (html.Column("recognised"), lambda summary, _: f"{summary.recognised_right}/{summary.n}"),
    (html.Column("before the end"), lambda summary, _: f"{summary.decided_before_end}/{summary.n}"),
    (html.Column("median decision", form=".0%"), lambda summary, _: summary.median_decision_share),
    (
        html.Column("hand error", "cm"),
        lambda summary, _: hand_error_text(summary.hand_error).removesuffix(" cm"),
    ),
    (html.Column("median hand error", "cm", form=".1f"), lambda _, cm: median(cm) if cm else None),
    (html.Column("largest", "cm", form=".1f"), lambda _, cm: max(cm, default=None)),
    (html.Column("median arrival", "s", form="+.2f"), lambda summary, _: summary.median_arrival_s),
    (html.Column("latest", "s", form="+.2f"), lambda summary, _: summary.latest_arrival_s),
)
"""Columns of the table of arms: heading, and value from a summary and its hand errors [cm]."""
CAPTION = (
    "hand error: mean and two standard deviations over the tasks whose place depends on the human,"
    " as in the report of one arm; median and largest are of all interactions. arrival: after the"
    " end of the movement."
)


def arms_page(sessions: Mapping[str, Sequence[InteractionRecord]]) -> html.ReportPage:
    """Report of the same session with several arms, by arm."""
    errors_cm = {
        arm: [CM_PER_M * r.hand_error_m for r in records if r.hand_error_m is not None]
        for arm, records in sessions.items()
    }
    rows = [
        (arm, *(cell(summarise(records), errors_cm[arm]) for _, cell in OF_ARM))
        for arm, records in sessions.items()
    ]
    columns = (html.Column("arm", align="left"), *(column for column, _ in OF_ARM))
    caption = "Every interaction's hand error, and their mean, by arm."
    figure = svg_figure(hand_error_figure(errors_cm), caption)
    together = summary_line(summarise([one for records in sessions.values() for one in records]))
    title = "The same session with several arms"
    subtitle = "Each arm before the same simulated coworker; measured on the ROS 2 topics."
    result = html.Section("Result", (html.TableBlock(columns, rows, CAPTION), figure))
    return html.ReportPage(title, subtitle, (result,), together)
