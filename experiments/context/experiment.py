# SPDX-License-Identifier: Apache-2.0
"""Handovers at a box that is moved from one to the next, with and without knowing its place."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.context.report import CONDITIONS_TEXT, blocks, decided, errors_m, findings
from experiments.context.study import CONDITIONS, SHARES, DrawnSet, investigate
from experiments.results import ExperimentResult
from experiments.settings import Settings
from intent_recognition.learning import TrainingSettings

N_DRAWS, N_TRAIN, N_TEST = 10, 12, 8
"""Draws, and of each task demonstrations learned from and tests in each."""


def run(settings: Settings) -> ExperimentResult:
    """Learn and predict, once for each draw."""
    n_draws, n_train, n_test = (1, 6, 1) if settings.quick else (N_DRAWS, N_TRAIN, N_TEST)
    study = investigate(
        range(settings.seed, settings.seed + n_draws),
        n_train,
        n_test,
        TrainingSettings(n_basis=10, n_aligned_basis=10) if settings.quick else None,
        lambda share: settings.progress(0.97 * share, "draws"),
    )
    return ExperimentResult(
        title="A moved box",
        source="no paper; beside the same without the context",
        question=(
            "Two tasks end at a box that stands elsewhere each time, and the wrist turns to it"
            " late. What does it bring to know where the box stands, before the movement or on the"
            " way?"
        ),
        findings=findings(study),
        blocks=blocks(study),
        conditions=CONDITIONS_TEXT,
        numbers=_numbers(study),
    )


def _numbers(study: Sequence[DrawnSet]) -> Mapping[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        "seeds": [drawn.seed for drawn in study],
        "shares": list(SHARES),
        "end_error_m": {name: errors_m(study, name).tolist() for name in CONDITIONS},
        "inside_2_sigma": {
            name: np.mean([drawn.inside[name] for drawn in study], axis=0).tolist()
            for name in CONDITIONS
        },
        "decided_share": {
            name: [None if np.isnan(share) else float(share) for share in decided(study, name)]
            for name in CONDITIONS
        },
        "wrongly_acted_on": {
            name: sum(drawn.wrong[name] for drawn in study) for name in CONDITIONS
        },
    }
