# SPDX-License-Identifier: Apache-2.0
"""A worker who changes his mind on the way, and one who never rests, before the estimator."""

import math
from collections.abc import Mapping

from experiments.change_of_mind.report import CONDITIONS, blocks, findings
from experiments.change_of_mind.study import ChangeStudy, investigate
from experiments.results import ExperimentResult
from experiments.settings import Settings


def run(settings: Settings) -> ExperimentResult:
    """Follow reaches of every kind of change, unchanged ones, and sessions without pauses."""
    study = investigate(settings)
    settings.progress(0.97, "report")
    return ExperimentResult(
        title="A change of mind",
        source="no paper; beside what is wanted",
        question=(
            "The goal of a reach moves to another task's on the way, or the next movement begins"
            " before the last one rests. Is that noticed, how soon, and at what cost to reaches"
            " that do not change?"
        ),
        findings=findings(study),
        blocks=blocks(study),
        conditions=CONDITIONS,
        numbers=_numbers(study),
    )


def _numbers(study: ChangeStudy) -> Mapping[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        "changes": [
            change._asdict()
            | _plain(study.cell(change)._asdict())
            | {"delays_s": [one.delay_s for one in followed if one.new_active]}
            for change, followed in study.changed.items()
        ],
        "unchanged": [_plain(one._asdict()) for one in study.unchanged],
        "sessions": [session._asdict() for session in study.sessions],
    }


def _plain(values: Mapping[str, object]) -> dict[str, object]:
    """The same with None for numbers that are not finite."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in values.items()
    }
