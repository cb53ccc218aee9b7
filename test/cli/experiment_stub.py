# SPDX-License-Identifier: Apache-2.0
"""An experiment for tests of the command."""

from experiments.results import ExperimentResult, Finding
from intent_recognition.report.html import Paragraph


def run(settings):
    """Draw one number from the seed."""
    settings.progress(0.5, "drawing")
    settings.progress(0.52, "still drawing")
    value = float(settings.rng(0).standard_normal())
    finding = Finding("error [cm]", "3", f"{value:.3f}", True)
    other = Finding("of another kind", "", "7", None, "The paper says nothing of it.")
    return ExperimentResult(
        "A stub", "Nobody, Fig. 0", "Does it run?", (finding, other), (Paragraph("Here."),), (),
        {"value": value, "quick": settings.quick},
    )  # fmt: skip
