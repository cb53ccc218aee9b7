# SPDX-License-Identifier: Apache-2.0
"""Report pages and their figures; this package draws and writes, but neither trains nor scores.

Each page has a file, and so have the figures on it.
"""

from intent_recognition.report.demo_report import write_arms_report, write_demo_report
from intent_recognition.report.drawing import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    PAPER_COLOUR,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
    to_png,
    to_svg,
)
from intent_recognition.report.evaluation_report import write_evaluation_report
from intent_recognition.report.explanation_report import (
    heading,
    short_name,
    without_rows,
    write_explanation_report,
)
from intent_recognition.report.figures_session import hand_error_figure
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
from intent_recognition.report.interaction_table import fields_of
from intent_recognition.report.rehearsal_report import rehearsal_tables, write_rehearsal_report
from intent_recognition.report.warp_report import write_warp_report
