# SPDX-License-Identifier: Apache-2.0
"""Report pages and their figures; this package draws and writes, but neither trains nor scores.

Each page has a file, and so have the figures on it.
"""

from intent_recognition.report.demo_report import arms_page, demo_page, fields_of
from intent_recognition.report.drawing import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    PAPER_COLOUR,
    PREDICTED_COLOUR,
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
from intent_recognition.report.evaluation_report import evaluation_page
from intent_recognition.report.explanation_report import (
    explanation_page,
    heading,
    short_name,
    without_rows,
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
from intent_recognition.report.rehearsal_report import rehearsal_page, rehearsal_tables
from intent_recognition.report.warp_report import warp_page
