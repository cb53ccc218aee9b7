# SPDX-License-Identifier: Apache-2.0
"""Prediction error of Interaction DMPs and ProMPs under noise (Maeda et al. 2014, Fig. 3).

One DOF of each agent. The first samples of the observed one's curve are seen through noise, the
controlled one's whole curve is predicted. Filter, noise variance and shrinkage are chosen by cross
validation, for each number of samples, in one of two ways: anew for each level of noise, which only
who knows the level can do, or once, on the clean signal.
"""

import numpy as np
from numpy.typing import NDArray

from experiments.noise.report import Growth, blocks, conditions, findings
from experiments.noise.study import METHODS, make_plan, one_data_set
from experiments.results import ExperimentResult
from experiments.settings import Settings
from experiments.sketches.models import standard_error


def run(settings: Settings) -> ExperimentResult:
    """Repeat on independent data sets: draw, choose, predict, score."""
    plan = make_plan(settings.quick)
    rmse = []
    for repeat in range(plan.repeats):
        settings.progress(repeat / plan.repeats, f"data set {repeat + 1} of {plan.repeats}")
        rmse.append(one_data_set(settings.rng(repeat), plan))
    table = {method: np.array([run[method] for run in rmse]) for method in METHODS}
    growth = {method: _growth(errors) for method, errors in table.items()}
    settings.progress(1.0, "figures")
    return ExperimentResult(
        title="Noise: ProMP and DMP",
        source="Maeda et al. 2014, Fig. 3",
        question=(
            "How does the error of the predicted agent grow with the noise of what is seen of the"
            " other, when the model is made of positions (ProMP) and of accelerations (DMP)?"
        ),
        findings=findings(table, growth, plan),
        blocks=blocks(table, growth, plan),
        conditions=conditions(plan),
        numbers={
            "noise_variance": list(plan.levels),
            "observed_samples": list(plan.counts),
            "rmse": {method: errors.mean(axis=0).tolist() for method, errors in table.items()},
            "rmse_standard_error": {
                m: standard_error(errors).tolist() for m, errors in table.items()
            },
            "growth": {method: list(value) for method, value in growth.items()},
        },
    )


def _growth(rmse: NDArray[np.float64]) -> Growth:
    """Growth of the error of the full observation; errors (repeats, L, k)."""
    ratio = rmse[:, -1, -1] / rmse[:, 0, -1]
    return Growth(float(ratio.mean()), float(standard_error(ratio)))
