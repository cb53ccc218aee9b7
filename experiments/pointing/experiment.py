# SPDX-License-Identifier: Apache-2.0
"""The arm points where the human points, without seeing the spot (Maeda et al. 2014, Fig. 4-6)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.draws import Draw, draw_again, for_json
from experiments.pointing.report import CONDITIONS, blocks, findings
from experiments.pointing.study import (
    Tested,
    draw,
    metadata_values,
    nearest_errors,
    predict_and_execute,
)
from experiments.results import ExperimentResult
from experiments.settings import Settings
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import learn
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration

QUICK = (0, 7)
"""Recordings of a quick run, by index."""
QUICK_SPOTS = ("pointing_00", "pointing_01", "pointing_02")


def run(settings: Settings) -> ExperimentResult:
    """Learn from nine spots, condition on the human at nine others, and execute."""
    settings.progress(0.0, "learning")
    dofs = load_dofs()
    train, _ = read_demonstrations([settings.recordings("pointing/train")], dofs)
    recordings, _ = read_demonstrations([settings.recordings("pointing/test")], dofs)
    library = learn(train)
    chosen = QUICK if settings.quick else range(len(recordings))
    tested = []
    for count, index in enumerate(chosen):
        settings.progress(0.1 + 0.2 * count / len(chosen), f"test position #{index + 1}")
        tested.append(predict_and_execute(library, recordings[index], index))
    draws = draw_again(
        replace(settings, n_seeds=2) if settings.quick else settings,
        "pointing",
        draw,
        keep=(lambda folder: folder.name in QUICK_SPOTS) if settings.quick else lambda folder: True,
        progress=lambda share: settings.progress(0.3 + 0.6 * share, "other seeds"),
    )
    settings.progress(0.9, "figures")
    nearest = nearest_errors(train, tested)
    return _outcome(library, train, tested, nearest, draws)


def _outcome(
    library: TaskLibrary,
    train: list[Demonstration],
    tested: list[Tested],
    nearest: NDArray[np.float64],
    draws: list[Draw],
) -> ExperimentResult:
    errors = np.array([one.error_m for one in tested])
    predicted = np.array([np.linalg.norm(one.predicted_m - one.spot_m) for one in tested])
    teaching = np.array([float(one.metadata["teaching_error_m"]) for one in train])
    moved = metadata_values(tested[0].recording, "marker_placement_m") - metadata_values(
        train[0], "marker_placement_m"
    )
    execution = max(np.linalg.norm(t.run.pointed_m[:2] - t.predicted_m) for t in tested)
    return ExperimentResult(
        title="Pointing where the human points",
        source="Maeda et al. 2014, Fig. 4-6",
        question=(
            "Nine spots in a circle of 30 cm were shown once each: a person pointed, and the arm"
            " was led to point there too. Can the arm point at nine other spots from the person's"
            " wrist alone, without any sensor for the table?"
        ),
        findings=findings(errors, nearest, tested, draws),
        blocks=blocks(library, tested, errors, predicted, nearest, teaching, moved),
        conditions=CONDITIONS,
        numbers={
            "error_m": errors.tolist(),
            "largest_error_m": float(errors.max()),
            "mean_error_m": float(errors.mean()),
            "draws": for_json(draws),
            "predicted_error_m": predicted.tolist(),
            "nearest_demonstration_error_m": nearest.tolist(),
            "teaching_error_m": teaching.tolist(),
            "marker_moved_m": moved.tolist(),
            "largest_execution_error_m": float(execution),
            "inside_2_sigma": [one.inside for one in tested],
            "touched_table": [one.run.touched for one in tested],
        },
    )
