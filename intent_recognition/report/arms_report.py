# SPDX-License-Identifier: Apache-2.0
"""One report of the same session with several arms: a row an arm, and their hand errors."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from intent_recognition.evaluation import CM_PER_M, InteractionRecord, summarise, summary_line
from intent_recognition.report import html
from intent_recognition.report.demo_report import hand_error_text
from intent_recognition.report.drawing import svg_figure
from intent_recognition.report.figures_session import hand_error_figure

COLUMNS = (
    html.Column("arm", align="left"),
    html.Column("recognised"),
    html.Column("before the end"),
    html.Column("median decision", "%"),
    html.Column("hand error", "cm"),
    html.Column("median hand error", "cm"),
    html.Column("largest", "cm"),
    html.Column("median arrival", "s"),
    html.Column("latest", "s"),
)
CAPTION = (
    "hand error: mean and two standard deviations over the tasks whose place depends on the human,"
    " as in the report of one arm; median and largest are of all interactions. arrival: after the"
    " human's end."
)


def write_arms_report(
    path: str | Path, sessions: Mapping[str, Sequence[InteractionRecord]]
) -> Path:
    """Write the report as one HTML file."""
    errors_cm = {arm: hand_errors_cm(records) for arm, records in sessions.items()}
    rows = tuple(arm_row(arm, records) for arm, records in sessions.items())
    caption = "Every interaction's hand error, and their mean, by arm."
    figure = svg_figure(hand_error_figure(errors_cm), caption)
    together = summary_line(summarise([one for records in sessions.values() for one in records]))
    title = "The same session with several arms"
    subtitle = "Each arm before the same simulated coworker; measured on the ROS 2 topics."
    result = html.Section("Result", (html.TableBlock(COLUMNS, rows, CAPTION), figure))
    return html.write_page(path, html.ReportPage(title, subtitle, (result,), together))


def arm_row(arm: str, records: Sequence[InteractionRecord]) -> tuple[str | None, ...]:
    """What is told of one arm, in the order of `COLUMNS`."""
    summary, errors_cm = summarise(records), hand_errors_cm(records)
    share, arrival = summary.median_decision_share, summary.median_arrival_s
    return (
        arm,
        f"{summary.recognised_right}/{summary.n}",
        f"{summary.decided_before_end}/{summary.n}",
        None if share is None else f"{100.0 * share:.0f}",
        hand_error_text(summary.hand_error).removesuffix(" cm"),
        f"{median(errors_cm):.1f}" if errors_cm else None,
        f"{max(errors_cm):.1f}" if errors_cm else None,
        None if arrival is None else f"{arrival:+.2f}",
        None if summary.latest_arrival_s is None else f"{summary.latest_arrival_s:+.2f}",
    )


def hand_errors_cm(records: Sequence[InteractionRecord]) -> list[float]:
    """Those that were measured, of all tasks."""
    errors_m = (record.hand_error_m for record in records)
    return [CM_PER_M * error for error in errors_m if error is not None]
