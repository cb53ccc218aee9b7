# SPDX-License-Identifier: Apache-2.0
"""Few, asynchronous, noisy observations (Maeda et al. 2014, Fig. 2).

One DOF of each agent. A ProMP is conditioned on the positions as they come. A DMP needs
accelerations, which three to ten irregular samples do not have; the best one can do is to lay a
smoothing spline through them and to differentiate that.
"""

import numpy as np

from experiments.results import ExperimentResult
from experiments.settings import Settings
from experiments.sketches.models import standard_error
from experiments.sparse.conditioning import spline_choices
from experiments.sparse.report import blocks, findings
from experiments.sparse.study import METHODS, one_data_set


def run(settings: Settings) -> ExperimentResult:
    """Repeat on independent data sets: draw, choose, condition, score."""
    counts = (4, 10) if settings.quick else (3, 4, 6, 10)
    repeats = 2 if settings.quick else 10
    choices, scores = spline_choices(settings.quick), []
    for repeat in range(repeats):
        settings.progress(repeat / repeats, f"data set {repeat + 1} of {repeats}")
        scores.append(one_data_set(settings.rng(repeat), counts, choices))
    settings.progress(1.0, "figures")
    rmse = {m: np.array([s.rmse[m] for s in scores]) for m in METHODS}
    inside = np.array([s.inside for s in scores])
    acceleration = np.array([s.acceleration for s in scores])
    return ExperimentResult(
        title="Sparse, asynchronous, noisy observations",
        source="Maeda et al. 2014, Fig. 2",
        question=(
            "What do a few positions of one agent, at irregular times and with noise, say of both"
            " agents' movements, and can a DMP be conditioned on them at all?"
        ),
        findings=findings(counts, rmse, inside, acceleration),
        blocks=blocks(settings, counts, rmse, inside, acceleration),
        conditions=(
            "The paper's sketches are not published; ours are drawn by a generator.",
            "The noise of the sparse observations, which the paper does not report, has a standard"
            " deviation of 0.1 on curves that span 2 units and differ by 0.23.",
            "The paper says that the experiment cannot be done with a DMP; ours is given a"
            " smoothing spline, drawn out to the start, whose roughness, trust and shrinkage cross"
            " validation chooses for each number of observations.",
        ),
        numbers={
            "observations": list(counts),
            "rmse": {m: errors.mean(axis=0).tolist() for m, errors in rmse.items()},
            "rmse_standard_error": {
                m: standard_error(errors).tolist() for m, errors in rmse.items()
            },
            "inside_two_sigma": inside.mean(axis=0).tolist(),
            "acceleration_error": np.median(acceleration, axis=0).tolist(),
        },
    )
