# SPDX-License-Identifier: Apache-2.0
"""The arm reproduces mean and variance of a primitive (Paraschos et al. 2013), in physics."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from experiments.feedback.controller import FeedbackPolicy, feedback_policy
from experiments.feedback.report import CONDITIONS, blocks, findings
from experiments.feedback.study import (
    DESIGN,
    N_RUNS,
    N_RUNS_QUICK,
    Pushed,
    Reproduced,
    joint_std,
    learn_handover,
    linear_errors,
    mean_deviation,
    push_arm,
    reproduce,
    std_ratios,
    stiffer_after_the_human,
)
from experiments.results import ExperimentResult
from experiments.settings import Settings


def run(settings: Settings) -> ExperimentResult:
    """Learn a handover, execute it many times under disturbance, push the arm."""
    settings.progress(0.0, "learning")
    library, shown, test = learn_handover(settings)
    duration = float(library.durations_s[0])
    policy = feedback_policy(library.basis, shown, duration, DESIGN)
    stiffer = stiffer_after_the_human(library, test)
    n_runs = N_RUNS_QUICK if settings.quick else N_RUNS
    reproduced = [reproduce(settings, policy, n_runs, k) for k in range(2)]
    settings.progress(0.85, "pushes")
    pushes = push_arm(policy, 2 if settings.quick else 9)
    settings.progress(0.95, "figures")
    demonstrated = joint_std(library, shown)
    return _outcome(policy, demonstrated, stiffer, reproduced, pushes)


def _outcome(
    policy: FeedbackPolicy,
    demonstrated: NDArray[np.float64],
    stiffer: NDArray[np.float64],
    reproduced: Sequence[Reproduced],
    pushes: Sequence[Pushed],
) -> ExperimentResult:
    ratios = [std_ratios(policy, one) for one in reproduced]
    deviations = [mean_deviation(policy, one) for one in reproduced]
    identity = linear_errors(policy)
    softer = float(spearmanr(demonstrated.ravel(), policy.stiffness.ravel()).statistic)
    n_runs = len(reproduced[0].positions_rad)
    numbers = {
        "n_runs": n_runs,
        "std_ratio_stochastic": ratios[0].tolist(),
        "std_ratio_low_gain": ratios[1].tolist(),
        "mean_deviation_in_std_stochastic": deviations[0].tolist(),
        "mean_deviation_in_std_low_gain": deviations[1].tolist(),
        "linear_mean_error_rad": identity[0],
        "linear_std_error": identity[1],
        "stiffness_std_rank_correlation": softer,
        "stiffness_end": policy.stiffness[-1].tolist(),
        "stiffness_end_after_human_ratio": stiffer.tolist(),
        "push_start_s": [one.start_s for one in pushes],
        "push_hand_std_m": [one.spread_m for one in pushes],
        "push_deflection_m": [one.deflection_m.tolist() for one in pushes],
        "push_left_m": [one.left_m.tolist() for one in pushes],
        "saturated_steps": [one.saturated_steps for one in reproduced],
    }
    return ExperimentResult(
        title="The arm moves as its demonstrations vary",
        source="Ewerton et al. 2015, Sec. V (future work); Paraschos et al. 2013",
        question=(
            "Gains from the primitive's own variance: does the torque-controlled arm reproduce"
            " mean and variance of what was demonstrated, where a low-gain controller follows the"
            " mean alone, and is it soft where the demonstrations vary?"
        ),
        findings=findings(numbers, pushes),
        blocks=blocks(policy, demonstrated, reproduced, pushes, ratios),
        conditions=CONDITIONS,
        numbers=numbers,
    )
