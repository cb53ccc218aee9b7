# SPDX-License-Identifier: Apache-2.0
"""The numbers of the box assembly by two humans, from what was scored and executed."""

from collections.abc import Sequence

import numpy as np

from experiments.assembly.scores import (
    CERTAIN,
    LAST,
    N_OBSERVATIONS,
    Scored,
    at_phase,
    observations_to_certainty,
    phases_of,
    spread_observations,
)
from experiments.assembly.study import AssemblyStudy, StandInScore
from intent_recognition.array_types import Floats
from sim_bridge.scenarios.assembly import FASTENING, HAND_OVER

PAPER_OBSERVATIONS = 5
"""Maeda et al. 2014: three to five observations to 100 % certainty."""
ALIGNED, KNOWN, UNKNOWN = "aligned", "known", "unknown"
NAMES = {ALIGNED: "aligned", KNOWN: "elapsed share known", UNKNOWN: "duration unknown"}
"""Ways of knowing how far a movement is."""
PREDICTED = (KNOWN, UNKNOWN)
"""Ways in which the assistant is predicted, too."""
CHI2_3 = 7.815
"""95 % quantile of the chi-square distribution with three degrees of freedom."""


def numbers_of(found: AssemblyStudy) -> dict[str, object]:
    """All numbers of the experiment, by name."""
    labels = found.first.library.labels
    counts = {way: _certainty(found.scored, labels, way) for way in NAMES}
    ambiguous = [s for s in found.scored if s.task == FASTENING]
    own = labels.index(FASTENING)
    numbers: dict[str, object] = {
        "demonstrations": len(found.scored),
        "observations": N_OBSERVATIONS,
        "single_last_fastening": float(np.mean([s.single[-LAST:, own] for s in ambiguous])),
        "single_last_hand_over": float(
            np.mean([s.single[-LAST:, labels.index(HAND_OVER)] for s in ambiguous])
        ),
        "last_within_hand_over": _inside_other(found),
        "forgetting_last_fastening": float(np.mean([s.forgetting[-LAST:, own] for s in ambiguous])),
        "fastening": len(ambiguous),
        "spread_before_cm": {t: float(np.mean(v)) for t, v in spread_cm(found.unaligned).items()},
        "spread_after_cm": {
            t: float(np.mean(v)) for t, v in spread_cm(aligned_paths(found)).items()
        },
    }
    for way, needed in counts.items():
        reached = [n for n in needed if n is not None]
        final = [
            int(np.argmax(probabilities(s, way)[-1])) == labels.index(s.task) for s in found.scored
        ]
        numbers[f"{way}_to_certainty"] = needed
        numbers[f"{way}_median_to_certainty"] = float(np.median(reached)) if reached else None
        numbers[f"{way}_within_five"] = sum(n <= PAPER_OBSERVATIONS for n in reached)
        numbers[f"{way}_right_at_end"] = sum(final)
        late = np.array([probabilities(s, way)[-LAST:, own].min() for s in ambiguous])
        numbers[f"{way}_fastening_certain"] = int(np.sum(late >= CERTAIN))
    for way in PREDICTED:
        inside = [getattr(s, way).inside[-1] for s in found.scored]
        numbers[f"{way}_coverage"] = float(np.mean(inside))
    numbers["prediction"] = {task: _prediction_numbers(found.scored, task) for task in labels}
    numbers["arm"] = _arm_numbers(found.executed, labels)
    return numbers


def _certainty(scored: Sequence[Scored], labels: Sequence[str], way: str) -> list[int | None]:
    """Observations to certainty of each left-out demonstration."""
    return [observations_to_certainty(probabilities(s, way), labels.index(s.task)) for s in scored]


def probabilities(scored: Scored, way: str) -> Floats:
    """Of the tasks before any and after each observation, (n + 1, K)."""
    return scored.aligned if way == ALIGNED else getattr(scored, way).probabilities


def _inside_other(found: AssemblyStudy) -> float:
    """Share of fastening's last observations inside the 95 % region of the hand-over."""
    library, task = found.first.library, found.first.library.labels.index(HAND_OVER)
    inside = []
    for recorded in found.first.left_out:
        if recorded.task != FASTENING:
            continue
        observations = spread_observations(recorded)[-LAST:]
        for phase, seen in zip(phases_of(recorded, observations), observations, strict=True):
            there = at_phase(library, task, phase)
            off = seen.values - there.mean
            inside.append(off @ np.linalg.solve(there.covariance, off) <= CHI2_3)
    return float(np.mean(inside))


def _prediction_numbers(scored: Sequence[Scored], task: str) -> dict[str, object]:
    """Errors of one task's predictions in cm, means over demonstrations."""
    of = [s for s in scored if s.task == task]
    numbers: dict[str, object] = {
        "mean_of_task_cm": _cm([s.mean_of_task for s in of]),
        "nearest_cm": _cm([s.nearest for s in of]),
    }
    for way in PREDICTED:
        numbers[f"{way}_path_cm"] = _cm([getattr(s, way).path_m for s in of])
        numbers[f"{way}_end_cm"] = _cm([getattr(s, way).end_m for s in of])
    return numbers


def _cm(values_m: Sequence[Floats]) -> list[float]:
    """Mean over demonstrations, in cm."""
    return (100.0 * np.mean(values_m, axis=0)).tolist()


def _arm_numbers(executed: Sequence[StandInScore], labels: Sequence[str]) -> dict[str, object]:
    """What the arm did, per task."""
    numbers: dict[str, object] = {
        "interactions": len(executed),
        "right": sum(e.run.tasks[-1:] == (e.task,) for e in executed),
        "right_at_once": sum(e.run.tasks == (e.task,) for e in executed),
        "split": sum(e.run.again for e in executed),
        "largest_torque": max(e.run.largest_torque for e in executed),
        "followed_cm": 100.0 * max(e.followed_m for e in executed),
    }
    for task in labels:
        of = [e for e in executed if e.task == task]
        numbers[task] = {
            "end_cm": [100.0 * e.end_m for e in of],
            "path_cm": [100.0 * e.path_m for e in of],
            "late_s": [e.late_s for e in of],
            "began_s": [e.run.began_s for e in of],
        }
    return numbers


def aligned_paths(found: AssemblyStudy) -> dict[str, Floats]:
    """Aligned demonstrations per task, (n, G, 6)."""
    return {task: alignment.aligned for task, alignment in found.alignments.items()}


def spread_cm(paths: dict[str, Floats]) -> dict[str, Floats]:
    """Root mean square deviation of both wrists from the mean over demonstrations, (G,)."""
    return {
        task: 100.0 * np.sqrt(np.mean(np.sum((values - values.mean(axis=0)) ** 2, axis=2), axis=0))
        for task, values in paths.items()
    }
