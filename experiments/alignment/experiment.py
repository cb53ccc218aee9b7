# SPDX-License-Identifier: Apache-2.0
"""Time alignment by local optimisation beside dynamic time warping (Maeda et al. 2014, III-E).

Two kinds of data: movements whose timing is known, and the shipped toolbox recordings, for which
only the smoothness of the warps and what they do to the trajectories can be told.
"""

import numpy as np

from experiments.alignment.report import blocks, conditions, findings
from experiments.alignment.study import (
    LOCAL,
    METHODS,
    MethodScore,
    Recordings,
    known_timing,
    on_recordings,
    toolbox,
)
from experiments.alignment.time_warping import Steps, dtw_available
from experiments.results import ExperimentResult
from experiments.settings import Settings


def run(settings: Settings) -> ExperimentResult:
    """Align known movements and the toolbox recordings by all methods at hand."""
    there = dtw_available()
    methods = METHODS if there else {LOCAL: METHODS[LOCAL]}
    n_sets = 2 if settings.quick else 20
    known: dict[str, list[MethodScore]] = {}
    for number in range(n_sets):
        settings.progress(0.8 * number / n_sets, "movements of known timing")
        for method, result in known_timing(settings, number, methods).items():
            known.setdefault(method, []).append(result)
    settings.progress(0.8, "toolbox recordings")
    tasks = toolbox(settings)
    recorded = {task: on_recordings(*values, methods) for task, values in tasks.items()}
    typical = {method: _typical(results) for method, results in known.items()}
    return ExperimentResult(
        title="Time alignment",
        source="Maeda et al. 2014, Sec. III-E",
        question=(
            "Does local optimisation of a smooth warp align demonstrations without the jumps of"
            " dynamic time warping, and what do the jumps do to the trajectories?"
        ),
        findings=findings(typical, recorded),
        blocks=blocks(settings, typical, recorded, tasks, methods),
        conditions=conditions(there),
        numbers={
            "known_timing": {method: _flat(result) for method, result in typical.items()},
            "toolbox": {
                task: {method: _flat(result) for method, result in results.items()}
                for task, results in recorded.items()
            },
        },
    )


def _typical(results: list[MethodScore]) -> MethodScore:
    """Median over data sets, but the worst of the longest steps."""
    walks = [result.steps for result in results]
    worst = Steps(
        max(w.largest for w in walks),
        float(np.median([w.flat for w in walks])),
        max(w.longest_flat for w in walks),
        float(np.median([w.change for w in walks])),
    )
    return MethodScore(worst, *np.median([result[1:] for result in results], axis=0).tolist())


def _flat(result: MethodScore | Recordings) -> dict[str, float]:
    """All numbers of a result by name."""
    return {**result.steps._asdict(), **dict(zip(result._fields[1:], result[1:], strict=True))}
