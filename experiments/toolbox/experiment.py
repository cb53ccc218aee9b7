# SPDX-License-Identifier: Apache-2.0
"""The toolbox from 48 demonstrations without labels (Ewerton et al. 2015, Fig. 5-8)."""

from collections.abc import Mapping

import numpy as np

from experiments.draws import for_json
from experiments.results import ExperimentResult
from experiments.settings import Settings
from experiments.toolbox.report import blocks, findings
from experiments.toolbox.study import ToolboxStudy, investigate
from intent_recognition.learning import purity


def run(settings: Settings) -> ExperimentResult:
    """Mixtures of 1 to 10 components, predictions from the final wrist, and 40 executions."""
    study = investigate(settings)
    settings.progress(0.97, "figures")
    return ExperimentResult(
        title="The toolbox without labels",
        source="Ewerton et al. 2015, Fig. 5-8",
        question=(
            "48 demonstrations of three interactions, nobody said which is which. How many"
            " patterns are found, how well does the wrist's final position tell where the hand"
            " must go, and is the right one recognised in 40 executions?"
        ),
        findings=findings(study),
        blocks=blocks(study),
        conditions=_CONDITIONS,
        numbers=_numbers(study),
    )


_CONDITIONS = (
    "Worker and arm are simulated; demonstrations as in the paper, 15, 20 and 13 of three"
    " interactions.",
    "The regions in which the three interactions end overlap on purpose, so that the final"
    " position does not tell which it is: the component is recognised from the whole movement,"
    " the trajectory conditioned on the final position alone.",
    "The clusters' covariances are regularised, as everywhere in this package; to predict, the"
    " regularisation has an equivalent sample size of one demonstration.",
    "The executions are recognised online from a stream of positions, with onset, speed and"
    " progress unknown, not from a final position; ten sessions, each from a seed of its own, are"
    " played before the estimator without ROS.",
)


def _numbers(study: ToolboxStudy) -> Mapping[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        "tasks": study.tasks.tolist(),
        "components": [t.number for t in study.tried],
        "chosen": study.chosen,
        "purity": purity(study.tasks.tolist(), study.taken.labels),
        "nll": [float(t.nll.mean()) for t in study.tried],
        "joint_rms_rad": [t.joint_rms_rad.tolist() for t in study.tried],
        "end_only_rms_rad": study.end_rms_rad.tolist(),
        "hand_error_end_alone_m": study.hand_error_m(study.end_alone).tolist(),
        "hand_error_m": study.hand_error_m(study.from_end).tolist(),
        "inside_2_sigma": float(inside_two_sigma(study)),
        "recognised_from_movement": int(study.recognised(study.from_end).sum()),
        "recognised_from_end": int(study.recognised(study.end_alone).sum()),
        "draws": for_json(study.draws),
        "executions": [e._asdict() for e in study.executions],
        "executions_right": study.n_right,
    }


def inside_two_sigma(study: ToolboxStudy) -> float:
    """Share of all true joint angles inside +-2 sigma of the prediction from the end."""
    error = np.abs(study.from_end.mean - study.pairs.controlled)
    return float(np.mean(error <= 2.0 * study.from_end.std))
